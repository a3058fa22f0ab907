//! Decoding at reduced resolution.
//!
//! A frame of profile `main` is decoded in full and sampled down. One of profile `paper` comes straight from the lowest
//! coefficients. The `edge / 2` (or `edge / 4`) lowest frequencies along each axis give a block's samples at the centres of cubes
//! of 2^3 (4^3) voxels. Its prediction is warped from a reference that is kept at that resolution. This drifts from a full decode
//! that is sampled down, until the next keyframe: see `docs/design/013-lod.md` for how far.

mod downsample;
mod frame;
mod grid;
mod regroup;

pub(crate) use downsample::downsample;
pub(crate) use frame::{ReducedFrame, ReducedParameters};
pub(crate) use grid::ReducedGrid;

/// Level of detail: the edge of a decoded voxel, in voxels of the stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Lod {
    /// 1: what was coded.
    #[default]
    Full,
    /// 2: an eighth of the voxels.
    Half,
    /// 4: a sixty-fourth of the voxels.
    Quarter,
}

impl Lod {
    /// From the edge: 1, 2 or 4; `None` for any other.
    #[must_use]
    pub fn from_voxels(edge: u32) -> Option<Self> {
        match edge {
            1 => Some(Self::Full),
            2 => Some(Self::Half),
            4 => Some(Self::Quarter),
            _ => None,
        }
    }

    /// The edge: 1, 2 or 4.
    #[must_use]
    pub fn voxels(self) -> u32 {
        1 << self.reduction()
    }

    /// Base-2 logarithm of the edge.
    pub(crate) fn reduction(self) -> u32 {
        match self {
            Self::Full => 0,
            Self::Half => 1,
            Self::Quarter => 2,
        }
    }
}
