//! The blocks around a block that come before it in its slice.

use isv_volume::{BlockCoord, BlockIndex, Neighbourhood};
use rayon::prelude::*;
use std::ops::Range;

/// Slots of a [`Neighbourhood`] whose blocks are asked, in this order, for vectors to merge with and for contexts: the faces
/// that Morton order puts before a block, then the edges that it can put before.
pub const MERGE_NEIGHBOURS: [usize; 12] = [12, 10, 4, 9, 3, 1, 11, 15, 5, 21, 7, 19];

/// For each block of a frame, which of its neighbours precede it in its slice.
#[derive(Clone, Debug)]
pub struct CausalBlocks {
    around: Vec<Neighbourhood>,
}

impl CausalBlocks {
    /// Finds the neighbours of all blocks.
    #[must_use]
    pub fn new(coords: &[BlockCoord], slices: impl Iterator<Item = Range<usize>>) -> Self {
        let index = BlockIndex::new(coords);
        let mut around: Vec<Neighbourhood> = coords.par_iter().map(|c| index.neighbourhood(*c)).collect();
        for slice in slices {
            for block in slice.clone() {
                for neighbour in &mut around[block] {
                    *neighbour = neighbour.filter(|n| (slice.start..block).contains(&(*n as usize)));
                }
            }
        }
        Self { around }
    }

    /// All neighbours of a block that precede it, by slot.
    #[must_use]
    pub fn of(&self, block: usize) -> &Neighbourhood {
        &self.around[block]
    }

    /// Those of [`MERGE_NEIGHBOURS`] that are there, in order.
    pub fn merge_neighbours(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        MERGE_NEIGHBOURS.iter().filter_map(move |slot| self.around[block][*slot].map(|n| n as usize))
    }
}

/// A slice's blocks, seen by its syntax.
#[derive(Clone, Debug)]
pub struct SliceBlocks<'a> {
    /// All blocks of the frame.
    pub coords: &'a [BlockCoord],
    /// Those of the slice.
    pub range: Range<usize>,
    /// Which neighbours precede a block.
    pub causal: &'a CausalBlocks,
}
