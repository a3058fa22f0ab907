//! The blocks around a block that come before it in its slice.

use isv_volume::{BlockCoord, BlockIndex, NeighbourFinder, Neighbourhood};
use rayon::prelude::*;
use std::ops::Range;

/// Slots of a [`Neighbourhood`] whose blocks are asked, in this order, for vectors to merge with and for contexts. First come the
/// faces that Morton order puts before a block, then the edges that it can put before.
pub const MERGE_NEIGHBOURS: [usize; 12] = [12, 10, 4, 9, 3, 1, 11, 15, 5, 21, 7, 19];

/// Stands for a block that is not there.
const NONE: u32 = u32::MAX;

/// For each block of a frame, which of its neighbours precede it in its slice.
#[derive(Clone, Debug)]
pub struct CausalBlocks {
    index: BlockIndex,
    /// First block of each slice.
    starts: Vec<u32>,
    /// The [`MERGE_NEIGHBOURS`] of each block, or [`NONE`].
    merge: Vec<[u32; MERGE_NEIGHBOURS.len()]>,
}

impl CausalBlocks {
    /// Finds the neighbours of all blocks.
    #[must_use]
    pub fn new(coords: &[BlockCoord], slices: impl Iterator<Item = Range<usize>>) -> Self {
        let index = BlockIndex::new(coords);
        let (mut starts, mut merge) = (Vec::new(), Vec::with_capacity(coords.len()));
        for slice in slices {
            let start = slice.start as u32;
            let find = |finder: &mut NeighbourFinder, block: usize| {
                finder.turn_to(coords[block]);
                MERGE_NEIGHBOURS.map(|slot| {
                    finder.get(slot).filter(|n| (start..block as u32).contains(n)).unwrap_or(NONE)
                })
            };
            merge.par_extend(slice.into_par_iter().map_init(|| NeighbourFinder::new(&index), find));
            starts.push(start);
        }
        Self { index, starts, merge }
    }

    /// The first block of a block's slice.
    #[must_use]
    pub fn slice_start(&self, block: usize) -> u32 {
        let slice = self.starts.partition_point(|start| *start <= block as u32);
        self.starts[slice - 1]
    }

    /// All neighbours of the block at a coordinate that precede it, by slot.
    #[must_use]
    pub fn of(&self, coord: BlockCoord, block: usize) -> Neighbourhood {
        let (start, block) = (self.slice_start(block), block as u32);
        self.index.neighbourhood(coord).map(|n| n.filter(|n| (start..block).contains(n)))
    }

    /// A block's [`MERGE_NEIGHBOURS`] that are there, in order.
    pub fn merge_neighbours(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        self.merge[block].iter().filter(|n| **n != NONE).map(|n| *n as usize)
    }
}

/// A slice's blocks, seen by its syntax.
#[derive(Clone, Debug)]
pub struct SliceBlocks<'a> {
    /// All blocks of the frame.
    pub coords: &'a [BlockCoord],
    /// Indices of the slice's blocks in `coords`.
    pub range: Range<usize>,
    /// Which neighbours precede a block.
    pub causal: &'a CausalBlocks,
}
