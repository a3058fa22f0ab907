//! Inner products of basis functions under weights, from one transform of the weights.
//!
//! The product of two cosines is the mean of those of the difference and of the sum of their frequencies, so along an axis
//! `sum w cos(k a) cos(l a)` is `(C(k - l) + C(k + l)) / 2` with `C(m) = sum w cos(m a)`; in space it is the mean of eight such sums.
//! Frequencies beyond 8 fold: `C(16 - m) = -C(m)`, and `C(8)` is zero.

use super::field_dct::{FieldDct, SCALES};
use super::target::Field;
use fearless_simd::{Simd, f32x8, prelude::*};

/// Index sum of the last coefficient that is coded.
pub(crate) const LAST_SUM: usize = 8;
/// Frequencies -7 to 14, padded.
const EXTENDED: usize = 24;
const ZERO: usize = 7;

/// Rows of coefficients, `8 w + v`, that have one that is coded: the others' index sums are too high.
pub(crate) const CODED_ROWS: [usize; 43] = {
    let (mut rows, mut count, mut row) = ([0; 43], 0, 0);
    while row < 64 {
        if row / 8 + row % 8 <= LAST_SUM {
            rows[count] = row;
            count += 1;
        }
        row += 1;
    }
    rows
};

/// Weights as sums of cosines.
#[derive(Clone, Debug)]
pub(crate) struct WeightSpectrum {
    /// `[8 w + v][u + 7]`: `sum weight cos cos cos`.
    rows: [[f32; EXTENDED]; 64],
}

impl WeightSpectrum {
    /// That of no weights.
    pub(crate) const NONE: Self = Self { rows: [[0.0; EXTENDED]; 64] };

    /// Becomes the spectrum of a block's weights.
    #[inline(always)]
    pub(crate) fn transform<S: Simd>(&mut self, simd: S, dct: &FieldDct, weights: &Field) {
        let mut transformed = [0.0; 512];
        dct.forward_all(simd, weights, &mut transformed);
        let scales_x = f32x8::from_slice(simd, &SCALES);
        for (row, extended) in self.rows.iter_mut().enumerate() {
            let scales = f32x8::splat(simd, SCALES[row / 8] * SCALES[row % 8]) * scales_x;
            let sums = f32x8::from_slice(simd, &transformed[8 * row..8 * row + 8]) / scales;
            // -7 to 0, then 9 to 16, of which the last is not looked at; 0 to 7; and 8 is zero.
            sums.reverse().store_slice(&mut extended[..8]);
            (-sums.reverse()).store_slice(&mut extended[ZERO + 9..]);
            sums.store_slice(&mut extended[ZERO..ZERO + 8]);
        }
    }

    /// The weighted energy of every basis function, of coded rows.
    #[inline(always)]
    pub(crate) fn energies<S: Simd>(&self, simd: S, out: &mut Field) {
        let mut along_x = [0.0; 512];
        for (extended, sums) in self.rows.iter().zip(along_x.as_chunks_mut::<8>().0) {
            let [low, high] = [ZERO, ZERO + 8].map(|at| f32x8::from_slice(simd, &extended[at..at + 8]));
            (f32x8::splat(simd, extended[ZERO]) + low.unzip_low(high)).store_slice(sums);
        }
        let scales_x = f32x8::from_slice(simd, &SCALES);
        for row in CODED_ROWS {
            let (w, v) = (row / 8, row % 8);
            let scale = (SCALES[w] * SCALES[v]).powi(2) / 8.0;
            let mut sums = f32x8::splat(simd, 0.0);
            for (z, sign_z) in [(0, 1.0), folded(2 * w)] {
                for (y, sign) in [(0, sign_z), folded_times(2 * v, sign_z)] {
                    let at = 8 * (8 * z + y);
                    sums += f32x8::from_slice(simd, &along_x[at..at + 8]) * sign;
                }
            }
            (sums * scale * scales_x * scales_x).store_slice(&mut out[8 * row..8 * row + 8]);
        }
    }

    /// Adds a multiple of the inner products of a position's basis function with all others to coded rows.
    #[inline(always)]
    pub(crate) fn add_products(&self, position: usize, amount: f32, out: &mut Field) {
        let [ku, kv, kw] = [position % 8, position / 8 % 8, position / 64];
        let amount = amount * SCALES[ku] * SCALES[kv] * SCALES[kw] / 8.0;
        for row in CODED_ROWS {
            let (w, v) = (row / 8, row % 8);
            let mut sums = [0.0; 8];
            for (z, sign_z) in [(w.abs_diff(kw), 1.0), folded(w + kw)] {
                for (y, sign) in [(v.abs_diff(kv), sign_z), folded_times(v + kv, sign_z)] {
                    let extended = &self.rows[8 * z + y];
                    let difference: &[f32; 8] = extended[ZERO - ku..15 - ku].try_into().expect("eight");
                    let sum: &[f32; 8] = extended[ZERO + ku..15 + ku].try_into().expect("eight");
                    for u in 0..8 {
                        sums[u] += sign * (difference[u] + sum[u]);
                    }
                }
            }
            let factor = amount * SCALES[w] * SCALES[v];
            let out: &mut [f32; 8] = (&mut out[8 * row..8 * row + 8]).try_into().expect("a row");
            for u in 0..8 {
                out[u] += factor * SCALES[u] * sums[u];
            }
        }
    }
}

/// A frequency of 0 to 14 as one of 0 to 7 and a factor.
#[inline(always)]
fn folded(m: usize) -> (usize, f32) {
    match m {
        0..8 => (m, 1.0),
        8 => (0, 0.0),
        _ => (16 - m, -1.0),
    }
}

#[inline(always)]
fn folded_times(m: usize, factor: f32) -> (usize, f32) {
    let (m, sign) = folded(m);
    (m, sign * factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::dispatch;
    use isv_kernels::simd;

    #[test]
    fn products_are_those_of_transformed_basis_functions() {
        let dct = FieldDct::new();
        let weights: Field = std::array::from_fn(|v| ((v * 37 + v * v) % 101) as f32 / 101.0);
        let mut spectrum = WeightSpectrum::NONE;
        dispatch!(simd::level(), simd => spectrum.transform(simd, &dct, &weights));
        let mut energies = [0.0; 512];
        dispatch!(simd::level(), simd => spectrum.energies(simd, &mut energies));
        for position in [0, 3, 7, 8 * 5 + 1, 64 * 7, 64 * 2 + 8 * 4 + 2, 64 * 5 + 8 * 3] {
            let (mut field, mut expected) = ([0.0; 512], [0.0; 512]);
            dct.add(position, -1.5, &mut field);
            field.iter_mut().zip(&weights).for_each(|(f, w)| *f *= w);
            dispatch!(simd::level(), simd => dct.forward_all(simd, &field, &mut expected));
            let mut found = [0.0; 512];
            spectrum.add_products(position, -1.5, &mut found);
            for k in CODED_ROWS.into_iter().flat_map(|row| 8 * row..8 * row + 8) {
                assert!((found[k] - expected[k]).abs() < 1e-4, "{position}: {k}");
            }
            assert!((energies[position] * -1.5 - expected[position]).abs() < 1e-4, "{position}");
        }
    }
}
