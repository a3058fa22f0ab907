//! A frame whose blocks are looked for in the frame before all at once, before its slices begin.

use super::motion_search::{CUBES, cubes};
use super::target::Targets;
use isv_decode::main::{MainReference, Vector};
use isv_volume::BlockCoord;
use std::ops::Range;

/// Displacements in voxels, x first, at which the frame before may have a block's surface. They were found for the block itself,
/// and for the cubes of 2^3 and of 4^3 blocks that it is in.
pub type BlockShifts = [[f32; 3]; 3];

/// The blocks of a frame that are to be coded, as a [`SearchBackend`](crate::SearchBackend) is told of them. They are of 8 voxels
/// along an edge, in Morton order.
#[derive(Debug)]
pub struct MotionQuery<'a> {
    before: &'a MainReference,
    targets: &'a Targets<'a>,
}

impl<'a> MotionQuery<'a> {
    pub(super) fn new(before: &'a MainReference, targets: &'a Targets<'a>) -> Self {
        Self { before, targets }
    }

    /// Coordinates of the blocks.
    #[must_use]
    pub fn coords(&self) -> &[BlockCoord] {
        self.targets.coords()
    }

    /// The samples of a block in codes, x fastest, then y, then z.
    #[must_use]
    pub fn samples(&self, block: usize) -> &[i16; 512] {
        self.targets.samples(block)
    }

    /// The voxels of a block at the ends of edges that the surface crosses, whose errors have a weight of 1. A word is a z, a byte
    /// a y, a bit an x.
    #[must_use]
    pub fn crossed(&self, block: usize) -> &[u64; 8] {
        self.targets.crossed(block)
    }

    /// The voxels of a block that were not observed, which have no weight.
    #[must_use]
    pub fn unobserved(&self, block: usize) -> &[u64; 8] {
        self.targets.unobserved(block)
    }

    /// Weight of all other voxels within 1.5 voxels of the surface. What is further away has none.
    #[must_use]
    pub fn near_weight(&self) -> f32 {
        self.targets.near_weight()
    }

    /// The vector of the block at the same place in the frame before, if it had one.
    #[must_use]
    pub fn vector_before(&self, block: usize) -> Option<Vector> {
        self.before.blocks().coded(self.coords()[block])?.vector
    }

    /// The blocks of each cube that is searched as a whole, of 4^3 blocks and then of 2^3, with the base-2 logarithm of its edge.
    #[must_use]
    pub fn cubes(&self) -> [(u32, Vec<Range<usize>>); 2] {
        CUBES.map(|log2| (log2, cubes(self.coords(), log2)))
    }
}
