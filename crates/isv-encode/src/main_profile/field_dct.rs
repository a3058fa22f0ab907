//! The orthonormal 3-D DCT of a block in floating point, for the encoder's choices; what is coded goes through the exact one.

use super::target::Field;
use super::weight_spectrum::CODED_ROWS;

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
    pub(crate) fn forward(&self, field: &Field, out: &mut Field) {
        let along_y = self.along_z_and_y(field);
        for row in CODED_ROWS {
            self.row_along_x(&along_y, row, out);
        }
    }

    /// [`Self::forward`] of all rows.
    #[inline(always)]
    pub(crate) fn forward_all(&self, field: &Field, out: &mut Field) {
        let along_y = self.along_z_and_y(field);
        for row in 0..64 {
            self.row_along_x(&along_y, row, out);
        }
    }

    #[inline(always)]
    fn along_z_and_y(&self, field: &Field) -> Field {
        let (mut along_z, mut along_y) = ([0.0; 512], [0.0; 512]);
        transform_lanes::<64>(&self.basis, field, &mut along_z);
        for (layer, out) in along_z.as_chunks::<64>().0.iter().zip(along_y.as_chunks_mut::<64>().0) {
            transform_lanes::<8>(&self.basis, layer, out);
        }
        along_y
    }

    #[inline(always)]
    fn row_along_x(&self, along_y: &Field, row: usize, out: &mut Field) {
        let mut sums = [0.0; 8];
        for x in 0..8 {
            for u in 0..8 {
                sums[u] += self.transposed[x][u] * along_y[8 * row + x];
            }
        }
        out[8 * row..8 * row + 8].copy_from_slice(&sums);
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

/// Transforms eight layers of `N` lanes each, lane by lane. Cosines of even frequencies are the same from both ends and those of
/// odd ones opposite, so half of the products are enough.
#[inline(always)]
fn transform_lanes<const N: usize>(basis: &Matrix, input: &[f32], out: &mut [f32]) {
    let (input, out) = (input.as_chunks::<N>().0, out.as_chunks_mut::<N>().0);
    let (mut sums, mut differences) = ([[0.0; N]; 4], [[0.0; N]; 4]);
    for i in 0..4 {
        for lane in 0..N {
            sums[i][lane] = input[i][lane] + input[7 - i][lane];
            differences[i][lane] = input[i][lane] - input[7 - i][lane];
        }
    }
    for k in 0..8 {
        let half = if k % 2 == 0 { &sums } else { &differences };
        for lane in 0..N {
            out[k][lane] = basis[k][0] * half[0][lane]
                + basis[k][1] * half[1][lane]
                + basis[k][2] * half[2][lane]
                + basis[k][3] * half[3][lane];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_basis_function_has_one_coefficient_of_its_amount() {
        let dct = FieldDct::new();
        for position in [0, 3, 8 * 5, 64 * 7 + 8 + 2] {
            let (mut field, mut out) = ([0.0; 512], [0.0; 512]);
            dct.add(position, -2.5, &mut field);
            dct.forward_all(&field, &mut out);
            for (k, value) in out.into_iter().enumerate() {
                let expected = if k == position { -2.5 } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{position}: {k} {value}");
            }
        }
    }
}
