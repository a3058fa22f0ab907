//! Inner products of basis functions under weights, from one transform of the weights.
//!
//! The product of two cosines is the mean of the cosines of the difference and of the sum of their frequencies. So along an axis
//! `sum w cos(k a) cos(l a)` is `(C(k - l) + C(k + l)) / 2` with `C(m) = sum w cos(m a)`. In space it is the mean of eight such
//! sums. Frequencies beyond 8 fold: `C(16 - m) = -C(m)`, and `C(8)` is zero.

use super::field_dct::{FieldDct, SCALES};
use super::lanes::load;
use super::target::Field;
use fearless_simd::{Simd, f32x8, prelude::*};

/// Index sum of the last coefficient that is coded.
pub(crate) const LAST_SUM: usize = 8;
/// Frequencies -7 to 14, padded.
const EXTENDED: usize = 24;
const ZERO: usize = 7;

/// Rows of coefficients, `8 w + v`, that have one that is coded: the others' index sums are too high.
pub(crate) static CODED_ROWS: [usize; 43] = {
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

/// `[k][l]`: the frequencies, 0 to 7, whose sums make up the product of two cosines. First that of the difference, then that of the
/// sum, and the sign of the latter (0 if it vanishes).
static PRODUCTS: [[(usize, usize, f32); 8]; 8] = {
    let mut products = [[(0, 0, 0.0); 8]; 8];
    let mut i = 0;
    while i < 64 {
        let (k, l) = (i / 8, i % 8);
        let (sum, sign) = folded(k + l);
        products[k][l] = (k.abs_diff(l), sum, sign);
        i += 1;
    }
    products
};

/// Weights as sums of cosines.
#[derive(Clone, Debug)]
pub(crate) struct WeightSpectrum {
    /// `[8 w + v][u + 7]`: `sum weight cos cos cos`.
    rows: [[f32; EXTENDED]; 64],
}

impl WeightSpectrum {
    /// Spectrum of no weights.
    pub(crate) const NONE: Self = Self { rows: [[0.0; EXTENDED]; 64] };

    /// Becomes the spectrum of a block's weights. `sums` is room to work in.
    #[inline(always)]
    pub(crate) fn transform<S: Simd>(&mut self, simd: S, dct: &FieldDct, weights: &Field, sums: &mut Field) {
        dct.cosine_sums(
            simd,
            #[inline(always)]
            |row| load(simd, weights, row),
            sums,
        );
        for row in 0..64 {
            let (sums, extended) = (load(simd, sums, row), &mut self.rows[row]);
            // -7 to 0, then 9 to 16, of which the last is not looked at; 0 to 7; and 8 is zero.
            sums.reverse().store_slice(&mut extended[..8]);
            (-sums.reverse()).store_slice(&mut extended[ZERO + 9..]);
            sums.store_slice(&mut extended[ZERO..ZERO + 8]);
        }
    }

    /// The weighted energy of every basis function, of coded rows. `along_x` is room to work in.
    #[inline(always)]
    pub(crate) fn energies<S: Simd>(&self, simd: S, along_x: &mut Field, out: &mut Field) {
        for row in 0..64 {
            let extended = &self.rows[row];
            let [low, high] = [ZERO, ZERO + 8].map(|at| f32x8::from_slice(simd, &extended[at..at + 8]));
            let sums = f32x8::splat(simd, extended[ZERO]) + low.unzip_low(high);
            sums.store_slice(&mut along_x[8 * row..8 * row + 8]);
        }
        let scales_x = f32x8::from_slice(simd, &SCALES);
        let squares_x = scales_x * scales_x;
        for v in 0..8 {
            let (_, y, sign) = PRODUCTS[v][v];
            let mut along_y = [f32x8::splat(simd, 0.0); 8];
            for z in 0..8 {
                along_y[z] = load(simd, along_x, 8 * z) + load(simd, along_x, 8 * z + y) * sign;
            }
            for w in 0..8.min(LAST_SUM + 1 - v) {
                let (_, z, sign) = PRODUCTS[w][w];
                let scale = (SCALES[w] * SCALES[v]).powi(2) / 8.0;
                let row = 8 * (8 * w + v);
                let sums = along_y[0] + along_y[z] * sign;
                (sums * squares_x * scale).store_slice(&mut out[row..row + 8]);
            }
        }
    }

    /// Adds a multiple of the inner products of a position's basis function with all others to coded rows.
    #[inline(always)]
    pub(crate) fn add_products<S: Simd>(&self, simd: S, position: usize, amount: f32, out: &mut Field) {
        let [ku, kv, kw] = [position % 8, position / 8 % 8, position / 64 % 8];
        let amount = f32x8::from_slice(simd, &SCALES) * (amount * SCALES[ku] * SCALES[kv] * SCALES[kw] / 8.0);
        for v in 0..8 {
            let (difference, sum, sign) = PRODUCTS[kv][v];
            let mut along_y = [f32x8::splat(simd, 0.0); 8];
            for z in 0..8 {
                let sums = self.along_x(simd, 8 * z + sum, ku);
                along_y[z] = self.along_x(simd, 8 * z + difference, ku) + sums * sign;
            }
            for w in 0..8.min(LAST_SUM + 1 - v) {
                let (difference, sum, sign) = PRODUCTS[kw][w];
                let sums = along_y[difference] + along_y[sum] * sign;
                let row = 8 * (8 * w + v);
                let changed =
                    f32x8::from_slice(simd, &out[row..row + 8]) + sums * amount * (SCALES[w] * SCALES[v]);
                changed.store_slice(&mut out[row..row + 8]);
            }
        }
    }

    /// The products of a frequency along x with all others in a row.
    #[inline(always)]
    fn along_x<S: Simd>(&self, simd: S, row: usize, ku: usize) -> f32x8<S> {
        // Masks instead of checks: rows are 64, and with a frequency of 0 to 7 eight values are left in each.
        let (extended, ku) = (&self.rows[row & 63], ku & 7);
        let difference = f32x8::from_slice(simd, &extended[ZERO - ku..ZERO - ku + 8]);
        difference + f32x8::from_slice(simd, &extended[ZERO + ku..ZERO + ku + 8])
    }
}

/// A frequency of 0 to 14 as one of 0 to 7 and a factor.
const fn folded(m: usize) -> (usize, f32) {
    match m {
        0..8 => (m, 1.0),
        8 => (0, 0.0),
        _ => (16 - m, -1.0),
    }
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
        let (mut spectrum, mut room) = (WeightSpectrum::NONE, [0.0; 512]);
        dispatch!(simd::level(), simd => spectrum.transform(simd, &dct, &weights, &mut room));
        let mut energies = [0.0; 512];
        dispatch!(simd::level(), simd => spectrum.energies(simd, &mut room, &mut energies));
        for position in [0, 3, 7, 8 * 5 + 1, 64 * 7, 64 * 2 + 8 * 4 + 2, 64 * 5 + 8 * 3] {
            let (mut field, mut expected) = ([0.0; 512], [0.0; 512]);
            dispatch!(simd::level(), simd => dct.add(simd, position, -1.5, &mut field));
            field.iter_mut().zip(&weights).for_each(|(f, w)| *f *= w);
            dispatch!(simd::level(), simd => dct.forward(simd, |row| load(simd, &field, row), &mut expected));
            let mut found = [0.0; 512];
            dispatch!(simd::level(), simd => spectrum.add_products(simd, position, -1.5, &mut found));
            for k in CODED_ROWS.into_iter().flat_map(|row| 8 * row..8 * row + 8) {
                assert!((found[k] - expected[k]).abs() < 1e-4, "{position}: {k}");
            }
            assert!((energies[position] * -1.5 - expected[position]).abs() < 1e-4, "{position}");
        }
    }
}
