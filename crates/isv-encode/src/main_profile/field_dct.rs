//! The orthonormal 3-D DCT of a block in floating point, for the encoder's choices; what is coded goes through the exact one.

use super::target::Field;

/// An 8-point transform matrix, `[frequency][place]`.
pub(crate) type Matrix = [[f32; 8]; 8];

/// The matrices that the encoder needs.
#[derive(Clone, Debug)]
pub(crate) struct FieldDct {
    /// Values of the basis functions.
    pub basis: Matrix,
    /// Their squares: transforms weights into the weighted energy of each basis function.
    squares: Matrix,
}

impl FieldDct {
    pub(crate) fn new() -> Self {
        let value = |k: usize, x: usize| {
            let scale = if k == 0 { 0.125f64 } else { 0.25 }.sqrt();
            (scale * ((2 * x + 1) as f64 * k as f64 * std::f64::consts::PI / 16.0).cos()) as f32
        };
        let basis: Matrix = std::array::from_fn(|k| std::array::from_fn(|x| value(k, x)));
        Self { basis, squares: basis.map(|row| row.map(|v| v * v)) }
    }

    /// Inner product of a field with every basis function, `[w][v][u]`.
    #[inline(always)]
    pub(crate) fn forward(&self, field: &Field, out: &mut Field) {
        transform(&self.basis, field, out);
    }

    /// Weighted energy of every basis function, `[w][v][u]`.
    #[inline(always)]
    pub(crate) fn energies(&self, weights: &Field, out: &mut Field) {
        transform(&self.squares, weights, out);
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

/// The separable transform with one matrix along all axes: z, then y, then x.
#[inline(always)]
fn transform(matrix: &Matrix, field: &Field, out: &mut Field) {
    let mut along_z = [0.0f32; 512];
    for (w, layer) in along_z.as_chunks_mut::<64>().0.iter_mut().enumerate() {
        for (z, input) in field.as_chunks::<64>().0.iter().enumerate() {
            let factor = matrix[w][z];
            for lane in 0..64 {
                layer[lane] += factor * input[lane];
            }
        }
    }
    for (layer, out) in along_z.as_chunks::<64>().0.iter().zip(out.as_chunks_mut::<64>().0) {
        let mut along_y = [[0.0f32; 8]; 8];
        for (v, sums) in along_y.iter_mut().enumerate() {
            for (y, input) in layer.as_chunks::<8>().0.iter().enumerate() {
                let factor = matrix[v][y];
                for x in 0..8 {
                    sums[x] += factor * input[x];
                }
            }
        }
        for (row, out) in along_y.iter().zip(out.as_chunks_mut::<8>().0) {
            let mut sums = [0.0f32; 8];
            for x in 0..8 {
                for u in 0..8 {
                    sums[u] += matrix[u][x] * row[x];
                }
            }
            *out = sums;
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
            dct.forward(&field, &mut out);
            for (k, value) in out.into_iter().enumerate() {
                let expected = if k == position { -2.5 } else { 0.0 };
                assert!((value - expected).abs() < 1e-5, "{position}: {k} {value}");
            }
            dct.energies(&[1.0; 512], &mut out);
            assert!(out.iter().all(|energy| (energy - 1.0).abs() < 1e-5));
        }
    }
}
