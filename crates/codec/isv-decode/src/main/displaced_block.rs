//! A block of a frame's voxels that need not begin where one of its blocks does: how much of the surface is in it.
//!
//! Signs are bits, a word of 64 a layer, so that the displaced block's layers are put together by shifts.

use isv_kernels::block8::{Block, EDGE};
use isv_kernels::signs::inside;
use isv_kernels::simd::vectorized;
use std::borrow::Cow;

/// What is kept of a block's samples.
#[derive(Clone, Debug)]
pub(super) struct BlockSigns {
    /// Which voxels lie inside, a word a z.
    inside: [u64; EDGE],
    /// Whether any lies inside, and whether any lies outside.
    sides: [bool; 2],
    /// Smallest distance from the surface, in codes; 0 if the surface is in the block.
    nearest: u16,
}

impl BlockSigns {
    /// Signs of a block that was coded.
    pub(super) fn of_coded(samples: &Block) -> Self {
        let inside = inside(samples);
        let sides = [inside != [0; EDGE], inside != [!0; EDGE]];
        Self { inside, sides, nearest: if sides == [true; 2] { 0 } else { nearest(samples) } }
    }

    /// Signs of a block that was extrapolated: all of it has one sign.
    pub(super) fn of_extrapolated(samples: &Block) -> Self {
        let is_inside = samples[0] < 0;
        let inside = if is_inside { [!0; EDGE] } else { [0; EDGE] };
        Self { inside, sides: [is_inside, !is_inside], nearest: nearest(samples) }
    }
}

/// Smallest magnitude.
fn nearest(samples: &Block) -> u16 {
    vectorized(
        #[inline(always)]
        || {
            let mut nearest = [u16::MAX; 16];
            for samples in samples.as_chunks::<16>().0 {
                for lane in 0..16 {
                    nearest[lane] = nearest[lane].min(samples[lane].unsigned_abs());
                }
            }
            nearest.into_iter().fold(u16::MAX, u16::min)
        },
    )
}

/// A block of voxels that begins in the first of 2x2x2 blocks, x fastest, some of which may be missing.
#[derive(Clone, Debug)]
pub(super) struct DisplacedBlock<'a> {
    /// The blocks' samples and signs.
    pub(super) blocks: [Option<(&'a Block, Cow<'a, BlockSigns>)>; 8],
    /// The voxel where it begins, 0 to 7 along each axis.
    pub(super) within: [usize; 3],
}

impl DisplacedBlock<'_> {
    /// Edges between voxels of different sign: those that start in the block and end at a voxel that is there too.
    pub(super) fn crossings(&self) -> u32 {
        let (mut inside, mut outside) = (false, false);
        for (_, signs) in self.blocks.iter().flatten() {
            inside |= signs.sides[0];
            outside |= signs.sides[1];
        }
        if !(inside && outside) {
            return 0;
        }
        vectorized(
            #[inline(always)]
            || self.count_crossings(),
        )
    }

    #[inline(always)]
    fn count_crossings(&self) -> u32 {
        let (mut inside, mut known) = ([[0; 2 * EDGE]; 4], [[0; 2]; 4]);
        for (slot, block) in self.blocks.iter().enumerate() {
            if let Some((_, signs)) = block {
                inside[slot % 4][slot / 4 * EDGE..][..EDGE].copy_from_slice(&signs.inside);
                known[slot % 4][slot / 4] = !0;
            }
        }
        let [_, _, z] = self.within;
        let mut count = 0;
        let mut before = (0, 0);
        for layer in z..=z + EDGE {
            let signs = self.layer([inside[0][layer], inside[1][layer], inside[2][layer], inside[3][layer]]);
            let half = layer / EDGE;
            let known = self.layer([known[0][half], known[1][half], known[2][half], known[3][half]]);
            if layer > z {
                count += ((before.0 ^ signs.here) & before.1 & known.here).count_ones();
            }
            if layer < z + EDGE {
                count += ((signs.here ^ signs.after_x) & known.here & known.after_x).count_ones();
                count += ((signs.here ^ signs.after_y) & known.here & known.after_y).count_ones();
            }
            before = (signs.here, known.here);
        }
        count
    }

    /// A layer of the block and its shifts, from those of the four blocks it reaches into.
    #[inline(always)]
    fn layer(&self, [first, after_x, after_y, after_xy]: [u64; 4]) -> Layer {
        let [x, y, _] = self.within;
        let here = [join_along_x(first, after_x, x), join_along_x(after_y, after_xy, x)];
        let next = [join_along_x(first, after_x, x + 1), join_along_x(after_y, after_xy, x + 1)];
        Layer {
            here: join_along_y(here, y),
            after_x: join_along_y(next, y),
            after_y: join_along_y(here, y + 1),
        }
    }

    /// Smallest distance from the surface, in codes: exact if it is below `limit`, else that or more. The greatest number if no
    /// voxel is there. Nothing of use if edges cross the surface.
    pub(super) fn nearest(&self, limit: u16) -> u16 {
        if self.within == [0; 3] {
            return self.blocks[0].as_ref().map_or(u16::MAX, |(_, signs)| signs.nearest);
        }
        vectorized(
            #[inline(always)]
            || self.find_nearest(limit),
        )
    }

    #[inline(always)]
    fn find_nearest(&self, limit: u16) -> u16 {
        let mut least = u16::MAX;
        for (slot, block) in self.blocks.iter().enumerate() {
            let Some((samples, signs)) = block else { continue };
            if signs.nearest >= least.min(limit) {
                least = least.min(signs.nearest);
                continue;
            }
            // The part of the block that is looked at, along an axis.
            let part = |axis: usize| match slot >> axis & 1 {
                0 => (self.within[axis], EDGE),
                _ => (0, self.within[axis]),
            };
            let [(x, x_end), (y, y_end), (z, z_end)] = [part(0), part(1), part(2)];
            let (mut others, mut lanes) = ([u16::MAX; EDGE], [u16::MAX; EDGE]);
            others[x..x_end].fill(0);
            for rows in &samples.as_chunks::<{ EDGE * EDGE }>().0[z..z_end] {
                for row in &rows.as_chunks::<EDGE>().0[y..y_end] {
                    for lane in 0..EDGE {
                        lanes[lane] = lanes[lane].min(row[lane].unsigned_abs() | others[lane]);
                    }
                }
            }
            least = lanes.into_iter().fold(least, u16::min);
        }
        least
    }
}

/// A layer of a displaced block, and the same one voxel further along x and along y.
struct Layer {
    here: u64,
    after_x: u64,
    after_y: u64,
}

/// The layer that begins at a voxel along x, 0 to 8, of the first of two.
#[inline(always)]
fn join_along_x(first: u64, second: u64, x: usize) -> u64 {
    let of_first = (0xff >> x) * 0x0101_0101_0101_0101;
    first >> x & of_first | second << (EDGE - x) & !of_first
}

/// The layer that begins at a row, 0 to 8, of the first of two.
#[inline(always)]
fn join_along_y([first, second]: [u64; 2], y: usize) -> u64 {
    ((u128::from(second) << 64 | u128::from(first)) >> (EDGE * y)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of one sign, of the other, of both, and of one but for the first voxel.
    fn noise(kind: usize, seed: usize) -> Block {
        std::array::from_fn(|voxel| {
            let noise = ((seed * 512 + voxel) as u32).wrapping_mul(2_654_435_761) >> 21;
            let magnitude = 40 * (seed % 13) as i16 + (noise % 1500) as i16;
            let is_inside = [false, true, noise % 5 < 2, voxel == 0][kind];
            if is_inside { -1 - magnitude } else { magnitude }
        })
    }

    /// Blocks of noise, some of them missing: against a search of all voxels.
    #[test]
    fn crossings_and_distances_are_those_of_the_voxels() {
        let mut with_crossings = 0;
        for case in 0..512 {
            let within = [case % 8, case / 8 % 8, case / 64];
            let kind = |slot: usize| [0, 1, (case / 5 + slot) % 4, 3 * (slot % 2)][case % 4];
            let blocks: [Block; 8] = std::array::from_fn(|slot| noise(kind(slot), 8 * case + slot));
            let block = |slot: usize| (!(case * 5 + slot * 3).is_multiple_of(4)).then(|| &blocks[slot]);
            let displaced = DisplacedBlock {
                blocks: std::array::from_fn(|slot| {
                    block(slot).map(|samples| (samples, Cow::Owned(BlockSigns::of_coded(samples))))
                }),
                within,
            };
            let at = |voxel: [usize; 3]| {
                let [x, y, z] = std::array::from_fn(|axis| within[axis] + voxel[axis]);
                block(x / 8 + y / 8 * 2 + z / 8 * 4).map(|samples| samples[(z % 8 * 8 + y % 8) * 8 + x % 8])
            };
            let (mut crossings, mut nearest) = (0, u16::MAX);
            for [x, y, z] in (0..512).map(|v| [v % 8, v / 8 % 8, v / 64]) {
                let Some(sample) = at([x, y, z]) else { continue };
                nearest = nearest.min(sample.unsigned_abs());
                let after = [at([x + 1, y, z]), at([x, y + 1, z]), at([x, y, z + 1])];
                crossings += after.iter().flatten().filter(|next| (**next < 0) != (sample < 0)).count();
            }
            assert_eq!(displaced.crossings(), crossings as u32, "{within:?}");
            if crossings > 0 {
                with_crossings += 1;
                continue;
            }
            assert_eq!(displaced.nearest(u16::MAX), nearest, "{within:?}");
            assert!(displaced.nearest(100) == nearest || displaced.nearest(100).min(nearest) >= 100);
        }
        assert!((100..400).contains(&with_crossings), "{with_crossings}");
    }
}
