//! Depth images to sparse TSDF volumes (paper Sec. 3.2, projective TSDF fusion, Eq. 3 to 5).
//!
//! Each voxel near a surface that a camera saw is projected into that camera's image and gets the distance to
//! what the pixel shows. The distances from all images are averaged (Curless and Levoy 1996). What no camera
//! saw stays unobserved, and no surface is drawn there. Work and memory grow with the area of the surface,
//! never with the volume of space.
//!
//! - [`fuse`] makes a volume of the images of one instant: a rig of cameras around a performance.
//! - An [`Accumulator`] goes on: a moving camera maps a scene that stands still, and later images refine and extend the
//!   volume.
//!
//! ```
//! use glam::{DMat4, DVec2};
//! use isv_fusion::{FusionSettings, fuse};
//! use isv_volume::{BlockEdge, CameraPose, DepthImage, Grid, Intrinsics, Truncation, VoxelSize};
//!
//! let lens = Intrinsics { width: 64, height: 48, focal: DVec2::splat(50.0), principal: DVec2::new(31.5, 23.5) };
//! let wall = DepthImage::new(lens, CameraPose::from_matrix(DMat4::IDENTITY)?, vec![2.0; 64 * 48])?;
//! let volume = fuse(&[wall], &FusionSettings::new(Grid {
//!     voxel_size: VoxelSize::from_metres(0.05)?,
//!     edge: BlockEdge::E8,
//!     truncation: Truncation::DEFAULT,
//! }))?;
//! assert!(volume.samples().any(|s| s > 0) && volume.samples().any(|s| s < 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The arithmetic on pixels and voxels belongs to a [`backend`], of which the CPU is the reference.
//!
//! How it works, by private module: `planes` fits a plane to each pixel of an image and finds the jumps in
//! depth. `view` puts the planes into space and weighs them. `allocation` finds the blocks that they touch,
//! and `integrate` adds up what they say about each voxel. `blocks` makes samples of the sums.
//! `contradictions` and `rims` make unobserved where a surface would be drawn that nobody saw. `continuation`
//! chooses samples without a reading, and `limits` refuses what cannot be done.
//!
//! What it does not do: find poses, undistort images, or use colour.

mod accumulator;
mod allocation;
pub mod backend;
mod blocks;
mod continuation;
mod contradictions;
mod error;
mod integrate;
mod limits;
mod planes;
mod resolution;
mod rims;
mod view;

#[cfg(test)]
mod tests;

pub use accumulator::Accumulator;
pub use error::FusionError;
pub use resolution::{DepthResolution, sample_readings};

use backend::{Cpu, FusionBackend};
use blocks::Blocks;
use isv_volume::{DepthImage, Grid, SparseVolume};

/// Blocks a volume may have by default: 2 GiB of samples with blocks of 8 voxels.
pub const DEFAULT_BLOCK_LIMIT: usize = 1 << 21;

/// Noise of inverse depth by default, in 1/m: two steps of the first Kinect, 2.4 cm at 2 m.
pub const DEFAULT_NOISE: f64 = 0.006;

/// How depth images become volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// The grid to sample on.
    pub grid: Grid,
    /// Readings farther away than this along z, in metres, are left out; infinite to use all.
    pub max_depth_m: f64,
    /// Largest difference of the inverse depths of neighbouring pixels on one surface through noise, in 1/m:
    /// this times the square of the depth in metres. Steps larger than noise and slant explain are jumps.
    pub noise: f64,
    /// Images that need more blocks are refused. A block of a volume takes two bytes a voxel, one of an [`Accumulator`]
    /// twelve.
    pub max_blocks: usize,
}

impl FusionSettings {
    /// The defaults on a grid: all depths, [`DEFAULT_NOISE`], [`DEFAULT_BLOCK_LIMIT`].
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { grid, max_depth_m: f64::INFINITY, noise: DEFAULT_NOISE, max_blocks: DEFAULT_BLOCK_LIMIT }
    }
}

/// Fuses the images of one instant into a volume.
///
/// The blocks are those with an observed voxel inside the truncation band of a reading. In them, voxels in
/// front of the band that were seen to be free have the largest sample. The result does not depend on the
/// number of threads.
///
/// # Errors
/// See [`FusionError`]; all of them are found before memory for samples is taken.
pub fn fuse(images: &[DepthImage], settings: &FusionSettings) -> Result<SparseVolume, FusionError> {
    fuse_on(&mut Cpu, images, settings)
}

/// Fuses depth images into a volume, with the arithmetic on pixels and voxels done by a backend.
///
/// # Errors
/// See [`FusionError`].
pub fn fuse_on<B: FusionBackend>(
    backend: &mut B,
    images: &[DepthImage],
    settings: &FusionSettings,
) -> Result<SparseVolume, FusionError> {
    let views = limits::checked_views(backend, images, settings)?;
    let coords = limits::checked_blocks(backend, &views, settings, &[])?;
    let sampled = backend.sample(&views, &settings.grid, &coords)?;
    Ok(Blocks::new(settings.grid, coords, sampled).finish())
}
