//! The sparse TSDF volume of one frame.

use crate::{BlockCoord, BlockIndex, Grid, VoxelMask};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

/// A frame: blocks in Morton order, each voxel a signed-distance code in `-truncation..=truncation`.
///
/// Voxels are observed (W = 1 in Eq. 2) unless their block's mask says otherwise; blocks that are not there hold
/// nothing within the truncation band.
///
/// Samples are in chunks that volumes share. A copy of a volume, or one that differs from it in some blocks
/// ([`Self::succeed`]), takes memory and time for what is its own.
#[derive(Clone, Debug)]
pub struct SparseVolume {
    grid: Grid,
    coords: Arc<Vec<BlockCoord>>,
    /// Places of the samples of each block.
    places: Arc<Vec<Place>>,
    chunks: Vec<Arc<Vec<i16>>>,
    unobserved: Arc<BTreeMap<u32, VoxelMask>>,
}

/// Place of a block's samples.
#[derive(Clone, Copy, Debug)]
struct Place {
    chunk: u32,
    /// Which of the chunk's blocks.
    block: u32,
}

/// Source of the samples of a block when a volume succeeds another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockOrigin {
    /// They are those of this block of the volume before, and are shared with it.
    Kept(u32),
    /// They are this block of the new samples.
    Fresh(u32),
}

impl SparseVolume {
    /// A volume without blocks.
    #[must_use]
    pub fn empty(grid: Grid) -> Self {
        let (coords, places, unobserved) = (Arc::default(), Arc::default(), Arc::default());
        Self { grid, coords, places, chunks: Vec::new(), unobserved }
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
        let origins: Vec<_> = (0..coords.len() as u32).map(BlockOrigin::Fresh).collect();
        Self::empty(grid).succeed(coords, &origins, samples, unobserved)
    }

    /// Assembles a volume of which some blocks are those of this one.
    ///
    /// - `coords`, `unobserved`: of all blocks, as for [`Self::from_parts`].
    /// - `origins`: where the samples of each block are now.
    /// - `fresh`: the new samples, one block after the other.
    ///
    /// # Panics
    /// If a block's samples are nowhere or (debug builds) the order or the range of samples is wrong.
    #[must_use]
    pub fn succeed(
        &self,
        coords: Vec<BlockCoord>,
        origins: &[BlockOrigin],
        mut fresh: Vec<i16>,
        unobserved: BTreeMap<u32, VoxelMask>,
    ) -> Self {
        assert_eq!(origins.len(), coords.len(), "samples for each coordinate");
        debug_assert!(coords.windows(2).all(|w| w[0].morton() < w[1].morton()), "blocks in Morton order");
        debug_assert!(
            fresh.iter().all(|s| s.abs() <= self.grid.truncation.codes()),
            "samples within truncation"
        );
        debug_assert!(unobserved.values().all(|m| !m.is_empty()));
        let (chunk_numbers, mut chunks) = self.chunks_worth_keeping(origins);
        let own = chunks.len() as u32;
        let mut places = Vec::with_capacity(origins.len());
        for origin in origins {
            places.push(match *origin {
                BlockOrigin::Fresh(block) => Place { chunk: own, block },
                BlockOrigin::Kept(block) => {
                    let place = self.places[block as usize];
                    match chunk_numbers[place.chunk as usize] {
                        Some(chunk) => Place { chunk, ..place },
                        None => {
                            fresh.extend_from_slice(self.block(block as usize));
                            let blocks = fresh.len() / self.grid.edge.block_voxels();
                            Place { chunk: own, block: blocks as u32 - 1 }
                        }
                    }
                }
            });
        }
        chunks.push(Arc::new(fresh));
        let (coords, places, unobserved) = (Arc::new(coords), Arc::new(places), Arc::new(unobserved));
        Self { grid: self.grid, coords, places, chunks, unobserved }
    }

    /// Chunks of which a successor uses more than half, and their new numbers. So it takes no more than twice
    /// the memory that it needs, and copies a block at most once for each that it drops.
    fn chunks_worth_keeping(&self, origins: &[BlockOrigin]) -> (Vec<Option<u32>>, Vec<Arc<Vec<i16>>>) {
        let mut used = vec![0; self.chunks.len()];
        for origin in origins {
            if let BlockOrigin::Kept(block) = origin {
                used[self.places[*block as usize].chunk as usize] += self.grid.edge.block_voxels();
            }
        }
        let mut kept = Vec::new();
        let numbers = self.chunks.iter().zip(used).map(|(chunk, used)| {
            (2 * used > chunk.len()).then(|| {
                kept.push(Arc::clone(chunk));
                kept.len() as u32 - 1
            })
        });
        (numbers.collect(), kept)
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
    pub fn samples(&self) -> impl Iterator<Item = i16> + '_ {
        (0..self.block_count()).flat_map(|block| self.block(block).iter().copied())
    }

    /// How many samples there are.
    #[must_use]
    pub fn sample_count(&self) -> usize {
        self.block_count() * self.grid.edge.block_voxels()
    }

    /// The largest buffer of samples that no other volume shares, for another volume to be built in; what is in it means nothing.
    #[must_use]
    pub fn into_spare_buffer(self) -> Vec<i16> {
        let own = self.chunks.into_iter().filter_map(Arc::into_inner);
        own.max_by_key(Vec::capacity).unwrap_or_default()
    }

    /// The `edge^3` samples of a block, x fastest, then y, then z.
    #[must_use]
    #[inline]
    pub fn block(&self, index: usize) -> &[i16] {
        let (n, place) = (self.grid.edge.block_voxels(), self.places[index]);
        &self.chunks[place.chunk as usize][place.block as usize * n..][..n]
    }

    /// Whether a block and another volume's are the same memory.
    #[must_use]
    pub fn shares_block(&self, index: usize, other: &Self, other_index: usize) -> bool {
        std::ptr::eq(self.block(index), other.block(other_index))
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

    /// Adds unobserved voxels, by block index.
    ///
    /// # Panics
    /// In debug builds, if a mask is empty or of no block.
    pub fn add_unobserved(&mut self, masks: BTreeMap<u32, VoxelMask>) {
        debug_assert!(masks.iter().all(|(block, m)| (*block as usize) < self.coords.len() && !m.is_empty()));
        let unobserved = Arc::make_mut(&mut self.unobserved);
        for (block, mask) in masks {
            match unobserved.entry(block) {
                Entry::Vacant(entry) => drop(entry.insert(mask)),
                Entry::Occupied(mut entry) => entry.get_mut().insert_all(&mask),
            }
        }
    }

    /// The volume of those blocks, by index, that are wanted.
    #[must_use]
    pub fn select(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let blocks: Vec<usize> = (0..self.block_count()).filter(|block| wanted(*block)).collect();
        let masks = (0..).zip(&blocks).filter_map(|(at, block)| Some((at, self.unobserved(*block)?.clone())));
        let coords = blocks.iter().map(|block| self.coords[*block]).collect();
        let origins: Vec<_> = blocks.iter().map(|block| BlockOrigin::Kept(*block as u32)).collect();
        self.succeed(coords, &origins, Vec::new(), masks.collect())
    }

    /// A look-up from coordinate to block index.
    #[must_use]
    pub fn index(&self) -> BlockIndex {
        BlockIndex::new(&self.coords)
    }
}

impl PartialEq for SparseVolume {
    /// Whether all blocks are equal, wherever their samples are.
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid
            && self.coords == other.coords
            && self.unobserved == other.unobserved
            && (0..self.block_count()).all(|block| self.block(block) == other.block(block))
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
            truncation: Truncation::DEFAULT,
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

    /// Blocks along x whose samples are all their number.
    fn row(numbers: &[i16]) -> SparseVolume {
        let mut builder = VolumeBuilder::new(grid());
        numbers.iter().for_each(|n| builder.push([i32::from(*n), 0, 0].into(), vec![*n; 64], None));
        builder.finish()
    }

    #[test]
    fn a_successor_shares_what_it_keeps() {
        use BlockOrigin::{Fresh, Kept};
        let before = row(&[0, 1, 2, 3, 4]);
        let after = before.succeed(
            row(&[0, 1, 3, 4]).coords.to_vec(),
            &[Kept(0), Kept(1), Fresh(0), Kept(4)],
            vec![3; 64],
            BTreeMap::new(),
        );
        assert!(after == row(&[0, 1, 3, 4]));
        assert!(after.shares_block(1, &before, 1) && after.shares_block(3, &before, 4));
        assert!(!after.shares_block(2, &before, 3), "equal is not the same");
        // The fourth block alone of the old chunk: not worth its memory.
        let last =
            after.succeed(row(&[3, 4]).coords.to_vec(), &[Kept(2), Kept(3)], Vec::new(), BTreeMap::new());
        assert!(last == row(&[3, 4]) && last.shares_block(0, &after, 2) && !last.shares_block(1, &after, 3));
        drop(after);
        assert_eq!(before.clone().into_spare_buffer(), Vec::<i16>::new(), "shared with the copy's origin");
        assert_eq!(before.into_spare_buffer().len(), 5 * 64);
    }
}
