//! Decoding on a GPU: the arithmetic on samples of [`isv_decode`], with the same bits.
//!
//! | file | step |
//! |---|---|
//! | `paper_frame` | a frame of profile `paper`: rigid motion and residual |
//! | `main_frame` | a frame of profile `main`, step by step |
//! | `coded_blocks` | its coded blocks: prediction, residual, in-loop filter |
//! | `extrapolated_blocks` | the blocks beside them: extrapolation, and faces between blocks of different signs |
//! | `syntax_readback` | what entropy decoding needs of samples: expected activity, crossed cells |

pub(crate) mod coded_blocks;
mod extrapolated_blocks;
mod kernels;
mod main_frame;
pub(crate) mod paper_frame;
pub(crate) mod resources;
pub(crate) mod scale;
pub(crate) mod shaders;
mod syntax_readback;
#[cfg(test)]
mod tests;

use crate::{GpuError, GpuVolume, VolumeStore};
use isv_decode::backend::{Backend, MainFrame};
use isv_decode::main::MainBlocks;
use isv_decode::main::activity::Activity;
use isv_decode::main::cell_corners::CellCorners;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_decode::{BackendError, ReferenceBlocks, volume_hash};
use isv_volume::{BlockEdge, BlockSet, SparseVolume, VoxelMask};
use resources::DecodeResources;
use std::collections::BTreeMap;
use std::sync::Arc;

pub use main_frame::GpuMainFrame;
pub use paper_frame::GpuPaperFrame;

/// A [`Backend`] that keeps frames on a GPU.
///
/// It decodes blocks of 8 voxels: all of profile `main`, and of profile `paper` the streams that have them. Those it encodes too
/// ([`EncodeBackend`](isv_encode::EncodeBackend)).
#[derive(Debug)]
pub struct GpuBackend(pub(crate) DecodeResources);

impl GpuBackend {
    /// A backend that keeps its volumes in a store.
    ///
    /// # Errors
    /// [`GpuError::Refused`] if the driver does not take a kernel.
    pub fn new(store: &VolumeStore) -> Result<Self, GpuError> {
        DecodeResources::new(store).map(Self)
    }

    /// Store of the backend's volumes.
    #[must_use]
    pub fn store(&self) -> &VolumeStore {
        &self.0.store
    }
}

/// Whether blocks are those that kernels are for.
///
/// # Errors
/// [`BackendError::Unsupported`] if not.
pub(crate) fn check_edge(edge: BlockEdge) -> Result<(), BackendError> {
    match edge {
        BlockEdge::E8 => Ok(()),
        _ => Err(BackendError::Unsupported("blocks of another edge than 8 voxels")),
    }
}

impl Backend for GpuBackend {
    type Volume = GpuVolume;
    type Paper = GpuPaperFrame;
    type Main = GpuMainFrame;

    fn reconstruct_paper(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&GpuPaperFrame>,
    ) -> Result<GpuPaperFrame, BackendError> {
        check_edge(parameters.grid.edge)?;
        Ok(self.0.paper_frame(parameters, symbols, before)?)
    }

    fn paper_blocks(frame: &GpuPaperFrame) -> ReferenceBlocks<'_> {
        frame.blocks()
    }

    fn paper_volume(frame: &GpuPaperFrame) -> &GpuVolume {
        &frame.volume
    }

    fn reconstruct_main(
        &mut self,
        frame: MainFrame<'_>,
        before: Option<&GpuMainFrame>,
    ) -> Result<GpuMainFrame, BackendError> {
        Ok(self.0.main_frame(frame, before)?)
    }

    fn main_blocks(frame: &GpuMainFrame) -> MainBlocks<'_> {
        frame.blocks()
    }

    fn main_volume(frame: &GpuMainFrame) -> &GpuVolume {
        &frame.volume
    }

    fn main_field(&mut self, frame: &GpuMainFrame) -> Result<SparseVolume, BackendError> {
        Ok(frame.volume.download()?)
    }

    fn crossed_corners(&mut self, frame: &GpuMainFrame) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        let MainBlocks { blocks, sets, .. } = frame.blocks();
        Ok(CellCorners::new(blocks, sets).of_cells(&frame.readback.cells))
    }

    fn crossed_cells(&mut self, frame: &GpuMainFrame) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        Ok(frame.readback.cells.clone())
    }

    fn add_masks(
        &mut self,
        frame: &mut GpuMainFrame,
        masks: BTreeMap<u32, VoxelMask>,
    ) -> Result<(), BackendError> {
        let unobserved = Arc::make_mut(&mut frame.volume.unobserved);
        for (block, mask) in masks {
            unobserved.entry(block).and_modify(|before| before.insert_all(&mask)).or_insert(mask);
        }
        Ok(())
    }

    fn expected_activity(
        &mut self,
        frame: &GpuMainFrame,
        skipped: &BlockSet,
    ) -> Result<Vec<Activity>, BackendError> {
        Ok(frame.expected_activity(skipped))
    }

    fn hash(&mut self, volume: &GpuVolume) -> Result<u64, BackendError> {
        Ok(volume_hash(&volume.download()?))
    }
}
