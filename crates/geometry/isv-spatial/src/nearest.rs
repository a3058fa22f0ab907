//! The nearest points to each of many places.

use crate::PointTree;
use glam::DVec3;
use rayon::prelude::*;

/// Places searched by one thread; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 1024;

/// Most equally near points that are told of one place. These are enough for all neighbours on a lattice of
/// voxels. They are few enough to keep memory proportional to the number of places, wherever the points lie.
pub const MAX_TIES: usize = 30;

/// For each of many places the nearest points of a [`PointTree`].
#[derive(Clone, Debug, Default)]
pub struct NearestPoints {
    distances_sq: Vec<f64>,
    /// The nearest points of all places, one place after the other.
    points: Vec<u32>,
    /// For each place where its nearest points end.
    ends: Vec<usize>,
}

impl NearestPoints {
    /// For each place the square of the distance to its nearest point.
    #[must_use]
    pub fn distances_sq(&self) -> &[f64] {
        &self.distances_sq
    }

    /// The points nearest to a place, as indices of [`PointTree::points`] in rising order: one, or up to [`MAX_TIES`] that
    /// are exactly as near.
    #[must_use]
    pub fn of(&self, place: usize) -> &[u32] {
        let start = if place == 0 { 0 } else { self.ends[place - 1] };
        &self.points[start..self.ends[place]]
    }

    fn append(&mut self, other: &Self) {
        let offset = self.points.len();
        self.distances_sq.extend_from_slice(&other.distances_sq);
        self.points.extend_from_slice(&other.points);
        self.ends.extend(other.ends.iter().map(|end| offset + end));
    }
}

impl PointTree {
    /// Nearest points to each place. It is fastest where places that follow each other lie near each other,
    /// as those of [`PointTree::points`] do. Each search starts from what the one before it found.
    ///
    /// # Panics
    /// If the tree is empty and there are places.
    #[must_use]
    pub fn nearest_to_each(&self, places: &[DVec3]) -> NearestPoints {
        let chunks: Vec<_> = places.par_chunks(CHUNK).map(|chunk| self.nearest_in_turn(chunk)).collect();
        let mut all = NearestPoints::default();
        chunks.iter().for_each(|chunk| all.append(chunk));
        all
    }

    fn nearest_in_turn(&self, places: &[DVec3]) -> NearestPoints {
        let mut found = NearestPoints::default();
        let mut ties = Vec::new();
        let mut guess = 0;
        for place in places {
            found.distances_sq.push(self.nearest_ties(*place, guess, &mut ties));
            guess = ties[0] as usize;
            found.points.extend_from_slice(&ties);
            found.ends.push(found.points.len());
        }
        found
    }

    /// Fills `ties` with the points nearest to `p`, and returns the square of their distance. A point near them makes a
    /// good `guess`, any other a slow one.
    fn nearest_ties(&self, p: DVec3, guess: usize, ties: &mut Vec<u32>) -> f64 {
        ties.clear();
        // The guess itself is met again, as nothing at this distance is passed over.
        let mut best_sq = self.points()[guess].distance_squared(p);
        self.visit(p, best_sq, &mut |point, at| {
            let distance_sq = point.distance_squared(p);
            if distance_sq < best_sq {
                best_sq = distance_sq;
                ties.clear();
            }
            if distance_sq == best_sq && ties.len() < MAX_TIES {
                ties.push(at as u32);
            }
            if ties.len() < MAX_TIES { best_sq } else { best_sq.next_down() }
        });
        ties.sort_unstable();
        best_sq
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::Random;

    /// Brute force: every point at the smallest distance.
    fn slow(tree: &PointTree, p: DVec3) -> (f64, Vec<u32>) {
        let distances: Vec<f64> = tree.points().iter().map(|q| q.distance_squared(p)).collect();
        let best = distances.iter().copied().fold(f64::INFINITY, f64::min);
        (best, (0..).zip(&distances).filter(|(_, d)| **d == best).map(|(i, _)| i).collect())
    }

    fn assert_agrees(points: Vec<DVec3>, places: &[DVec3]) {
        let tree = PointTree::new(points);
        let found = tree.nearest_to_each(places);
        for (i, place) in places.iter().enumerate() {
            let (distance_sq, ties) = slow(&tree, *place);
            assert_eq!(found.distances_sq()[i], distance_sq, "{place}");
            assert_eq!(found.of(i), ties, "{place}");
        }
    }

    #[test]
    fn finds_what_brute_force_finds_among_random_points() {
        let mut random = Random::new(8);
        for count in [1, 9, 300, 3000] {
            let points = (0..count).map(|_| random.point() * DVec3::new(1.0, 0.01, 2.0)).collect();
            let places: Vec<_> = (0..2 * CHUNK).map(|_| random.point() * 1.5).collect();
            assert_agrees(points, &places);
        }
    }

    #[test]
    fn finds_every_tie_on_a_lattice() {
        let lattice = |n: i32, step: f64| -> Vec<DVec3> {
            let axis = |i: i32, k: i32| f64::from(i / n.pow(k as u32) % n) * step;
            (0..n.pow(3)).map(|i| DVec3::new(axis(i, 0), axis(i, 1), axis(i, 2))).collect()
        };
        assert_agrees(lattice(9, 1.0), &lattice(17, 0.5));
    }

    #[test]
    fn ties_without_end_are_cut() {
        let tree = PointTree::new(vec![DVec3::ONE; 50_000]);
        let found = tree.nearest_to_each(&[DVec3::ZERO; 3000]);
        assert!((0..3000).all(|i| found.of(i).len() == MAX_TIES && found.distances_sq()[i] == 3.0));
    }
}
