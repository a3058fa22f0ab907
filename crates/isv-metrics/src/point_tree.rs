//! Nearest neighbours in a fixed set of points.

use glam::DVec3;

/// Ranges of at most this many points are searched one by one.
const LEAF_SIZE: usize = 8;

/// Ranges of at least this many points are built by two threads.
const PARALLEL_SIZE: usize = 8192;

/// A balanced k-d tree without pointers: the middle point of a range splits it along an axis, the points before it
/// make one child and those behind it the other, down to [`LEAF_SIZE`].
///
/// Our own and not a crate's, because samples of flat walls share one coordinate by the thousand, which bucket trees
/// refuse or degenerate on; splitting by rank does not mind.
pub(crate) struct PointTree {
    points: Vec<DVec3>,
    /// For the middle point of a range, the axis it splits along; unused elsewhere.
    axes: Vec<u8>,
}

impl PointTree {
    pub(crate) fn new(mut points: Vec<DVec3>) -> Self {
        let mut axes = vec![0; points.len()];
        build(&mut points, &mut axes);
        Self { points, axes }
    }

    /// The points, in an order in which neighbours in the list lie near each other.
    pub(crate) fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Square of the distance from `p` to the nearest point; infinite in an empty tree.
    pub(crate) fn nearest_sq(&self, p: DVec3) -> f64 {
        let mut best_sq = f64::INFINITY;
        self.search(0, self.points.len(), p, &mut best_sq);
        best_sq
    }

    fn search(&self, start: usize, end: usize, p: DVec3, best_sq: &mut f64) {
        if end - start <= LEAF_SIZE {
            for point in &self.points[start..end] {
                *best_sq = best_sq.min(point.distance_squared(p));
            }
            return;
        }
        let middle = start.midpoint(end);
        let pivot = self.points[middle];
        *best_sq = best_sq.min(pivot.distance_squared(p));
        let axis = usize::from(self.axes[middle]);
        let beyond = p[axis] - pivot[axis];
        let (before, behind) = ((start, middle), (middle + 1, end));
        let (near, far) = if beyond < 0.0 { (before, behind) } else { (behind, before) };
        self.search(near.0, near.1, p, best_sq);
        if beyond * beyond < *best_sq {
            self.search(far.0, far.1, p, best_sq);
        }
    }
}

/// Sorts a range into tree order. The depth is the logarithm of its length, whatever the points.
fn build(points: &mut [DVec3], axes: &mut [u8]) {
    if points.len() <= LEAF_SIZE {
        return;
    }
    let (lo, hi) = points.iter().fold((points[0], points[0]), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    let axis = (hi - lo).max_position();
    let middle = points.len() / 2;
    let (before, _, behind) = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    let (axes_before, rest) = axes.split_at_mut(middle);
    let (here, axes_behind) = rest.split_at_mut(1);
    here[0] = axis as u8;
    if before.len() >= PARALLEL_SIZE {
        rayon::join(|| build(before, axes_before), || build(behind, axes_behind));
    } else {
        build(before, axes_before);
        build(behind, axes_behind);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    fn cloud(seed: u64, count: usize, scale: DVec3) -> Vec<DVec3> {
        let mut random = SplitMix64::new(seed);
        (0..count)
            .map(|_| DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) * scale)
            .collect()
    }

    #[test]
    fn finds_exactly_what_brute_force_finds() {
        for (count, scale) in
            [(1, DVec3::ONE), (9, DVec3::ONE), (300, DVec3::ONE), (20_000, DVec3::new(1.0, 0.0, 3.0))]
        {
            let points = cloud(4, count, scale);
            let tree = PointTree::new(points.clone());
            for p in cloud(5, 200, DVec3::splat(1.5)) {
                let expected = points.iter().map(|q| q.distance_squared(p)).fold(f64::INFINITY, f64::min);
                assert_eq!(tree.nearest_sq(p), expected, "{count} points, {p}");
            }
        }
    }

    #[test]
    fn equal_points_make_no_deep_tree() {
        let tree = PointTree::new(vec![DVec3::ONE; 100_000]);
        assert_eq!(tree.nearest_sq(DVec3::ZERO), 3.0);
        assert_eq!(tree.points().len(), 100_000);
    }

    #[test]
    fn an_empty_tree_is_infinitely_far() {
        assert_eq!(PointTree::new(Vec::new()).nearest_sq(DVec3::ZERO), f64::INFINITY);
    }
}
