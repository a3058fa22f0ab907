//! Why a mesh or a point cloud cannot become a volume.

use isv_volume::{BlockEdge, MeshError, PointsError};
use thiserror::Error;

/// A mesh, a point cloud or a setting that ingest refuses, always before memory for the volume is taken.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IngestError {
    /// The mesh itself is broken.
    #[error("invalid mesh: {0}")]
    Mesh(#[from] MeshError),
    /// The point cloud itself is broken.
    #[error("invalid points: {0}")]
    Points(#[from] PointsError),
    /// Oriented points none of which has a normal.
    #[error("no point has a normal: have them estimated, or take the offset shell, which needs none")]
    NoNormals,
    /// Points too far apart to be a surface at this voxel size.
    #[error(
        "the points are about {spacing_m} m apart, too far to be a surface of {voxel_m} m voxels; voxels of \
         {voxel_that_fits_m} m fit"
    )]
    TooSparse {
        /// The median distance between neighbouring points, in metres.
        spacing_m: f64,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which half of the points are close enough to each other.
        voxel_that_fits_m: f64,
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
        /// `max_blocks` of the settings.
        limit: usize,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which the same surface stays within the limit.
        voxel_that_fits_m: f64,
    },
    /// The surface reaches farther from the origin than block coordinates do.
    #[error(
        "the surface reaches {reach_m} m from the origin, block coordinates end at {limit_m} m with voxels of {voxel_m} m; \
         voxels of {voxel_that_fits_m} m fit"
    )]
    OutOfRange {
        /// Largest absolute coordinate of the surface and its truncation band, in metres.
        reach_m: f64,
        /// Largest coordinate that can be addressed, in metres.
        limit_m: f64,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which every coordinate is in range.
        voxel_that_fits_m: f64,
    },
    /// The offset of Eq. 9 must keep both sides of the shell inside the truncation band.
    #[error("offset of {voxels} voxels is not between 0 and the truncation of {truncation} voxels")]
    Offset {
        /// The offset asked for.
        voxels: f64,
        /// The truncation of the grid.
        truncation: u32,
    },
}
