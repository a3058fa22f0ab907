//! Translation by quarter voxels, from just the samples that it reads: those of [`crate::warp`], bit for bit.
//!
//! All voxels of a block have the same fractions, so interpolation goes along x, then y, then z, in quarters. It is exact up to
//! the one rounding at the end. Blocks of 8 voxels a side only.

use crate::block8::Block;
use crate::simd;
use crate::warp::STEPS_PER_VOXEL;
use fearless_simd::{Simd, dispatch, i16x8, i32x8, prelude::*};

/// Voxels of a window along each axis: a block's and the layer after it.
pub const SIDE: usize = 9;
/// Rows of a window.
pub const ROWS: usize = SIDE * SIDE;
/// Samples of a row: two blocks'.
pub const ROW: usize = 16;

/// The samples of a window, each row with those of both blocks that it touches.
#[derive(Clone, Debug)]
pub struct WindowRows {
    /// `[9 z + y][x]`.
    pub samples: [[i16; ROW]; ROWS],
    /// First sample of the window in its row: 0 to 7.
    pub first: usize,
}

impl Default for WindowRows {
    fn default() -> Self {
        Self { samples: [[0; ROW]; ROWS], first: 0 }
    }
}

impl WindowRows {
    /// The window that begins at voxel `within` `[x, y, z]` of the first of 2x2x2 blocks, x fastest.
    ///
    /// # Panics
    /// If `within` is not a voxel of a block.
    pub fn load(&mut self, blocks: &[&Block; 8], within: [usize; 3]) {
        assert!(within.iter().all(|c| *c < 8), "{within:?} is not in the first block");
        self.first = within[0];
        // Rows from a voxel on that lie in the first of two blocks along an axis, and in the second.
        let halves = |axis: usize| [(0..8 - within[axis], within[axis]), (8 - within[axis]..SIDE, 0)];
        for (along_z, (zs, z_within)) in halves(2).into_iter().enumerate() {
            for (z, layer) in zs.zip(z_within..) {
                for (along_y, (ys, y_within)) in halves(1).into_iter().enumerate() {
                    let pair = 4 * along_z + 2 * along_y;
                    let rows = &mut self.samples[z * SIDE + ys.start..z * SIDE + ys.end];
                    let start = (8 * layer + y_within) * 8;
                    let [near, far] =
                        [pair, pair + 1].map(|slot| &blocks[slot][start..start + 8 * rows.len()]);
                    for (row, (near, far)) in
                        rows.iter_mut().zip(near.as_chunks::<8>().0.iter().zip(far.as_chunks::<8>().0))
                    {
                        row[..8].copy_from_slice(near);
                        row[8..].copy_from_slice(far);
                    }
                }
            }
        }
    }

    /// Eight samples of a row of the window from its sample `x`, 0 or 1, on.
    #[inline(always)]
    #[must_use]
    pub fn eight(&self, row: usize, x: usize) -> &[i16; 8] {
        let start = (self.first & 7) + x;
        self.samples[row][start..start + 8].try_into().expect("eight samples")
    }

    /// The block that begins at `quarters` `[x, y, z]`, 0 to 3, in the window's first cell. Samples are at most 4096 codes.
    ///
    /// # Panics
    /// If `quarters` is above 3.
    pub fn translate(&self, quarters: [u8; 3], out: &mut Block) {
        assert!(quarters.iter().all(|q| i32::from(*q) < STEPS_PER_VOXEL), "{quarters:?} quarters");
        if quarters == [0; 3] {
            for (row, values) in out.as_chunks_mut::<8>().0.iter_mut().enumerate() {
                *values = *self.eight(row / 8 * SIDE + row % 8, 0);
            }
            return;
        }
        dispatch!(simd::level(), simd => self.translate_vectorized(simd, quarters.map(i16::from), out));
    }

    /// Layer by layer along x and y, then from each layer to the one after it.
    #[inline(always)]
    fn translate_vectorized<S: Simd>(&self, simd: S, [x, y, z]: [i16; 3], out: &mut Block) {
        let weights = i16x8::simd_from(simd, [4 - y, y, 4 - y, y, 4 - y, y, 4 - y, y]);
        let mut before = [i32x8::splat(simd, 0); 8];
        for layer in 0..SIDE {
            let mut near = self.along_x(simd, layer * SIDE, x);
            for row in 0..8 {
                let far = self.along_x(simd, layer * SIDE + row + 1, x);
                let low = simd.pairwise_dot_product_i16x8(near.zip_low(far), weights);
                let high = simd.pairwise_dot_product_i16x8(near.zip_high(far), weights);
                let along_y = simd.combine_i32x4(low, high);
                if layer > 0 {
                    let sums = before[row] * 4 + (along_y - before[row]) * i32::from(z);
                    let (low, high) = simd.split_i32x8((sums + 32) >> 6);
                    let start = 64 * (layer - 1) + 8 * row;
                    simd.saturating_narrow_i32x4(low, high).store_slice(&mut out[start..start + 8]);
                }
                before[row] = along_y;
                near = far;
            }
        }
    }

    /// A row between its samples along x, in quarters of a code: at most `2^14`, and no term on the way leaves 16 bits.
    #[inline(always)]
    fn along_x<S: Simd>(&self, simd: S, row: usize, x: i16) -> i16x8<S> {
        let near = i16x8::from_slice(simd, self.eight(row, 0));
        let far = i16x8::from_slice(simd, self.eight(row, 1));
        near * 4 + (far - near) * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::{MotionVector, StitchedReference};
    use isv_volume::BlockEdge;

    #[test]
    fn translations_are_those_of_the_warp() {
        let mut seed = 1u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((seed >> 8) % 8193) as i16 - 4096
        };
        let mut stitched = StitchedReference::new(BlockEdge::E8);
        let blocks: [Block; 27] = std::array::from_fn(|_| std::array::from_fn(|_| noise()));
        blocks.iter().enumerate().for_each(|(slot, block)| stitched.put_block(slot, block));
        for t in -16i8..16 {
            let translation = [t, (t * 5) % 16, 3 - t];
            let mut window = WindowRows::default();
            let cell = translation.map(|t| (8 + t.div_euclid(4)) as usize);
            let block = |step: usize| {
                let [x, y, z] = [0, 1, 2].map(|axis| cell[axis] / 8 + (step >> axis & 1));
                &blocks[x + 3 * y + 9 * z]
            };
            window.load(&std::array::from_fn(block), cell.map(|c| c % 8));
            let (mut expected, mut found) = ([0; 512], [0; 512]);
            stitched.warp(MotionVector { translation, rotation: [0; 3] }, &mut expected);
            window.translate(translation.map(|t| t.rem_euclid(4) as u8), &mut found);
            assert!(expected == found, "{translation:?}");
        }
    }
}
