//! How the blocks of a frame are coded, for pictures of it.

use isv_entropy::RangeDecoder;
use isv_volume::{BlockCoord, BlockSet};
use std::ops::Range;

/// How a block of a frame is coded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockDetail {
    /// Coordinate of the block on the block grid.
    pub coord: BlockCoord,
    /// What it is predicted from.
    pub coding: BlockCoding,
    /// Bits of its mode, its motion vector and its levels. Those of the block set and of masks belong to no block.
    pub bits: f32,
}

/// What a block is predicted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockCoding {
    /// It stays as it is in the frame before and takes no bits of its own.
    Still,
    /// Not from the frame before: in profile `paper` from nothing, in `main` from its neighbours.
    Alone,
    /// From the frame before.
    Predicted {
        /// Place that the block's samples come from, counted from the block, in quarter voxels: the vector's translation. What is
        /// there has moved the other way.
        from: [i16; 3],
    },
}

/// Bits that each block of a slice takes, if anyone wants to know.
#[derive(Clone, Debug, Default)]
pub struct BitTally {
    /// By block of the slice; empty if nobody wants to know.
    bits: Vec<f32>,
    /// [`RangeDecoder::bits`] where the last charge ended.
    charged: f64,
}

impl BitTally {
    /// A tally of so many blocks.
    #[must_use]
    pub fn new(blocks: usize) -> Self {
        Self { bits: vec![0.0; blocks], charged: 0.0 }
    }

    /// Turns to a segment that nothing was read of yet.
    pub(crate) fn begin(&mut self, decoder: &RangeDecoder) {
        self.charged = decoder.bits();
    }

    /// Charges what was read since the last charge to a block of the slice.
    #[inline]
    pub(crate) fn charge(&mut self, block: usize, decoder: &RangeDecoder) {
        if let Some(bits) = self.bits.get_mut(block) {
            let now = decoder.bits();
            *bits += (now - self.charged) as f32;
            self.charged = now;
        }
    }
}

/// The details of a frame, if they are wanted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Details {
    wanted: bool,
    /// In Morton order.
    blocks: Vec<BlockDetail>,
}

impl Details {
    /// Whether to keep them from now on.
    pub(crate) fn keep(&mut self, wanted: bool) {
        self.wanted = wanted;
    }

    /// Details of the last frame's blocks, in Morton order.
    pub(crate) fn blocks(&self) -> &[BlockDetail] {
        &self.blocks
    }

    /// Forgets them.
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
    }

    /// A tally for each slice.
    pub(crate) fn tallies(&self, slices: impl Iterator<Item = Range<usize>>) -> Vec<BitTally> {
        slices
            .map(|blocks| if self.wanted { BitTally::new(blocks.len()) } else { BitTally::default() })
            .collect()
    }

    /// Becomes the details of a frame's coded blocks. `tallies`: of its slices, in order. `coding`: of each block.
    pub(crate) fn set(
        &mut self,
        coords: &[BlockCoord],
        tallies: Vec<BitTally>,
        coding: impl Fn(usize) -> BlockCoding,
    ) {
        let bits = tallies.into_iter().flat_map(|tally| tally.bits);
        let blocks = coords.iter().zip(bits).enumerate();
        self.blocks.clear();
        self.blocks.extend(blocks.map(|(n, (coord, bits))| BlockDetail {
            coord: *coord,
            coding: coding(n),
            bits,
        }));
    }

    /// Adds the blocks that stay as they are, none of which is coded.
    pub(crate) fn add_skipped(&mut self, skipped: &BlockSet) {
        if !self.wanted || skipped.is_empty() {
            return;
        }
        let detail = |coord| BlockDetail { coord, coding: BlockCoding::Still, bits: 0.0 };
        self.blocks.extend(skipped.coords().into_iter().map(detail));
        self.blocks.sort_unstable_by_key(|block| block.coord.morton());
    }
}
