//! How samples relate to the world: voxel size, block edge, truncation.

use crate::BlockCoord;
use glam::DVec3;
use thiserror::Error;

/// Signed-distance codes to one voxel edge: a sample of 256 lies one voxel outside the surface.
pub const CODES_PER_VOXEL: i32 = 256;

/// A grid parameter outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum GridError {
    /// Voxel edges from 1 micrometre to 1 kilometre can be written into a stream.
    #[error("voxel size {metres} m is outside 1e-6 m to 1000 m")]
    VoxelSize {
        /// The size asked for.
        metres: f64,
    },
    /// See [`Truncation::RANGE`].
    #[error("truncation of {voxels} voxels is outside 2 to 16")]
    Truncation {
        /// The truncation asked for.
        voxels: u32,
    },
    /// See [`BlockEdge`].
    #[error("block edge {edge} is not 4, 8 or 16")]
    BlockEdge {
        /// The edge asked for.
        edge: u32,
    },
}

/// Edge of a voxel, kept in whole nanometres so that a file states it exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoxelSize {
    nanometres: u64,
}

impl VoxelSize {
    /// Smallest and largest edge in nanometres.
    pub const RANGE_NM: std::ops::RangeInclusive<u64> = 1_000..=1_000_000_000_000;

    /// From metres, rounded to the nanometre.
    ///
    /// # Errors
    /// [`GridError::VoxelSize`] outside [`Self::RANGE_NM`].
    pub fn from_metres(metres: f64) -> Result<Self, GridError> {
        let nanometres = (metres * 1e9).round();
        if !(*Self::RANGE_NM.start() as f64..=*Self::RANGE_NM.end() as f64).contains(&nanometres) {
            return Err(GridError::VoxelSize { metres });
        }
        Ok(Self { nanometres: nanometres as u64 })
    }

    /// From nanometres.
    ///
    /// # Errors
    /// [`GridError::VoxelSize`] outside [`Self::RANGE_NM`].
    pub fn from_nanometres(nanometres: u64) -> Result<Self, GridError> {
        if !Self::RANGE_NM.contains(&nanometres) {
            return Err(GridError::VoxelSize { metres: nanometres as f64 / 1e9 });
        }
        Ok(Self { nanometres })
    }

    /// In nanometres.
    #[must_use]
    pub fn nanometres(self) -> u64 {
        self.nanometres
    }

    /// In metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        self.nanometres as f64 / 1e9
    }
}

/// The truncation distance mu of Eq. 1: samples are clamped to plus or minus this.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Truncation {
    voxels: u32,
}

impl Truncation {
    /// The default: 8 voxels.
    pub const DEFAULT: Self = Self { voxels: 8 };

    /// Voxels. Below 2 no surface cell is sure of its corners; above 16 the warp's exact interpolation leaves `i32`.
    pub const RANGE: std::ops::RangeInclusive<u32> = 2..=16;

    /// From a number of voxels.
    ///
    /// # Errors
    /// [`GridError::Truncation`] outside [`Self::RANGE`].
    pub fn from_voxels(voxels: u32) -> Result<Self, GridError> {
        if !Self::RANGE.contains(&voxels) {
            return Err(GridError::Truncation { voxels });
        }
        Ok(Self { voxels })
    }

    /// In voxels.
    #[must_use]
    pub fn voxels(self) -> u32 {
        self.voxels
    }

    /// In signed-distance codes: 512 to 4096.
    #[must_use]
    pub fn codes(self) -> i16 {
        (self.voxels as i32 * CODES_PER_VOXEL) as i16
    }
}

/// Voxels along one edge of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BlockEdge {
    /// 4 voxels.
    E4,
    /// 8 voxels, the paper's choice.
    E8,
    /// 16 voxels.
    E16,
}

impl BlockEdge {
    /// From a number of voxels.
    ///
    /// # Errors
    /// [`GridError::BlockEdge`] unless it is 4, 8 or 16.
    pub fn from_voxels(edge: u32) -> Result<Self, GridError> {
        match edge {
            4 => Ok(Self::E4),
            8 => Ok(Self::E8),
            16 => Ok(Self::E16),
            _ => Err(GridError::BlockEdge { edge }),
        }
    }

    /// Voxels along the edge: 4, 8 or 16.
    #[must_use]
    pub fn voxels(self) -> usize {
        match self {
            Self::E4 => 4,
            Self::E8 => 8,
            Self::E16 => 16,
        }
    }

    /// Voxels in a block: 64, 512 or 4096.
    #[must_use]
    pub fn block_voxels(self) -> usize {
        self.voxels().pow(3)
    }

    /// Base-2 logarithm of the edge: 2, 3 or 4.
    #[must_use]
    pub fn log2(self) -> u32 {
        self.voxels().trailing_zeros()
    }

    /// Index of voxel `(x, y, z)` inside a block: x runs fastest.
    #[must_use]
    pub fn voxel_index(self, x: usize, y: usize, z: usize) -> usize {
        (z * self.voxels() + y) * self.voxels() + x
    }
}

/// The grid a volume's samples live on. Two volumes can predict each other only on equal grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Edge of a voxel.
    pub voxel_size: VoxelSize,
    /// Edge of a block.
    pub edge: BlockEdge,
    /// Clamp of the samples.
    pub truncation: Truncation,
}

impl Grid {
    /// World position, in metres, of the centre of voxel `(x, y, z)` of a block: `(block * edge + voxel + 0.5) * size`.
    #[must_use]
    pub fn voxel_centre_m(&self, block: BlockCoord, [x, y, z]: [usize; 3]) -> DVec3 {
        let edge = self.edge.voxels() as f64;
        let origin = DVec3::new(f64::from(block.x), f64::from(block.y), f64::from(block.z)) * edge;
        (origin + DVec3::new(x as f64, y as f64, z as f64) + 0.5) * self.voxel_size.metres()
    }
}
