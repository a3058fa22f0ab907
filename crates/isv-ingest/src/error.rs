//! Why a mesh cannot become a volume.

use isv_volume::{BlockEdge, MeshError};
use thiserror::Error;

/// A mesh or a setting that ingest refuses, always before memory for the volume is taken.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IngestError {
    /// The mesh itself is broken.
    #[error("invalid mesh: {0}")]
    Mesh(#[from] MeshError),
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
        /// [`MeshIngest::max_blocks`](crate::MeshIngest::max_blocks).
        limit: usize,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which the same mesh stays within the limit.
        voxel_that_fits_m: f64,
    },
    /// The mesh reaches farther from the origin than block coordinates do.
    #[error(
        "the mesh reaches {reach_m} m from the origin, block coordinates end at {limit_m} m with voxels of {voxel_m} m; \
         voxels of {voxel_that_fits_m} m fit"
    )]
    OutOfRange {
        /// Largest absolute coordinate of the mesh and its truncation band, in metres.
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
