//! The orthonormal 3-D DCT of a block in floating point, for the encoder's choices; what is coded goes through the exact one.

use super::target::Field;
use super::weight_spectrum::{CODED_ROWS, LAST_SUM};
use fearless_simd::{f32x8, prelude::*};

/// An 8-point transform matrix.
type Matrix = [[f32; 8]; 8];

/// Amplitude of the cosine of each frequency in the orthonormal transform: `sqrt(1/8)`, then 1/2.
pub(crate) const SCALES: [f32; 8] = [0.353_553_4, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];

/// The matrices that the encoder needs.
#[derive(Clone, Debug)]
pub(crate) struct FieldDct {
    /// Values of the basis functions, `[frequency][place]`.
    basis: Matrix,
    /// The same, `[place][frequency]`.
    transposed: Matrix,
}

impl FieldDct {
    pub(crate) fn new() -> Self {
        let value = |k: usize, x: usize| {
            let scale = if k == 0 { 0.125f64 } else { 0.25 }.sqrt();
            (scale * ((2 * x + 1) as f64 * k as f64 * std::f64::consts::PI / 16.0).cos()) as f32
        };
        let basis: Matrix = std::array::from_fn(|k| std::array::from_fn(|x| value(k, x)));
        let transposed = std::array::from_fn(|x| std::array::from_fn(|k| basis[k][x]));
        Self { basis, transposed }
    }

    /// Inner product of a field with every basis function, `[w][v][u]`, of rows that have coded coefficients.
    #[inline(always)]
    pub(crate) fn forward<S: Simd>(&self, simd: S, field: &Field, out: &mut Field) {
        let along_y = self.along_z_and_y(simd, field, |w| 8.min(LAST_SUM + 1 - w));
        for row in CODED_ROWS {
            self.row_along_x(simd, &along_y, row, out);
        }
    }

    /// [`Self::forward`] of all rows.
    #[inline(always)]
    pub(crate) fn forward_all<S: Simd>(&self, simd: S, field: &Field, out: &mut Field) {
        let along_y = self.along_z_and_y(simd, field, |_| 8);
        for row in 0..64 {
            self.row_along_x(simd, &along_y, row, out);
        }
    }

    /// Transforms along z, then y. `rows`: how many of the frequencies along y are wanted at one along z.
    #[inline(always)]
    fn along_z_and_y<S: Simd>(&self, simd: S, field: &Field, rows: impl Fn(usize) -> usize) -> Field {
        let (mut along_z, mut along_y) = ([0.0; 512], [0.0; 512]);
        for y in 0..8 {
            let halves = Halves::new(simd, field, |z| 8 * z + y);
            for w in 0..8 {
                halves.frequency(simd, &self.basis[w], w).store_slice(row_mut(&mut along_z, 8 * w + y));
            }
        }
        for w in 0..8 {
            let halves = Halves::new(simd, &along_z, |y| 8 * w + y);
            for v in 0..rows(w) {
                halves.frequency(simd, &self.basis[v], v).store_slice(row_mut(&mut along_y, 8 * w + v));
            }
        }
        along_y
    }

    #[inline(always)]
    fn row_along_x<S: Simd>(&self, simd: S, along_y: &Field, row: usize, out: &mut Field) {
        let mut sums = f32x8::splat(simd, 0.0);
        for x in 0..8 {
            let value = f32x8::splat(simd, along_y[8 * row + x]);
            sums += f32x8::from_slice(simd, &self.transposed[x]) * value;
        }
        sums.store_slice(row_mut(out, row));
    }

    /// Adds a multiple of the basis function of a position `[w][v][u]`.
    #[inline(always)]
    pub(crate) fn add(&self, position: usize, amount: f32, field: &mut Field) {
        let [u, v, w] = [position % 8, position / 8 % 8, position / 64].map(|k| &self.basis[k]);
        for (row, values) in field.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let factor = amount * w[row / 8] * v[row % 8];
            for x in 0..8 {
                values[x] += factor * u[x];
            }
        }
    }
}

#[inline(always)]
fn row_mut(field: &mut Field, row: usize) -> &mut [f32] {
    &mut field[8 * row..8 * row + 8]
}

/// Eight rows along an axis, folded: cosines of even frequencies are the same from both ends and those of odd ones opposite, so
/// half of the products are enough.
struct Halves<S: Simd> {
    sums: [f32x8<S>; 4],
    differences: [f32x8<S>; 4],
}

impl<S: Simd> Halves<S> {
    /// Of the rows of a field at the places `row(0)` to `row(7)`.
    #[inline(always)]
    fn new(simd: S, field: &Field, row: impl Fn(usize) -> usize) -> Self {
        let zero = [f32x8::splat(simd, 0.0); 4];
        let mut halves = Self { sums: zero, differences: zero };
        for i in 0..4 {
            let [near, far] = [i, 7 - i].map(|i| f32x8::from_slice(simd, &field[8 * row(i)..8 * row(i) + 8]));
            halves.sums[i] = near + far;
            halves.differences[i] = near - far;
        }
        halves
    }

    /// The inner products with a basis function, lane by lane.
    #[inline(always)]
    fn frequency(&self, simd: S, basis: &[f32; 8], k: usize) -> f32x8<S> {
        let half = if k.is_multiple_of(2) { &self.sums } else { &self.differences };
        let mut sum = f32x8::splat(simd, basis[0]) * half[0];
        for i in 1..4 {
            sum += f32x8::splat(simd, basis[i]) * half[i];
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::dispatch;
    use isv_kernels::simd;

    #[test]
    fn a_basis_function_has_one_coefficient_of_its_amount() {
        let dct = FieldDct::new();
        for position in [0, 3, 8 * 5, 64 * 7 + 8 + 2] {
            let (mut field, mut out) = ([0.0; 512], [0.0; 512]);
            dct.add(position, -2.5, &mut field);
            dispatch!(simd::level(), simd => dct.forward_all(simd, &field, &mut out));
            for (k, value) in out.into_iter().enumerate() {
                let expected = if k == position { -2.5 } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{position}: {k} {value}");
            }
        }
    }
}
