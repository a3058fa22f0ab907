//! Which voxels lie inside and which were observed, as bits, and which blocks the surface can cross.

use isv_kernels::signs::inside_row;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockIndex, NeighbourFinder, SparseVolume, VoxelMask};
use rayon::prelude::*;

/// A bit a voxel of a block: bit x of row `[z][y]`.
pub(crate) type Rows<const SIDE: usize> = [[u16; SIDE]; SIDE];

/// Fewest blocks that a thread takes at a time.
pub(crate) const MIN_BLOCKS: usize = 32;

/// The signs of all blocks, of `SIDE` voxels along an edge.
pub(crate) struct Signs<const SIDE: usize> {
    inside: Vec<Rows<SIDE>>,
    parts: Vec<Parts>,
    /// Index of each block's rows among the `observed` ones.
    pattern: Vec<u32>,
    /// The rows of a block that was observed in full, then those of each block that was not.
    observed: Vec<Rows<SIDE>>,
}

/// Parts of a block that have voxels inside, and those that have some outside. Bit `p` is for the voxels
/// whose coordinate is 0 along every axis of `p`, with x in bit 0. It is what cells reach that start in the
/// block at `-x` where `p` has x, and so on.
#[derive(Clone, Copy, Debug, Default)]
struct Parts {
    inside: u8,
    outside: u8,
}

impl<const SIDE: usize> Signs<SIDE> {
    pub(crate) fn new(volume: &SparseVolume) -> Self {
        let (inside, parts) = (0..volume.block_count())
            .into_par_iter()
            .with_min_len(MIN_BLOCKS)
            .map(|block| {
                let samples = volume.block(block);
                vectorized(
                    #[inline(always)]
                    || {
                        let rows = inside_rows(samples);
                        (rows, Parts::of(&rows))
                    },
                )
            })
            .unzip();
        let mut pattern = vec![0; volume.block_count()];
        let mut observed = vec![[[full_row(SIDE); SIDE]; SIDE]];
        for (block, mask) in volume.unobserved_masks() {
            pattern[*block as usize] = observed.len() as u32;
            observed.push(observed_rows(mask));
        }
        Self { inside, parts, pattern, observed }
    }

    /// The voxels inside, of a block that may be missing.
    #[inline(always)]
    pub(crate) fn inside(&self, block: Option<u32>) -> &Rows<SIDE> {
        block.map_or(&[[0; SIDE]; SIDE], |block| &self.inside[block as usize])
    }

    /// The voxels that were observed, of a block that may be missing.
    #[inline(always)]
    pub(crate) fn observed(&self, block: Option<u32>) -> &Rows<SIDE> {
        block.map_or(&[[0; SIDE]; SIDE], |block| &self.observed[self.pattern[block as usize] as usize])
    }

    /// Whether a block has unobserved voxels.
    #[inline(always)]
    pub(crate) fn has_unobserved(&self, block: u32) -> bool {
        self.pattern[block as usize] != 0
    }

    /// The blocks where cells start whose corners have both signs, in order: in no other does the surface cross a cell or an
    /// edge. In these it does, unless a corner was not observed.
    pub(crate) fn crossed_blocks(&self, volume: &SparseVolume, index: &BlockIndex) -> Vec<u32> {
        let blocks = (0..volume.block_count() as u32).into_par_iter().with_min_len(MIN_BLOCKS);
        let found = blocks.map_init(
            || NeighbourFinder::new(index),
            |finder, block| {
                let around = vectorized(
                    #[inline(always)]
                    || {
                        finder.turn_to(volume.coords()[block as usize]);
                        finder.octet()
                    },
                );
                let (mut inside, mut outside) = (0, 0);
                for (part, block) in around.into_iter().enumerate() {
                    if let Some(block) = block {
                        let parts = self.parts[block as usize];
                        inside |= parts.inside >> part & 1;
                        outside |= parts.outside >> part & 1;
                    }
                }
                (inside & outside != 0).then_some(block)
            },
        );
        found.flatten_iter().collect()
    }
}

impl Parts {
    #[inline(always)]
    fn of<const SIDE: usize>(rows: &Rows<SIDE>) -> Self {
        // By the axes y and z of the part: some voxel inside, and every.
        let (mut some, mut every) = ([0; 4], [full_row(SIDE); 4]);
        for (z, layer) in rows.iter().enumerate() {
            for (y, row) in layer.iter().enumerate() {
                for part in 0..4 {
                    if (part & 1 == 0 || y == 0) && (part & 2 == 0 || z == 0) {
                        some[part] |= row;
                        every[part] &= row;
                    }
                }
            }
        }
        let mut parts = Self::default();
        for part in 0..8 {
            let row = if part & 1 == 0 { full_row(SIDE) } else { 1 };
            parts.inside |= u8::from(some[part / 2] & row != 0) << part;
            parts.outside |= u8::from(!every[part / 2] & row != 0) << part;
        }
        parts
    }
}

/// The row with all bits set.
#[inline(always)]
const fn full_row(side: usize) -> u16 {
    u16::MAX >> (16 - side)
}

#[inline(always)]
fn inside_rows<const SIDE: usize>(samples: &[i16]) -> Rows<SIDE> {
    let mut rows = [[0; SIDE]; SIDE];
    for (row, samples) in rows.as_flattened_mut().iter_mut().zip(samples.as_chunks::<SIDE>().0) {
        *row = inside_row(samples);
    }
    rows
}

fn observed_rows<const SIDE: usize>(unobserved: &VoxelMask) -> Rows<SIDE> {
    let mut rows = [[0; SIDE]; SIDE];
    for (row, bits) in rows.as_flattened_mut().iter_mut().enumerate() {
        let voxel = row * SIDE;
        *bits = !(unobserved.words()[voxel / 64] >> (voxel % 64)) as u16 & full_row(SIDE);
    }
    rows
}
