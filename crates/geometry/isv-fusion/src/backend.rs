//! The arithmetic on pixels and voxels, apart from what is made of it: who does it.
//!
//! ```text
//! DepthImage ─> FusionBackend: a plane a pixel ─> its views ─> FusionBackend: blocks that the band reaches ─> the limit
//!                                                    └───────> FusionBackend: sums of every voxel ─> samples ─> Blocks::finish
//! ```
//!
//! What is heavy looks at each pixel and each voxel by itself: it belongs to the backend, which keeps images and sums where it
//! works. What looks at surfaces, contradictions and rims between blocks, stays on the CPU, and so do refusals.

mod cpu;

use crate::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, DepthImage, Grid, VoxelMask};
use std::fmt;

pub use crate::planes::fit_radius;
pub use cpu::{Cpu, CpuSums, CpuViews};

/// Weight after which a voxel of an [`Accumulator`](crate::Accumulator) forgets as fast as it learns: thirty readings from 1 m,
/// straight on. Something that was moved away is gone after about as many readings as had seen it, and never more than these.
pub const MOST_WEIGHT: f32 = 30.0;

/// The sample of a voxel of which nothing is known.
pub const UNKNOWN: i16 = i16::MIN;

/// What readings say about some blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledBlocks {
    /// Codes, block after block, x fastest; [`UNKNOWN`] where nothing is known.
    pub samples: Vec<i16>,
    /// Voxels that no reading observed; one mask a block.
    pub unobserved: Vec<VoxelMask>,
}

/// Backend that does the arithmetic on pixels and voxels. [`Cpu`] is the reference.
///
/// Fusion works in floating point, so other backends may round differently. A sample then differs by a code
/// or two. A reading as good as on the border of a pixel, a band or a block may fall on the other side of it.
/// The same backend gives the same result every time.
pub trait FusionBackend: fmt::Debug {
    /// The images of one instant, made ready, where this backend keeps them.
    type Views: fmt::Debug;
    /// Running sums over the readings of all voxels of an [`Accumulator`](crate::Accumulator); by default of no block.
    type Sums: fmt::Debug + Default;

    /// Fits planes to all pixels of some images (Eq. 4).
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    fn views(&mut self, images: &[DepthImage], settings: &FusionSettings)
    -> Result<Self::Views, FusionError>;

    /// The blocks that rays pass through within the band, in Morton order, each once; nothing if there are more than `limit`. The
    /// voxels of these blocks are `scale` times as large as those of `grid`; `scale` is 1 or more.
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    fn touched_blocks(
        &mut self,
        views: &Self::Views,
        grid: &Grid,
        scale: f64,
        limit: usize,
    ) -> Result<Option<Vec<BlockCoord>>, FusionError>;

    /// What the views say about some blocks (Eq. 3 to 5).
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    fn sample(
        &mut self,
        views: &Self::Views,
        grid: &Grid,
        coords: &[BlockCoord],
    ) -> Result<SampledBlocks, FusionError>;

    /// Adds what the views say to the sums of all blocks, those that they touch included, and scales sums down to [`MOST_WEIGHT`].
    ///
    /// # Errors
    /// [`FusionError::Backend`]; the sums are of no use then.
    fn accumulate(
        &mut self,
        sums: &mut Self::Sums,
        views: &Self::Views,
        grid: &Grid,
        touched: &[BlockCoord],
    ) -> Result<(), FusionError>;

    /// The blocks that there are sums of, in Morton order.
    fn coords(sums: &Self::Sums) -> Vec<BlockCoord>;

    /// What the sums say about their blocks, in Morton order.
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    fn resolve(&mut self, sums: &Self::Sums, grid: &Grid) -> Result<SampledBlocks, FusionError>;
}
