//! Exact distances from samples to triangles, in both directions.

use glam::DVec3;
use isv_spatial::Bvh;
use rayon::prelude::*;

/// Distance of each point to the nearest point of a surface, in metres.
#[must_use]
pub fn distances_to_surface(points: &[DVec3], surface: &Bvh) -> Vec<f64> {
    points.par_iter().map(|p| surface.closest_point(*p).distance_sq.sqrt()).collect()
}

/// Statistics of the distances between two surfaces, in metres. The two directions weigh half each, however many
/// samples they have, so that a test surface with stray parts cannot outvote the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDistances {
    /// Mean of the distances from the reference to the test surface: large where the test surface misses something.
    pub ref_to_test_mean: f64,
    /// Mean of the distances from the test surface to the reference: large where it has something that is not there.
    pub test_to_ref_mean: f64,
    /// Mean of the two means.
    pub mean: f64,
    /// Square root of the mean of the two mean squares.
    pub rms: f64,
    /// The smallest distance that 99 % of all samples do not exceed.
    pub p99: f64,
    /// The largest distance of either direction (a lower bound of the true Hausdorff distance, as samples are finite).
    pub hausdorff: f64,
}

impl SurfaceDistances {
    /// Summarises the distances of samples of the reference to the test surface, and of samples of the test surface
    /// to the reference.
    ///
    /// # Panics
    /// If a direction has no samples.
    #[must_use]
    pub fn new(mut ref_to_test: Vec<f64>, mut test_to_ref: Vec<f64>) -> Self {
        assert!(!ref_to_test.is_empty() && !test_to_ref.is_empty(), "no mean without samples");
        // In order for the percentile; the sums below gain precision from it.
        ref_to_test.par_sort_unstable_by(f64::total_cmp);
        test_to_ref.par_sort_unstable_by(f64::total_cmp);
        let directions = [&ref_to_test, &test_to_ref];
        let means = directions.map(|d| d.iter().sum::<f64>() / d.len() as f64);
        let mean_squares = directions.map(|d| d.iter().map(|x| x * x).sum::<f64>() / d.len() as f64);
        Self {
            ref_to_test_mean: means[0],
            test_to_ref_mean: means[1],
            mean: (means[0] + means[1]) / 2.0,
            rms: ((mean_squares[0] + mean_squares[1]) / 2.0).sqrt(),
            p99: percentile_99(&ref_to_test, &test_to_ref),
            hausdorff: directions.map(|d| d[d.len() - 1]).into_iter().fold(0.0, f64::max),
        }
    }
}

/// The smallest value of two sorted lists that 99 % do not exceed, each list weighing half.
fn percentile_99(a: &[f64], b: &[f64]) -> f64 {
    let (mut in_a, mut in_b) = (0, 0);
    let mut value = 0.0;
    // Shares in a/b's whole numbers: in_a / a.len() + in_b / b.len() >= 2 * 99 / 100.
    let whole = a.len() as u128 * b.len() as u128;
    while (in_a as u128 * b.len() as u128 + in_b as u128 * a.len() as u128) * 100 < 2 * 99 * whole {
        if in_b == b.len() || (in_a < a.len() && a[in_a] <= b[in_b]) {
            value = a[in_a];
            in_a += 1;
        } else {
            value = b[in_b];
            in_b += 1;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_weigh_half_each() {
        let s = SurfaceDistances::new(vec![1.0], vec![3.0, 5.0, 4.0]);
        assert_eq!((s.ref_to_test_mean, s.test_to_ref_mean, s.mean), (1.0, 4.0, 2.5));
        assert!((s.rms - ((1.0 + 50.0 / 3.0) / 2.0f64).sqrt()).abs() < 1e-15);
        assert_eq!((s.p99, s.hausdorff), (5.0, 5.0));
    }

    #[test]
    fn the_percentile_is_the_first_value_that_99_of_100_do_not_exceed() {
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(percentile_99(&hundred, &hundred), 99.0);
        assert_eq!(percentile_99(&hundred, &[0.0]), 98.0);
        assert_eq!(percentile_99(&[2.0], &[1.0]), 2.0);
        assert_eq!(percentile_99(&[0.0], &[0.0; 7]), 0.0);
    }
}
