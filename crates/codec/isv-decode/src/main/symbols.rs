//! What a frame's bytes say, before any arithmetic on samples.

use super::BlockLevels;
use isv_kernels::block8;
use isv_kernels::warp::STEPS_PER_VOXEL;
use isv_volume::{BlockCoord, BlockSet};

/// Steps of vectors, quarter voxels, to the edge of a block.
pub(super) const STEPS_PER_BLOCK: i32 = STEPS_PER_VOXEL * block8::EDGE as i32;

/// Motion vector of a block: a translation into the frame before, in quarter voxels, of which a voxel has
/// [`STEPS_PER_VOXEL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vector(pub [i16; 3]);

impl Vector {
    /// No motion.
    pub const ZERO: Self = Self([0; 3]);
    /// Largest component, in quarter voxels: 32 voxels.
    pub const LIMIT: i16 = 128;

    /// Whether every component is within [`Self::LIMIT`].
    #[must_use]
    pub fn in_range(self) -> bool {
        self.0.iter().all(|component| component.unsigned_abs() <= Self::LIMIT.unsigned_abs())
    }

    /// The whole voxels of the translation, rounded down.
    #[must_use]
    pub fn whole_voxels(self) -> [i32; 3] {
        self.0.map(|steps| i32::from(steps).div_euclid(STEPS_PER_VOXEL))
    }

    /// Fraction of the translation beyond [`Self::whole_voxels`], in quarter voxels: 0 to 3.
    #[must_use]
    pub fn rest(self) -> [u8; 3] {
        self.0.map(|steps| i32::from(steps).rem_euclid(STEPS_PER_VOXEL) as u8)
    }
}

/// How a block is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockMode {
    /// From its neighbours: their surface continued.
    Spatial,
    /// From the frame before, with a vector among the candidates that decoder and encoder both know.
    Merged {
        /// Place of the vector among the candidates.
        candidate: u8,
        /// The vector it is.
        vector: Vector,
    },
    /// From the frame before, with a vector of its own.
    New {
        /// The vector.
        vector: Vector,
    },
}

impl BlockMode {
    /// The vector, if the block is predicted from the frame before.
    #[must_use]
    pub fn vector(self) -> Option<Vector> {
        match self {
            Self::Spatial => None,
            Self::Merged { vector, .. } | Self::New { vector } => Some(vector),
        }
    }

    /// Class in contexts: 0 merged, 1 new, 2 spatial.
    #[must_use]
    pub fn class(self) -> usize {
        match self {
            Self::Merged { .. } => 0,
            Self::New { .. } => 1,
            Self::Spatial => 2,
        }
    }
}

/// The decoded symbols of one frame, without its masks, which need the samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameSymbols {
    /// Blocks of the frame before in cells of 4x4x4 blocks that stay as they are.
    pub skipped: BlockSet,
    /// Coded blocks in Morton order, none of them in these cells.
    pub coords: Vec<BlockCoord>,
    /// How each is predicted.
    pub modes: Vec<BlockMode>,
    /// Their levels.
    pub levels: BlockLevels,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_are_in_range_up_to_their_limit() {
        for (component, expected) in [
            (0, true),
            (128, true),
            (-128, true),
            (129, false),
            (-129, false),
            (i16::MAX, false),
            (i16::MIN, false),
        ] {
            assert_eq!(Vector([0, component, 0]).in_range(), expected, "{component}");
        }
    }
}
