//! The decoder's arithmetic on samples, apart from its entropy decoding: who does it, and where frames are kept meanwhile.
//!
//! ```text
//! Decoder: packets, sequence, range decoder ─> symbols ─> Backend: prediction, inverse DCT, filter, extension ─> its frame
//!                  ▲ blocks, activity, crossed cells ─────────┘
//! ```
//!
//! Entropy decoding needs no samples. From the frame before, the syntax of a frame needs the blocks, which are on the CPU
//! ([`ReferenceBlocks`], [`MainBlocks`]). In profile `main` it also needs two things that are found in samples: where surface is
//! expected, and which cells it crosses.

mod cpu;

use crate::main::activity::Activity;
use crate::main::extension::ExtensionPlan;
use crate::main::{self, CausalBlocks, MainBlocks, MainParameters};
use crate::paper::{CodingParameters, FrameSymbols};
use crate::{BackendError, ReferenceBlocks};
use isv_format::MainFrameHeader;
use isv_volume::{BlockSet, SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use std::fmt;

pub use cpu::{Cpu, CpuMainFrame, CpuPaperFrame};

/// Arithmetic on samples, and the store of decoded frames. [`Cpu`] is the reference; other backends give the same bits.
///
/// After an error, unless it is one of [`Self::hash`], there is no frame to go on from: the decoder waits for a keyframe.
pub trait Backend: fmt::Debug + Send {
    /// A decoded volume where this backend keeps it: what users are given.
    type Volume: fmt::Debug;
    /// A decoded frame of profile `paper`: the reference for the next one.
    type Paper: fmt::Debug + Send;
    /// A decoded frame of profile `main`: the reference for the next one.
    type Main: fmt::Debug + Send;

    /// A frame of profile `paper` from its symbols. `before`: the frame before, except for keyframes.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn reconstruct_paper(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&Self::Paper>,
    ) -> Result<Self::Paper, BackendError>;

    /// The blocks of a frame of profile `paper`, as coded.
    fn paper_blocks(frame: &Self::Paper) -> ReferenceBlocks<'_>;

    /// The volume of a frame of profile `paper`.
    fn paper_volume(frame: &Self::Paper) -> &Self::Volume;

    /// A frame of profile `main` from its symbols: predicted, filtered and extended, with all but the masks that its bytes hold.
    /// `before`: the frame before, except for keyframes.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn reconstruct_main(
        &mut self,
        frame: MainFrame<'_>,
        before: Option<&Self::Main>,
    ) -> Result<Self::Main, BackendError>;

    /// The blocks of a frame of profile `main`, as the syntax of the next frame sees them.
    fn main_blocks(frame: &Self::Main) -> MainBlocks<'_>;

    /// The volume of a frame of profile `main`, once it has its masks.
    fn main_volume(frame: &Self::Main) -> &Self::Volume;

    /// The volume of a frame of profile `main` at full resolution, on the CPU, once it has its masks: what its colour lies on.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn main_field(&mut self, frame: &Self::Main) -> Result<SparseVolume, BackendError>;

    /// The unsettled blocks of a frame that have corners of crossed cells, in order, with those voxels: see
    /// [`crossed_corners`](main::crossed_cells::crossed_corners). Asked before [`Self::add_masks`], and only of frames
    /// whose bytes hold masks.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn crossed_corners(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError>;

    /// The crossed cells of a frame that have a corner in an unsettled block: see
    /// [`cells_at_unsettled`](main::crossed_cells::cells_at_unsettled). Asked as [`Self::crossed_corners`] is, of streams that code
    /// masks by cell.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn crossed_cells(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError>;

    /// Adds the unobserved voxels that a frame's bytes hold, by block; no empty masks. Called once for each frame, whether there
    /// are any or not: it is complete then.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn add_masks(
        &mut self,
        frame: &mut Self::Main,
        masks: BTreeMap<u32, VoxelMask>,
    ) -> Result<(), BackendError>;

    /// Computes the activity that is expected in the next frame: one for each block of this frame, in order. The blocks `skipped`
    /// stay as they are. See [`expected_activity`](main::activity::expected_activity).
    ///
    /// # Errors
    /// See [`BackendError`].
    fn expected_activity(
        &mut self,
        frame: &Self::Main,
        skipped: &BlockSet,
    ) -> Result<Vec<Activity>, BackendError>;

    /// Takes back a frame that nothing is predicted from any more, for its memory.
    fn retire(&mut self, frame: Self::Main) {
        drop(frame);
    }

    /// [`volume_hash`](crate::volume_hash) of a volume.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn hash(&mut self, volume: &Self::Volume) -> Result<u64, BackendError>;

    /// Whether what is decoded is what the encoder had, so that hashes can be compared.
    fn is_exact(&self) -> bool {
        true
    }
}

/// All that is known of a frame of profile `main` before its samples.
#[derive(Debug)]
pub struct MainFrame<'a> {
    /// What holds for every frame of the stream.
    pub parameters: &'a MainParameters,
    /// The step, the in-loop filter and which tools are used.
    pub header: &'a MainFrameHeader,
    /// The coded blocks with their modes and levels, and which blocks of the frame before stay as they are.
    pub symbols: main::FrameSymbols,
    /// Which coded blocks precede each other in their slices: what spatial prediction looks at.
    pub causal: &'a CausalBlocks,
    /// Which blocks the frame has once it is extended, and where their samples come from.
    pub plan: ExtensionPlan,
    /// Whether blocks are predicted from the frame before. If not, skip cells may still be taken over from it.
    pub predicts: bool,
}
