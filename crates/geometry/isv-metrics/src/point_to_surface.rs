//! Exact distances from samples to triangles, in both directions.

use glam::DVec3;
use isv_spatial::Bvh;
use rayon::prelude::*;

/// Distance of each point to the nearest point of a surface, in metres.
#[must_use]
pub fn distances_to_surface(points: &[DVec3], surface: &Bvh) -> Vec<f64> {
    surface.closest_to_each(points).iter().map(|closest| closest.distance_sq.sqrt()).collect()
}

/// Statistics of the distances from points to a surface, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectedDistances {
    /// Their mean.
    pub mean: f64,
    /// Square root of the mean of their squares.
    pub rms: f64,
    /// The smallest of them that 99 % do not exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

impl DirectedDistances {
    /// Summarises distances, in any order.
    ///
    /// # Panics
    /// If there are none.
    #[must_use]
    pub fn new(mut distances: Vec<f64>) -> Self {
        // In order for the percentile; the sums below gain precision from it.
        distances.par_sort_unstable_by(f64::total_cmp);
        Self::of_sorted(&distances)
    }

    fn of_sorted(distances: &[f64]) -> Self {
        assert!(!distances.is_empty(), "no mean without samples");
        let count = distances.len() as f64;
        Self {
            mean: distances.iter().sum::<f64>() / count,
            rms: (distances.iter().map(|x| x * x).sum::<f64>() / count).sqrt(),
            p99: distances[(distances.len() * 99).div_ceil(100) - 1],
            max: distances[distances.len() - 1],
        }
    }
}

/// Statistics of the distances between two surfaces, in metres. The two directions weigh half each, however many
/// samples they have, so that a test surface with stray parts cannot outvote the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDistances {
    /// From the reference to the test surface: large where the test surface misses something.
    pub ref_to_test: DirectedDistances,
    /// From the test surface to the reference: large where it has something that is not there.
    pub test_to_ref: DirectedDistances,
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
        ref_to_test.par_sort_unstable_by(f64::total_cmp);
        test_to_ref.par_sort_unstable_by(f64::total_cmp);
        let [there, back] = [&ref_to_test, &test_to_ref].map(|d| DirectedDistances::of_sorted(d));
        Self {
            ref_to_test: there,
            test_to_ref: back,
            mean: (there.mean + back.mean) / 2.0,
            rms: ((there.rms * there.rms + back.rms * back.rms) / 2.0).sqrt(),
            p99: percentile_99(&ref_to_test, &test_to_ref),
            hausdorff: there.max.max(back.max),
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
        assert_eq!((s.ref_to_test.mean, s.test_to_ref.mean, s.mean), (1.0, 4.0, 2.5));
        assert_eq!(s.ref_to_test, DirectedDistances { mean: 1.0, rms: 1.0, p99: 1.0, max: 1.0 });
        assert!((s.test_to_ref.rms - (50.0 / 3.0f64).sqrt()).abs() < 1e-15);
        assert!((s.rms - ((1.0 + 50.0 / 3.0) / 2.0f64).sqrt()).abs() < 1e-15);
        assert_eq!((s.p99, s.hausdorff), (5.0, 5.0));
    }

    #[test]
    fn the_percentile_is_the_first_value_that_99_of_100_do_not_exceed() {
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(percentile_99(&hundred, &hundred), 99.0);
        assert_eq!(DirectedDistances::new(hundred.iter().rev().copied().collect()).p99, 99.0);
        assert_eq!(DirectedDistances::new((1..=101).map(f64::from).collect()).p99, 100.0);
        assert_eq!(percentile_99(&hundred, &[0.0]), 98.0);
        assert_eq!(percentile_99(&[2.0], &[1.0]), 2.0);
        assert_eq!(percentile_99(&[0.0], &[0.0; 7]), 0.0);
    }
}
