//! The sparse TSDF volume of one frame.

use crate::{BlockCoord, BlockIndex, Grid, VoxelMask};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// A frame: blocks in Morton order, each voxel a signed-distance code in `-truncation..=truncation`.
///
/// Voxels are observed (W = 1 in Eq. 2) unless their block's mask says otherwise; blocks that are not there hold
/// nothing within the truncation band.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseVolume {
    grid: Grid,
    coords: Vec<BlockCoord>,
    samples: Vec<i16>,
    unobserved: BTreeMap<u32, VoxelMask>,
}

impl SparseVolume {
    /// A volume without blocks.
    #[must_use]
    pub fn empty(grid: Grid) -> Self {
        Self { grid, coords: Vec::new(), samples: Vec::new(), unobserved: BTreeMap::new() }
    }

    /// Assembles a volume from parts that are already in Morton order.
    ///
    /// - `samples`: one block after the other, `edge^3` codes each, x fastest.
    /// - `unobserved`: block index to the voxels of it that were not observed; no empty masks.
    ///
    /// # Panics
    /// If the lengths do not fit or (debug builds) the order or the range of samples is wrong.
    #[must_use]
    pub fn from_parts(
        grid: Grid,
        coords: Vec<BlockCoord>,
        samples: Vec<i16>,
        unobserved: BTreeMap<u32, VoxelMask>,
    ) -> Self {
        assert_eq!(
            samples.len(),
            coords.len() * grid.edge.block_voxels(),
            "one block of samples a coordinate"
        );
        debug_assert!(coords.windows(2).all(|w| w[0].morton() < w[1].morton()), "blocks in Morton order");
        debug_assert!(
            samples.iter().all(|s| s.abs() <= grid.truncation.codes()),
            "samples within truncation"
        );
        debug_assert!(unobserved.values().all(|m| !m.is_empty()));
        Self { grid, coords, samples, unobserved }
    }

    /// The grid the samples live on.
    #[must_use]
    #[inline]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of blocks.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.coords.len()
    }

    /// Block coordinates in Morton order.
    #[must_use]
    #[inline]
    pub fn coords(&self) -> &[BlockCoord] {
        &self.coords
    }

    /// All samples, block after block.
    #[must_use]
    pub fn samples(&self) -> &[i16] {
        &self.samples
    }

    /// All samples, for their memory to serve another volume.
    #[must_use]
    pub fn into_samples(self) -> Vec<i16> {
        self.samples
    }

    /// The `edge^3` samples of a block, x fastest, then y, then z.
    #[must_use]
    #[inline]
    pub fn block(&self, index: usize) -> &[i16] {
        let n = self.grid.edge.block_voxels();
        &self.samples[index * n..(index + 1) * n]
    }

    /// The unobserved voxels of a block, if it has any.
    #[must_use]
    pub fn unobserved(&self, index: usize) -> Option<&VoxelMask> {
        self.unobserved.get(&(index as u32))
    }

    /// All masks of unobserved voxels by block index; empty masks do not occur.
    #[must_use]
    pub fn unobserved_masks(&self) -> &BTreeMap<u32, VoxelMask> {
        &self.unobserved
    }

    /// The volume with further unobserved voxels, by block index.
    ///
    /// # Panics
    /// In debug builds, if a mask is empty or of no block.
    #[must_use]
    pub fn with_unobserved(mut self, masks: BTreeMap<u32, VoxelMask>) -> Self {
        debug_assert!(masks.iter().all(|(block, m)| (*block as usize) < self.coords.len() && !m.is_empty()));
        for (block, mask) in masks {
            match self.unobserved.entry(block) {
                Entry::Vacant(entry) => drop(entry.insert(mask)),
                Entry::Occupied(mut entry) => entry.get_mut().insert_all(&mask),
            }
        }
        self
    }

    /// The volume of those blocks, by index, that are wanted.
    #[must_use]
    pub fn select(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let mut part = Self::empty(self.grid);
        for block in (0..self.block_count()).filter(|block| wanted(*block)) {
            if let Some(mask) = self.unobserved(block) {
                part.unobserved.insert(part.coords.len() as u32, mask.clone());
            }
            part.coords.push(self.coords[block]);
            part.samples.extend_from_slice(self.block(block));
        }
        part
    }

    /// A look-up from coordinate to block index.
    #[must_use]
    pub fn index(&self) -> BlockIndex {
        BlockIndex::new(&self.coords)
    }
}

/// Collects blocks in any order and sorts them into a [`SparseVolume`].
#[derive(Debug)]
pub struct VolumeBuilder {
    grid: Grid,
    blocks: Vec<(BlockCoord, Vec<i16>, Option<VoxelMask>)>,
}

impl VolumeBuilder {
    /// An empty builder.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        Self { grid, blocks: Vec::new() }
    }

    /// Adds a block: its `edge^3` samples, x fastest, and the voxels of it that were not observed, if any.
    ///
    /// # Panics
    /// If the number of samples is not that of a block.
    pub fn push(&mut self, coord: BlockCoord, samples: Vec<i16>, unobserved: Option<VoxelMask>) {
        assert_eq!(samples.len(), self.grid.edge.block_voxels(), "one block of samples");
        self.blocks.push((coord, samples, unobserved));
    }

    /// The volume, in Morton order.
    ///
    /// # Panics
    /// If a coordinate was pushed twice (debug builds).
    #[must_use]
    pub fn finish(mut self) -> SparseVolume {
        self.blocks.sort_unstable_by_key(|(coord, ..)| coord.morton());
        let mut coords = Vec::with_capacity(self.blocks.len());
        let mut samples = Vec::with_capacity(self.blocks.len() * self.grid.edge.block_voxels());
        let mut masks = BTreeMap::new();
        for (index, (coord, block, mask)) in self.blocks.into_iter().enumerate() {
            coords.push(coord);
            samples.extend_from_slice(&block);
            if let Some(mask) = mask.filter(|m| !m.is_empty()) {
                masks.insert(index as u32, mask);
            }
        }
        SparseVolume::from_parts(self.grid, coords, samples, masks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BlockEdge, Truncation, VoxelSize};

    fn grid() -> Grid {
        Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E4,
            truncation: Truncation::from_voxels(8).unwrap(),
        }
    }

    #[test]
    fn builder_sorts_blocks_and_keeps_masks_with_them() {
        let mut builder = VolumeBuilder::new(grid());
        let mut mask = VoxelMask::empty(BlockEdge::E4);
        mask.insert(63);
        builder.push([3, 0, 0].into(), vec![3; 64], Some(mask.clone()));
        builder.push([-1, 0, 0].into(), vec![1; 64], Some(VoxelMask::empty(BlockEdge::E4)));
        builder.push([0, 0, 0].into(), vec![2; 64], None);
        let volume = builder.finish();
        assert_eq!(volume.coords(), [[-1, 0, 0], [0, 0, 0], [3, 0, 0]].map(BlockCoord::from));
        assert_eq!([0, 1, 2].map(|i| volume.block(i)[0]), [1, 2, 3]);
        assert_eq!(volume.unobserved(2), Some(&mask));
        assert_eq!(volume.unobserved_masks().len(), 1);
    }

    #[test]
    fn a_selection_keeps_masks_with_their_blocks() {
        let mut builder = VolumeBuilder::new(grid());
        let mut mask = VoxelMask::empty(BlockEdge::E4);
        mask.insert(5);
        for x in 0..4 {
            builder.push([x, 0, 0].into(), vec![x as i16; 64], (x >= 2).then(|| mask.clone()));
        }
        let part = builder.finish().select(|block| block % 2 == 1);
        assert_eq!(part.coords(), [[1, 0, 0], [3, 0, 0]].map(BlockCoord::from));
        assert_eq!([0, 1].map(|i| part.block(i)[63]), [1, 3]);
        assert_eq!([0, 1].map(|i| part.unobserved(i)), [None, Some(&mask)]);
    }
}
