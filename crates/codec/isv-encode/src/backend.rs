//! The arithmetic on samples that an encoder can leave to others: who does it. In profile `paper` all but the writing of symbols:
//!
//! ```text
//! SparseVolume ─> EncodeBackend: motion search ─> vectors ─> EncodeBackend: residual, DCT, quantizer ─> levels ─> range coder
//!                      ▲                                                 └─ inverse DCT: its frame ─┐
//!                      └────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! In profile `main` the cost of a block depends on all blocks before it. The CPU finds it together with the symbols. Where the
//! frame before has a block's surface does not depend on them: a [`SearchBackend`] can find that.

mod cpu;

use crate::main::{BlockShifts, MotionQuery};

use isv_decode::BackendError;
use isv_decode::backend::Backend;
use isv_decode::main::MainReference;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use isv_volume::SparseVolume;
use std::fmt;

/// What an encoder of profile `paper` asks of whoever does its arithmetic on samples. [`Cpu`](isv_decode::backend::Cpu) is the
/// reference.
///
/// Vectors are a choice, for which floating point may be used: those of two backends may differ. Under the same vectors all give
/// the same levels and the same frame.
pub trait EncodeBackend: Backend {
    /// A frame to be coded, where this backend keeps it.
    type Source: fmt::Debug;

    /// Takes a frame to be coded.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn upload(&mut self, volume: &SparseVolume) -> Result<Self::Source, BackendError>;

    /// One vector a block of the source (Sec. 3.5, Eq. 12 to 14); zero for blocks without a reference.
    ///
    /// - `prediction`: one that has motion.
    /// - `references`: of [`FrameSymbols::find_references`] in `before`.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn search_motion(
        &mut self,
        prediction: Prediction,
        source: &Self::Source,
        references: &[Option<u32>],
        before: &Self::Paper,
    ) -> Result<Vec<MotionVector>, BackendError>;

    /// Codes a source under the prediction and the motion of its symbols. Fills in their levels (Sec. 3.3, Eq. 10) and returns the
    /// frame that they give (Eq. 11). [`Backend::reconstruct_paper`] makes the same frame of the same symbols.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn code_paper(
        &mut self,
        parameters: &CodingParameters,
        source: &Self::Source,
        symbols: &mut FrameSymbols,
        before: Option<&Self::Paper>,
    ) -> Result<Self::Paper, BackendError>;
}

/// What an encoder of profile `main` asks of whoever searches for motion. [`Cpu`](isv_decode::backend::Cpu) is the reference: it has
/// slices search as they go, for some blocks from what their neighbours' vectors turned out to be.
///
/// Shifts are a choice, for which floating point may be used: those of two backends may differ.
pub trait SearchBackend: fmt::Debug + Send + Sync {
    /// Takes a decoded frame in which the next one will be looked for. Blocks that are not among its
    /// [`fresh`](isv_decode::main::extension::FrameBlocks::fresh) ones are as they were in the frame that was taken before.
    ///
    /// # Errors
    /// See [`BackendError`]. The frame taken before stays.
    fn keep(&mut self, frame: &MainReference) -> Result<(), BackendError>;

    /// Looks for each block of a frame in the one that was taken last; `None` leaves it to the slices.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn find_shifts(&mut self, frame: &MotionQuery) -> Result<Option<Vec<BlockShifts>>, BackendError>;
}
