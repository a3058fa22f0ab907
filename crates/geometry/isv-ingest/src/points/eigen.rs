//! Eigenvectors of symmetric 3 x 3 matrices, by Jacobi's rotations.

use glam::DVec3;

/// Sweeps over the three off-diagonal elements; convergence is quadratic, and four suffice in practice.
const SWEEPS: usize = 8;

/// The eigenvalues of a symmetric matrix, ascending, each with its unit eigenvector.
pub(crate) fn eigen(mut m: [[f64; 3]; 3]) -> [(f64, DVec3); 3] {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, &mut vectors, p, q);
        }
    }
    let mut pairs = [0, 1, 2].map(|i| (m[i][i], DVec3::from_array(vectors[i]).normalize_or_zero()));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

/// Makes the element in row `p` and column `q` zero.
fn rotate(m: &mut [[f64; 3]; 3], vectors: &mut [[f64; 3]; 3], p: usize, q: usize) {
    if m[p][q] == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    for k in 0..3 {
        (m[k][p], m[k][q]) = (cosine * m[k][p] - sine * m[k][q], sine * m[k][p] + cosine * m[k][q]);
    }
    for k in 0..3 {
        (m[p][k], m[q][k]) = (cosine * m[p][k] - sine * m[q][k], sine * m[p][k] + cosine * m[q][k]);
        (vectors[p][k], vectors[q][k]) =
            (cosine * vectors[p][k] - sine * vectors[q][k], sine * vectors[p][k] + cosine * vectors[q][k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use isv_testkit::Random;

    #[test]
    fn vectors_are_orthonormal_and_solve_the_matrix() {
        let mut random = Random::new(5);
        for _ in 0..100 {
            let [a, b] = [random.point(), random.point()];
            let m = [[a.x, b.x, b.y], [b.x, a.y, b.z], [b.y, b.z, a.z]];
            let pairs = eigen(m);
            assert!(pairs[0].0 <= pairs[1].0 && pairs[1].0 <= pairs[2].0);
            for (value, vector) in pairs {
                assert!((DMat3::from_cols_array_2d(&m) * vector - value * vector).length() < 1e-12);
                assert!((vector.length() - 1.0).abs() < 1e-12);
            }
            assert!(pairs[0].1.dot(pairs[1].1).abs() < 1e-12);
        }
    }

    #[test]
    fn diagonal_and_zero_matrices_are_left_alone() {
        assert_eq!(eigen([[0.0; 3]; 3]).map(|p| p.0), [0.0; 3]);
        let pairs = eigen([[3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]]);
        assert_eq!(pairs, [(1.0, DVec3::Y), (2.0, DVec3::Z), (3.0, DVec3::X)]);
    }
}
