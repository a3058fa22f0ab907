//! A set of voxels within one block.

use crate::BlockEdge;
use std::sync::Arc;

/// One bit a voxel of a block, in voxel-index order (x fastest). Copies share their memory until one is changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VoxelMask {
    words: Arc<[u64]>,
}

impl VoxelMask {
    /// The empty set for a block of this edge.
    #[must_use]
    pub fn empty(edge: BlockEdge) -> Self {
        Self { words: vec![0; edge.block_voxels() / 64].into() }
    }

    /// The set of all voxels of a block of this edge.
    #[must_use]
    pub fn full(edge: BlockEdge) -> Self {
        Self { words: vec![u64::MAX; edge.block_voxels() / 64].into() }
    }

    /// The set of the voxels whose bits are set, lowest voxel index in the lowest bit.
    #[must_use]
    pub fn from_words(words: &[u64]) -> Self {
        Self { words: words.into() }
    }

    /// The voxels that are in both sets, in a block of the same edge.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self { words: self.words.iter().zip(&*other.words).map(|(a, b)| a & b).collect() }
    }

    /// Whether a voxel is in the set.
    #[must_use]
    pub fn contains(&self, voxel: usize) -> bool {
        self.words[voxel / 64] >> (voxel % 64) & 1 != 0
    }

    /// Adds a voxel.
    pub fn insert(&mut self, voxel: usize) {
        Arc::make_mut(&mut self.words)[voxel / 64] |= 1 << (voxel % 64);
    }

    /// Adds all voxels of another set in a block of the same edge.
    pub fn insert_all(&mut self, other: &Self) {
        Arc::make_mut(&mut self.words).iter_mut().zip(&*other.words).for_each(|(word, more)| *word |= more);
    }

    /// Takes a voxel out.
    pub fn remove(&mut self, voxel: usize) {
        Arc::make_mut(&mut self.words)[voxel / 64] &= !(1 << (voxel % 64));
    }

    /// Whether no voxel is in the set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|w| *w == 0)
    }

    /// Number of voxels in the set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Words of 64 voxels, lowest voxel index in the lowest bit.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }
}
