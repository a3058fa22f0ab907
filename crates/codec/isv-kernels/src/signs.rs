//! The signs of a block's samples as bits.

use crate::block8::Block;
use crate::simd::vectorized;

/// Which samples of a block lie inside the surface, that is, are negative: a word a z, a bit a voxel, x fastest.
#[must_use]
pub fn inside(block: &Block) -> [u64; 8] {
    vectorized(
        #[inline(always)]
        || {
            let mut rows = [0u8; 64];
            for (row, samples) in rows.iter_mut().zip(block.as_chunks().0) {
                *row = inside_row::<8>(samples) as u8;
            }
            let mut words = [0; 8];
            for (word, rows) in words.iter_mut().zip(rows.as_chunks::<8>().0) {
                *word = u64::from_le_bytes(*rows);
            }
            words
        },
    )
}

/// Which samples of a row of up to 16 lie inside the surface: a bit a sample. To be inlined into [`vectorized`] work.
#[must_use]
#[inline(always)]
pub fn inside_row<const SIDE: usize>(samples: &[i16; SIDE]) -> u16 {
    let mut bits = [0; SIDE];
    for x in 0..SIDE {
        bits[x] = (samples[x] >> 15) as u16 & 1 << x;
    }
    bits.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_has_its_bit() {
        let block: Block = std::array::from_fn(|v| ((v * v * 31 + v) % 7) as i16 - 3);
        let words = inside(&block);
        for (voxel, sample) in block.iter().enumerate() {
            assert_eq!(words[voxel / 64] >> (voxel % 64) & 1 != 0, *sample < 0, "{voxel}");
        }
    }
}
