//! The orthonormal 3-D DCT of a block in floating point, for the encoder's choices; what is coded goes through the exact one.

use super::lanes::load;
use super::target::Field;
use super::weight_spectrum::LAST_SUM;
use fearless_simd::{f32x8, prelude::*};

/// An 8-point transform matrix.
type Matrix = [[f32; 8]; 8];

/// Amplitude of the cosine of each frequency in the orthonormal transform: `sqrt(1/8)`, then 1/2.
pub(crate) const SCALES: [f32; 8] = [0.353_553_4, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5];

/// Functions of an axis.
#[derive(Clone, Debug)]
struct Axis {
    /// Their values, `[frequency][place]`.
    values: Matrix,
    /// Transpose of `values`, `[place][frequency]`.
    transposed: Matrix,
}

impl Axis {
    /// Cosines of these amplitudes.
    fn new(amplitude: impl Fn(usize) -> f64) -> Self {
        let value = |k: usize, x: usize| {
            (amplitude(k) * ((2 * x + 1) as f64 * k as f64 * std::f64::consts::PI / 16.0).cos()) as f32
        };
        let values: Matrix = std::array::from_fn(|k| std::array::from_fn(|x| value(k, x)));
        let transposed = std::array::from_fn(|x| std::array::from_fn(|k| values[k][x]));
        Self { values, transposed }
    }
}

/// The matrices that the encoder needs.
#[derive(Clone, Debug)]
pub(crate) struct FieldDct {
    /// The orthonormal basis functions.
    basis: Axis,
    /// Cosines of amplitude 1.
    cosines: Axis,
}

impl FieldDct {
    pub(crate) fn new() -> Self {
        let scale = |k: usize| if k == 0 { 0.125f64 } else { 0.25 }.sqrt();
        Self { basis: Axis::new(scale), cosines: Axis::new(|_| 1.0) }
    }

    /// Inner product of a field, given by rows, with every basis function, `[w][v][u]`, of rows that have coded coefficients.
    #[inline(always)]
    pub(crate) fn forward<S: Simd>(&self, simd: S, row: impl Fn(usize) -> f32x8<S>, out: &mut Field) {
        transform(simd, &self.basis, row, |w| 8.min(LAST_SUM + 1 - w), out);
    }

    /// Sums of a field, given by rows, times cosines of all frequencies, `[w][v][u]`.
    #[inline(always)]
    pub(crate) fn cosine_sums<S: Simd>(&self, simd: S, row: impl Fn(usize) -> f32x8<S>, out: &mut Field) {
        transform(simd, &self.cosines, row, |_| 8, out);
    }

    /// Adds a multiple of the basis function of a position `[w][v][u]`.
    #[inline(always)]
    pub(crate) fn add<S: Simd>(&self, simd: S, position: usize, amount: f32, field: &mut Field) {
        let [u, v, w] = [position % 8, position / 8 % 8, position / 64 % 8].map(|k| &self.basis.values[k]);
        let u = f32x8::from_slice(simd, u);
        for z in 0..8 {
            let amount = amount * w[z];
            for y in 0..8 {
                let row = row_mut(field, 8 * z + y);
                (f32x8::from_slice(simd, row) + u * (amount * v[y])).store_slice(row);
            }
        }
    }
}

/// Inner products along z, then y, then x, in place. `rows`: how many of the frequencies along y are wanted at one along z.
#[inline(always)]
fn transform<S: Simd>(
    simd: S,
    axis: &Axis,
    row: impl Fn(usize) -> f32x8<S>,
    rows: impl Fn(usize) -> usize,
    out: &mut Field,
) {
    for y in 0..8 {
        let halves = Halves::new(
            simd,
            #[inline(always)]
            |z| row(8 * z + y),
        );
        for w in 0..8 {
            halves.frequency(simd, &axis.values[w], w).store_slice(row_mut(out, 8 * w + y));
        }
    }
    for w in 0..8 {
        let halves = Halves::new(
            simd,
            #[inline(always)]
            |y| load(simd, out, 8 * w + y),
        );
        for v in 0..rows(w) {
            halves.frequency(simd, &axis.values[v], v).store_slice(row_mut(out, 8 * w + v));
        }
        for v in 0..rows(w) {
            row_along_x(simd, axis, row_mut(out, 8 * w + v));
        }
    }
}

#[inline(always)]
fn row_along_x<S: Simd>(simd: S, axis: &Axis, row: &mut [f32; 8]) {
    let mut sums = f32x8::splat(simd, 0.0);
    for x in 0..8 {
        sums += f32x8::from_slice(simd, &axis.transposed[x]) * row[x];
    }
    sums.store_slice(row);
}

#[inline(always)]
fn row_mut(field: &mut Field, row: usize) -> &mut [f32; 8] {
    (&mut field[8 * row..8 * row + 8]).try_into().expect("a row")
}

/// Eight rows along an axis, folded. Cosines of even frequencies are the same from both ends, and those of odd ones opposite. So
/// half of the products are enough.
struct Halves<S: Simd> {
    sums: [f32x8<S>; 4],
    differences: [f32x8<S>; 4],
}

impl<S: Simd> Halves<S> {
    /// Folds the rows 0 to 7.
    #[inline(always)]
    fn new(simd: S, row: impl Fn(usize) -> f32x8<S>) -> Self {
        let zero = [f32x8::splat(simd, 0.0); 4];
        let mut halves = Self { sums: zero, differences: zero };
        for i in 0..4 {
            let (near, far) = (row(i), row(7 - i));
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
        for position in [0, 3, 8 * 5, 64 * 7 + 8 + 1] {
            let (mut field, mut out) = ([0.0; 512], [0.0; 512]);
            dispatch!(simd::level(), simd => dct.add(simd, position, -2.5, &mut field));
            dispatch!(simd::level(), simd => dct.forward(simd, |row| load(simd, &field, row), &mut out));
            for (k, value) in out.into_iter().enumerate().filter(|(k, _)| k / 64 + k / 8 % 8 <= LAST_SUM) {
                let expected = if k == position { -2.5 } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{position}: {k} {value}");
            }
        }
    }
}
