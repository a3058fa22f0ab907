//! The colour samples of a frame.

use super::cells::ColourCells;
use super::tree::{BlockTree, MAX_LEVELS};
use isv_volume::SparseVolume;
use rayon::prelude::*;
use std::ops::Range;

/// Fractional bits of a sample.
pub const SAMPLE_BITS: u32 = 6;
/// Deepest layer of samples: 0 has one in a voxel's cell, 1 one in a half cell, 2 one in a quarter cell.
pub const MAX_DEPTH: u8 = 2;
/// Blocks whose samples a thread collects for the hash at a time.
const HASH_CHUNK: usize = 128;

/// A colour sample: luma `0 ..= 255`, blue and red difference `-128 ..= 128`, in 1/64; BT.709, full range. The last value is 1
/// where there is a sample and 0 where there is none.
pub type Sample = [i16; 4];

/// Lowest and highest value of each channel.
pub const SAMPLE_RANGE: [(i32, i32); 3] = [
    (0, 255 << SAMPLE_BITS),
    (-(128 << SAMPLE_BITS), 128 << SAMPLE_BITS),
    (-(128 << SAMPLE_BITS), 128 << SAMPLE_BITS),
];

/// Grey, where nothing is known.
pub const GREY: Sample = [128 << SAMPLE_BITS, 0, 0, 1];

/// Clamps values to the range of samples.
#[must_use]
#[inline(always)]
pub fn clamped(values: [i32; 3]) -> Sample {
    let mut sample = [0, 0, 0, 1];
    for channel in 0..3 {
        let (low, high) = SAMPLE_RANGE[channel];
        sample[channel] = values[channel].clamp(low, high) as i16;
    }
    sample
}

/// A sum divided by its weight, rounded to the nearest, halves up.
#[inline(always)]
pub(crate) fn rounded(sum: i32, weight: i32) -> i32 {
    (sum + weight / 2).div_euclid(weight)
}

/// Sums divided by their weight, rounded to the nearest, halves up; sums of 0 without any.
///
/// Sums are below 2^31, weights below 2^16 and quotients below 2^21. Halves are made to lie above the middle between two
/// integers, so that no quotient lies in it. All quotients are farther from it than `f64` rounds.
#[inline(always)]
pub(crate) fn divided<const N: usize>(sums: [i32; N], weight: i32) -> [i32; N] {
    // Added to a number below 2^31 it leaves the nearest integer in the lowest bits.
    const TO_INTEGER: f64 = 6_755_399_441_055_744.0;
    let weight = weight.max(1);
    let above = 0.5 * f64::from(1 - (weight & 1));
    let share = 1.0 / f64::from(weight);
    let mut quotients = [0; N];
    for lane in 0..N {
        quotients[lane] = ((f64::from(sums[lane]) + above) * share + TO_INTEGER).to_bits() as i32;
    }
    quotients
}

/// The mean of samples from their weighted sums, of which the last is that of the weights; none if this is 0. Rounded as
/// [`divided`] does.
#[inline(always)]
pub(crate) fn mean(sums: [i32; 4]) -> Sample {
    // The last of the quotients is 1, or 0.
    divided(sums, sums[3]).map(|value| value as i16)
}

/// Which samples a frame has, and where they are.
#[derive(Clone, Debug, Default)]
pub struct ColourShape {
    cells: ColourCells,
    depths: Vec<u8>,
    /// Start of each block's samples in each layer.
    starts: Vec<[u32; 3]>,
    /// Samples of each layer.
    counts: [usize; 3],
    /// Crossed quarter cells of each cell of the blocks that are two deep: one word to 64 samples of layer 2.
    quarters: Vec<u64>,
}

impl ColourShape {
    /// Lays out the samples of blocks of these depths. `volume`: the one that the cells are of.
    #[must_use]
    pub fn new(cells: ColourCells, depths: Vec<u8>, volume: &SparseVolume) -> Self {
        let mut counts = [0; 3];
        let mut starts = Vec::with_capacity(depths.len());
        for (cells, depth) in cells.blocks().iter().zip(&depths) {
            starts.push(counts.map(|count| count as u32));
            for layer in 0..=*depth {
                counts[usize::from(layer)] += cells.count() << (3 * layer);
            }
        }
        let quarters = cells.crossed_quarters(volume, |block| depths[block] > 1);
        Self { cells, depths, starts, counts, quarters }
    }

    /// The cells that have samples.
    #[must_use]
    pub fn cells(&self) -> &ColourCells {
        &self.cells
    }

    /// The cells alone.
    #[must_use]
    pub fn into_cells(self) -> ColourCells {
        self.cells
    }

    /// Depth of each block.
    #[must_use]
    pub fn depths(&self) -> &[u8] {
        &self.depths
    }

    /// Depth of the deepest block.
    #[must_use]
    pub fn max_depth(&self) -> u8 {
        self.depths.iter().max().copied().unwrap_or(0)
    }

    /// Start of each block's samples in each layer.
    #[must_use]
    pub fn starts(&self) -> &[[u32; 3]] {
        &self.starts
    }

    /// Samples of a block in a layer.
    #[must_use]
    pub fn block_samples(&self, block: usize, layer: u8) -> Range<usize> {
        let start = self.starts[block][usize::from(layer)] as usize;
        let count =
            if layer > self.depths[block] { 0 } else { self.cells.blocks()[block].count() << (3 * layer) };
        start..start + count
    }

    /// Crossed quarter cells of each cell of a block, if it is two deep.
    #[must_use]
    pub fn block_quarters(&self, block: usize) -> &[u64] {
        let samples = self.block_samples(block, 2);
        &self.quarters[samples.start / 64..samples.end / 64]
    }

    /// Builds the tree of a block.
    pub fn build_tree(&self, block: usize, tree: &mut BlockTree) {
        self.build_tree_to(block, MAX_LEVELS, tree);
    }

    /// Builds the tree of a block as far as a level, at least that of the voxels' cells; what is below is left out.
    pub fn build_tree_to(&self, block: usize, level: usize, tree: &mut BlockTree) {
        let (cells, surfels) = (&self.cells.blocks()[block], self.cells.block_surfels(block));
        tree.build(cells, surfels, self.block_quarters(block), self.depths[block], level);
    }

    /// Samples of a layer.
    #[must_use]
    pub fn layer_len(&self, layer: usize) -> usize {
        self.counts[layer]
    }

    /// The parts of a cell that the surface crosses at its block's depth. See [`Self::parts`].
    #[must_use]
    #[inline(always)]
    pub fn leaves(&self, block: usize, number: usize) -> u64 {
        self.parts(block, number, self.depths[block])
    }

    /// The parts of a cell that the surface crosses at a depth that its block has, a bit each. Parts are the cell, its halves or
    /// its quarters, in Morton order. `number`: of the cell in its block.
    #[must_use]
    #[inline(always)]
    pub fn parts(&self, block: usize, number: usize, depth: u8) -> u64 {
        match depth {
            0 => 1,
            1 => u64::from(self.cells.surfels()[self.cells.blocks()[block].first() + number].halves),
            _ => self.quarters[self.starts[block][2] as usize / 64 + number],
        }
    }

    /// Slots of a block's leaves in its deepest layer, in the order of its tree, counted from the block's first.
    pub fn leaf_slots(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        let shift = 3 * self.depths[block];
        (0..self.cells.blocks()[block].count()).flat_map(move |number| {
            let mut rest = self.leaves(block, number);
            std::iter::from_fn(move || {
                let part = rest.checked_ilog2().map(|_| rest.trailing_zeros() as usize)?;
                rest &= rest - 1;
                Some(number << shift | part)
            })
        })
    }

    /// Layers of this shape, without samples yet.
    #[must_use]
    pub fn layers(&self) -> [Vec<Sample>; 3] {
        self.counts.map(|count| vec![[0; 4]; count])
    }
}

/// The layers of samples of a frame.
///
/// Layer 0 has 1 sample a cell. Layer 1 has 8 a cell, in blocks of depth 1 or 2. Layer 2 has 64 a cell, in blocks of depth 2. Samples
/// of a cell are in Morton order; the surface does not cross all half and quarter cells, and the others have none. Each
/// sample is the weighted mean of those below it.
#[derive(Clone, Debug, Default)]
pub struct ColourFrame {
    /// Which samples there are.
    pub shape: ColourShape,
    /// Samples of each layer.
    pub layers: [Vec<Sample>; 3],
}

impl ColourFrame {
    /// XXH64 of all samples that lie on the surface: those of the blocks' deepest layers, in order, each channel as two bytes.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let blocks = 0..self.shape.depths.len();
        let of_chunk = |chunk: usize| {
            let blocks = chunk * HASH_CHUNK..blocks.end.min((chunk + 1) * HASH_CHUNK);
            self.surface_bytes(blocks)
        };
        let chunks: Vec<Vec<u8>> =
            (0..blocks.end.div_ceil(HASH_CHUNK)).into_par_iter().map(of_chunk).collect();
        let mut hash = xxhash_rust::xxh64::Xxh64::new(0);
        chunks.iter().for_each(|bytes| hash.update(bytes));
        hash.digest()
    }

    /// The samples of blocks that lie on the surface, six bytes each.
    fn surface_bytes(&self, blocks: Range<usize>) -> Vec<u8> {
        const BYTES: usize = 6;
        let of_block = |block| {
            let depth = self.shape.depths[block];
            &self.layers[usize::from(depth)][self.shape.block_samples(block, depth)]
        };
        let places: usize = blocks.clone().map(|block| of_block(block).len()).sum();
        let mut bytes = vec![0; BYTES * places + 2];
        let mut end = 0;
        for sample in blocks.flat_map(of_block) {
            // Eight bytes are written, of which the next sample overwrites the last two, or all.
            let word = sample.iter().rev().fold(0, |word, value| word << 16 | u64::from(*value as u16));
            bytes[end..end + 8].copy_from_slice(&word.to_le_bytes());
            end += if sample[3] != 0 { BYTES } else { 0 };
        }
        bytes.truncate(end);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_integers() {
        let mut random = isv_testkit::Random::new(7);
        for round in 0..200_000 {
            let weight = match round % 3 {
                0 => 1 << 15,
                1 => 1 + round % 8,
                _ => 1 + (random.signed().abs() * 32767.0) as i32,
            };
            let mut sums = [0, 0, 0, weight];
            for channel in 0..3 {
                let (low, high) = SAMPLE_RANGE[channel];
                let share = (random.signed() + 1.0) / 2.0;
                let sum = f64::from(low) + share * f64::from(high - low);
                // Near a border between two results, often.
                sums[channel] =
                    (sum * f64::from(weight)) as i32 / weight * weight - weight / 2 + round % 3 - 1;
                sums[channel] = sums[channel].clamp(low * weight, high * weight);
            }
            let found = mean(sums);
            assert_eq!(found[3], 1);
            let wide = sums.map(|sum| sum.clamp(-(1 << 20), 1 << 20) * 63);
            assert_eq!(divided(wide, weight), wide.map(|sum| rounded(sum, weight)), "{wide:?}");
            for channel in 0..3 {
                assert_eq!(i32::from(found[channel]), rounded(sums[channel], weight), "{sums:?}");
            }
        }
        assert_eq!(mean([0; 4]), [0; 4]);
    }
}
