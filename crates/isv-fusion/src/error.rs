//! Why depth images cannot become a volume.

use isv_volume::BlockEdge;
use thiserror::Error;

/// Images or settings that fusion refuses, always before memory for samples is taken.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FusionError {
    /// Not one pixel of any image can be used.
    #[error(
        "no reading in any image: {pixels} pixels, none of them with a depth above 0 and up to {max_depth_m} m"
    )]
    NoReading {
        /// Pixels of all images.
        pixels: usize,
        /// [`FusionSettings::max_depth_m`](crate::FusionSettings::max_depth_m).
        max_depth_m: f64,
    },
    /// A setting that makes no sense.
    #[error("{name} of {value} is outside {range}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// The surface needs more blocks than allowed.
    #[error(
        "the surface needs about {blocks} blocks of {edge}^3 voxels at {voxel_m} m a voxel, the limit is {limit}; \
         voxels of {voxel_that_fits_m} m fit",
        edge = edge.voxels()
    )]
    TooManyBlocks {
        /// Blocks needed, estimated from their number at the voxel size that fits.
        blocks: u64,
        /// Edge of the blocks.
        edge: BlockEdge,
        /// [`FusionSettings::max_blocks`](crate::FusionSettings::max_blocks).
        limit: usize,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which the same images stay within the limit.
        voxel_that_fits_m: f64,
    },
    /// The images reach farther from the origin than block coordinates do.
    #[error(
        "the depths reach {reach_m} m from the origin, block coordinates end at {limit_m} m with voxels of {voxel_m} m; \
         voxels of {voxel_that_fits_m} m fit"
    )]
    OutOfRange {
        /// Largest absolute coordinate of a reading and its truncation band, in metres.
        reach_m: f64,
        /// Largest coordinate that can be addressed, in metres.
        limit_m: f64,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which every coordinate is in range.
        voxel_that_fits_m: f64,
    },
}
