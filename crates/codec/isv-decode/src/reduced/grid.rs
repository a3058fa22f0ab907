//! The grid of larger voxels.

use super::Lod;
use isv_volume::{Grid, GridError, Truncation, VoxelSize};

/// What a stream's grid becomes at reduced resolution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReducedGrid {
    pub(super) lod: Lod,
    /// The grid of decoded volumes.
    pub(super) grid: Grid,
    /// Clamp of the samples: the stream's truncation in codes of the larger voxel.
    pub(super) limit: i16,
}

impl ReducedGrid {
    /// Voxels grow with `lod`; the truncation shrinks by as much, rounded up to whole voxels, but to no less than 2.
    ///
    /// # Errors
    /// [`GridError::VoxelSize`] if a voxel would be too large to be stated.
    pub(crate) fn new(full: &Grid, lod: Lod) -> Result<Self, GridError> {
        let truncation = full.truncation.voxels().div_ceil(lod.voxels()).max(*Truncation::RANGE.start());
        let grid = Grid {
            voxel_size: VoxelSize::from_nanometres(full.voxel_size.nanometres() * u64::from(lod.voxels()))?,
            edge: full.edge,
            truncation: Truncation::from_voxels(truncation)?,
        };
        Ok(Self { lod, grid, limit: full.truncation.codes() >> lod.reduction() })
    }

    /// Larger voxels along an edge of a block of the stream.
    pub(super) fn side(&self) -> usize {
        self.grid.edge.voxels() >> self.lod.reduction()
    }
}
