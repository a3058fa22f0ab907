//! Why a mesh or a point cloud cannot become a volume.

use isv_volume::{FitError, MeshError, PointsError};
use thiserror::Error;

/// A mesh, a point cloud or a setting that ingest refuses, always before memory for the volume is taken.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IngestError {
    /// The mesh itself is broken.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The point cloud itself is broken.
    #[error(transparent)]
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
    /// The surface does not fit on the grid.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The offset of Eq. 9 must keep both sides of the shell inside the truncation band.
    #[error("offset of {voxels} voxels is not between 0 and the truncation of {truncation} voxels")]
    Offset {
        /// The offset asked for.
        voxels: f64,
        /// The truncation of the grid.
        truncation: u32,
    },
}
