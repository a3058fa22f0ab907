//! Depth fusion on a GPU: the arithmetic on pixels and voxels of [`isv_fusion`].
//!
//! | file | step |
//! |---|---|
//! | `views` | a plane for each pixel of an image |
//! | `allocation` | blocks that rays pass through within the band, by a hash table that all threads fill |
//! | `sums` | what the views say about each voxel, added up and resolved to samples |
//! | `kernels` | what runs there |
//!
//! Depths go to the GPU, and blocks and samples come back. Finishing, which looks from block to block, is the CPU's.

mod allocation;
pub(crate) mod kernels;
mod sums;
#[cfg(test)]
mod tests;
mod views;

pub use sums::GpuSums;
pub use views::GpuViews;

use crate::{Gpu, GpuError};
use allocation::Allocator;
use isv_fusion::backend::{FusionBackend, SampledBlocks};
use isv_fusion::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, DepthImage, Grid};
use kernels::Kernels;
use sums::SumBuffers;
use views::ViewBuffers;

/// A GPU as a backend of fusion: see [`isv_fusion::fuse_on`] and [`isv_fusion::Accumulator::with_backend`]. Blocks may be of any edge.
///
/// It works in `f32`, so that blocks at the rim of the band and single voxels may differ from the CPU's. The same images always
/// give the same volume.
#[derive(Debug)]
pub struct GpuFusion {
    gpu: Gpu,
    kernels: Kernels,
    view_buffers: ViewBuffers,
    allocator: Allocator,
    sum_buffers: SumBuffers,
}

impl GpuFusion {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::Refused`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            gpu: gpu.clone(),
            kernels: Kernels::new(gpu)?,
            view_buffers: ViewBuffers::default(),
            allocator: Allocator::default(),
            sum_buffers: SumBuffers::default(),
        })
    }
}

impl FusionBackend for GpuFusion {
    type Views = GpuViews;
    type Sums = GpuSums;

    fn views(&mut self, images: &[DepthImage], settings: &FusionSettings) -> Result<GpuViews, FusionError> {
        Ok(self.fit_planes(images, settings)?)
    }

    fn touched_blocks(
        &mut self,
        views: &GpuViews,
        grid: &Grid,
        scale: f64,
        limit: usize,
    ) -> Result<Option<Vec<BlockCoord>>, FusionError> {
        Ok(self.allocate(views, grid, scale, limit)?)
    }

    fn sample(
        &mut self,
        views: &GpuViews,
        grid: &Grid,
        coords: &[BlockCoord],
    ) -> Result<SampledBlocks, FusionError> {
        Ok(self.sample_blocks(views, grid, coords)?)
    }

    fn accumulate(
        &mut self,
        sums: &mut GpuSums,
        views: &GpuViews,
        grid: &Grid,
        touched: &[BlockCoord],
    ) -> Result<(), FusionError> {
        Ok(self.add_to_sums(sums, views, grid, touched)?)
    }

    fn coords(sums: &GpuSums) -> Vec<BlockCoord> {
        sums.coords()
    }

    fn resolve(&mut self, sums: &GpuSums, grid: &Grid) -> Result<SampledBlocks, FusionError> {
        Ok(self.resolve_sums(sums, grid)?)
    }
}
