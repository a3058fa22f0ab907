//! The symmetric Chamfer distance of Eq. 15.

use crate::SplitMix64;
use crate::mean::mean;
use crate::sampling::draw;
use glam::DVec3;
use isv_spatial::{NearestPoints, PointTree};
use isv_volume::TriangleMesh;

/// Chamfer distance, Eq. 15 of the paper, in metres. It is half the mean distance from a point of `p` to its
/// nearest in `q`, plus half the reverse.
///
/// # Panics
/// If one of the sets is empty.
#[must_use]
pub fn chamfer(p: &[DVec3], q: &[DVec3]) -> f64 {
    chamfer_of_trees(&PointTree::new(p.to_vec()), &PointTree::new(q.to_vec()))
}

/// What [`chamfer`] would say of a mesh against itself, in metres: Eq. 15 between two samplings with
/// different seeds. This is the part of a Chamfer distance that sampling alone makes.
///
/// # Panics
/// As [`sample_surface`](crate::sample_surface).
#[must_use]
pub fn chamfer_floor(mesh: &TriangleMesh, spacing_m: f64, seed: u64) -> f64 {
    let sampling = |seed| PointTree::new(draw(mesh, spacing_m, seed).map(|drawn| drawn.point).collect());
    chamfer_of_trees(&sampling(seed), &sampling(second_seed(seed)))
}

/// Seed of the second of two samplings that must have nothing in common.
pub(crate) fn second_seed(seed: u64) -> u64 {
    SplitMix64::new(seed).next_u64()
}

fn chamfer_of_trees(p: &PointTree, q: &PointTree) -> f64 {
    assert!(!p.points().is_empty() && !q.points().is_empty(), "Eq. 15 is a mean over points");
    chamfer_of_nearest(&q.nearest_to_each(p.points()), &p.nearest_to_each(q.points()))
}

/// Eq. 15 from what is nearest to each point of either set in the other.
pub(crate) fn chamfer_of_nearest(there: &NearestPoints, back: &NearestPoints) -> f64 {
    let [there, back] = [there, back].map(|nearest| {
        let distances_sq = nearest.distances_sq();
        mean(distances_sq.len(), |i| distances_sq[i].sqrt())
    });
    (there + back) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_sets_have_known_distances() {
        let o = DVec3::ZERO;
        assert_eq!(chamfer(&[o], &[DVec3::new(3.0, 4.0, 0.0)]), 5.0);
        // From p: 0 and 2, mean 1. From q: 0. Halves: 0.5.
        assert_eq!(chamfer(&[o, DVec3::X * 2.0], &[o]), 0.5);
        // From p: 1. From q: 1, 3 and 5, mean 3. Halves: 2.
        assert_eq!(chamfer(&[o], &[DVec3::X, DVec3::Y * 3.0, DVec3::Z * -5.0]), 2.0);
        assert_eq!(chamfer(&[o, DVec3::X], &[DVec3::X, o]), 0.0);
    }

    #[test]
    fn parallel_lattices_are_their_gap_apart() {
        let lattice = |z: f64| {
            (0..2500).map(|i| DVec3::new(f64::from(i % 50), f64::from(i / 50), z)).collect::<Vec<_>>()
        };
        assert!((chamfer(&lattice(0.0), &lattice(0.25)) - 0.25).abs() < 1e-15);
    }
}
