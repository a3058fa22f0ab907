//! Nearest neighbours in a fixed set of points.

use crate::nearest::MAX_TIES;
use glam::DVec3;

/// Ranges of at most this many points are searched one by one.
const LEAF_SIZE: usize = 8;

/// Ranges of at least this many points are built by two threads.
const PARALLEL_SIZE: usize = 8192;

/// A balanced k-d tree without pointers. The middle point of a range splits it along an axis. The points
/// before it make one child and those behind it the other, down to `LEAF_SIZE`.
///
/// The tree is our own and not a crate's. Samples of flat walls share one coordinate by the thousand, which
/// bucket trees refuse or degenerate on; splitting by rank does not mind.
#[derive(Clone, Debug)]
pub struct PointTree {
    points: Vec<DVec3>,
    /// For each point its place in the list that the tree was made from.
    origins: Vec<u32>,
    /// For the middle point of a range, the axis it splits along; unused elsewhere.
    axes: Vec<u8>,
    /// Smallest and largest corner of the box around all points.
    bounds: (DVec3, DVec3),
}

/// A neighbour found by [`PointTree::k_nearest`].
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Neighbour {
    /// Square of the distance.
    pub distance_sq: f64,
    /// Place of the point in the list that the tree was made from.
    pub index: u32,
}

impl PointTree {
    /// A tree of finite points, at most `u32::MAX` of them.
    #[must_use]
    pub fn new(points: Vec<DVec3>) -> Self {
        let mut nodes: Vec<Node> = points.into_iter().zip(0..).collect();
        let mut axes = vec![0; nodes.len()];
        build(&mut nodes, &mut axes);
        let (points, origins): (Vec<DVec3>, _) = nodes.into_iter().unzip();
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let bounds = points.iter().fold(empty, |(low, high), p| (low.min(*p), high.max(*p)));
        Self { points, origins, axes, bounds }
    }

    /// The points, in an order in which neighbours in the list lie near each other.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// For each of [`Self::points`] its place in the list that the tree was made from.
    #[must_use]
    pub fn origins(&self) -> &[u32] {
        &self.origins
    }

    /// Square of the distance from `p` to the nearest point; infinite in an empty tree.
    #[must_use]
    pub fn nearest_sq(&self, p: DVec3) -> f64 {
        let mut best_sq = f64::INFINITY;
        self.visit(p, f64::INFINITY, &mut |point, _| {
            best_sq = best_sq.min(point.distance_squared(p));
            best_sq
        });
        best_sq
    }

    /// The `k` points nearest to `p`, nearest first, or all points if there are fewer. Among equals the one
    /// comes first that came first in the list that the tree was made from. `found` is cleared and filled.
    ///
    /// If more than [`MAX_TIES`] points that are exactly as far as the last one are left over, only so many
    /// are compared. The last ones may then not be the first in the list, but always are the same ones.
    pub fn k_nearest(&self, p: DVec3, k: usize, found: &mut Vec<Neighbour>) {
        found.clear();
        if k == 0 {
            return;
        }
        let mut search = Search { k, found, left_over: 0 };
        self.visit(p, f64::INFINITY, &mut |point, at| {
            search.add(Neighbour { distance_sq: point.distance_squared(p), index: self.origins[at] })
        });
    }

    /// Shows `look` each point, with its place in the tree's order, that may lie within a squared radius. The
    /// radius is what `look` returned last, and `within_sq` before.
    pub(crate) fn visit(&self, p: DVec3, within_sq: f64, look: &mut impl FnMut(DVec3, usize) -> f64) {
        // For a place outside the box: what lies far from it along one axis can only be ruled out along the others.
        let beyond = (self.bounds.0 - p).max(p - self.bounds.1).max(DVec3::ZERO);
        self.visit_range(0, self.points.len(), p, within_sq, (beyond * beyond).to_array(), look);
    }

    /// Visits a range of the tree's order, all of whose points are at least `beyond_sq` (squared, along each
    /// axis) from `p`. Returns what `look` returned last.
    fn visit_range(
        &self,
        start: usize,
        end: usize,
        p: DVec3,
        mut within_sq: f64,
        mut beyond_sq: [f64; 3],
        look: &mut impl FnMut(DVec3, usize) -> f64,
    ) -> f64 {
        if end - start <= LEAF_SIZE {
            for at in start..end {
                within_sq = look(self.points[at], at);
            }
            return within_sq;
        }
        let middle = start.midpoint(end);
        let pivot = self.points[middle];
        let axis = usize::from(self.axes[middle]);
        let beyond = p[axis] - pivot[axis];
        let (before, behind) = ((start, middle), (middle + 1, end));
        let (near, far) = if beyond < 0.0 { (before, behind) } else { (behind, before) };
        within_sq = self.visit_range(near.0, near.1, p, within_sq, beyond_sq, look);
        within_sq = within_sq.min(look(pivot, middle));
        beyond_sq[axis] = beyond_sq[axis].max(beyond * beyond);
        // Added in the order in which distances are, so that rounding cannot hide a point at exactly the radius.
        if beyond_sq[0] + beyond_sq[1] + beyond_sq[2] <= within_sq {
            within_sq = self.visit_range(far.0, far.1, p, within_sq, beyond_sq, look);
        }
        within_sq
    }
}

/// A search for the nearest points.
struct Search<'a> {
    /// How many are looked for.
    k: usize,
    /// Points found so far, nearest first.
    found: &'a mut Vec<Neighbour>,
    /// How many points were met that are as far as the last of those found, but too many.
    left_over: usize,
}

impl Search<'_> {
    /// Takes note of a point; returns the square of the distance up to which others are to be shown.
    fn add(&mut self, new: Neighbour) -> f64 {
        let is_before = |n: &Neighbour| (n.distance_sq, n.index) < (new.distance_sq, new.index);
        let last_before = self.found.get(self.k - 1).copied();
        if last_before.as_ref().is_none_or(|last| !is_before(last)) {
            self.found.truncate(self.k - 1);
            self.found.insert(self.found.partition_point(is_before), new);
        }
        let Some(last) = self.found.get(self.k - 1) else { return f64::INFINITY };
        match last_before {
            Some(before) if before.distance_sq > last.distance_sq => self.left_over = 0,
            Some(_) if new.distance_sq <= last.distance_sq => self.left_over += 1,
            _ => {}
        }
        // Without an end, a search among equal points would meet all of them, and one from each would take the square of their number.
        if self.left_over <= MAX_TIES { last.distance_sq } else { last.distance_sq.next_down() }
    }
}

/// A point and its place in the list that the tree is made from.
type Node = (DVec3, u32);

/// Sorts a range into tree order. The depth is the logarithm of its length, whatever the points.
fn build(nodes: &mut [Node], axes: &mut [u8]) {
    if nodes.len() <= LEAF_SIZE {
        return;
    }
    let first = nodes[0].0;
    let (lo, hi) = nodes.iter().fold((first, first), |(lo, hi), (p, _)| (lo.min(*p), hi.max(*p)));
    let axis = (hi - lo).max_position();
    let middle = nodes.len() / 2;
    let (before, _, behind) = nodes.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
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
    use isv_testkit::Random;

    fn cloud(seed: u64, count: usize, scale: DVec3) -> Vec<DVec3> {
        let mut random = Random::new(seed);
        (0..count).map(|_| random.point() * scale).collect()
    }

    #[test]
    fn finds_exactly_what_brute_force_finds() {
        for (count, scale) in
            [(1, DVec3::ONE), (9, DVec3::ONE), (300, DVec3::ONE), (20_000, DVec3::new(1.0, 0.0, 3.0))]
        {
            let points = cloud(4, count, scale);
            let tree = PointTree::new(points.clone());
            let mut found = Vec::new();
            for p in cloud(5, 200, DVec3::splat(1.5)) {
                let mut all: Vec<Neighbour> = points
                    .iter()
                    .zip(0..)
                    .map(|(q, index)| Neighbour { distance_sq: q.distance_squared(p), index })
                    .collect();
                all.sort_by(|a, b| a.partial_cmp(b).unwrap());
                tree.k_nearest(p, 7, &mut found);
                assert_eq!(found, all[..count.min(7)], "{count} points, {p}");
                assert_eq!(tree.nearest_sq(p), all[0].distance_sq);
            }
        }
    }

    #[test]
    fn few_equal_points_come_in_order() {
        let tree = PointTree::new(vec![DVec3::ONE; MAX_TIES + 3]);
        let mut found = Vec::new();
        tree.k_nearest(DVec3::ZERO, 3, &mut found);
        assert_eq!(found, [0, 1, 2].map(|index| Neighbour { distance_sq: 3.0, index }));
    }

    #[test]
    fn equal_points_make_no_deep_tree_and_are_not_all_met() {
        let tree = PointTree::new(vec![DVec3::ONE; 100_000]);
        assert_eq!(tree.nearest_sq(DVec3::ZERO), 3.0);
        assert_eq!(tree.points().len(), 100_000);
        for p in [DVec3::ZERO, DVec3::ONE] {
            let (mut found, mut met) = (Vec::new(), 0);
            let mut search = Search { k: 7, found: &mut found, left_over: 0 };
            tree.visit(p, f64::INFINITY, &mut |point, at| {
                met += 1;
                search.add(Neighbour { distance_sq: point.distance_squared(p), index: at as u32 })
            });
            assert_eq!(found.len(), 7);
            assert!(met < 100, "{met} points");
        }
    }

    #[test]
    fn an_empty_tree_is_infinitely_far() {
        let tree = PointTree::new(Vec::new());
        assert_eq!(tree.nearest_sq(DVec3::ZERO), f64::INFINITY);
        let mut found = Vec::new();
        tree.k_nearest(DVec3::ZERO, 3, &mut found);
        assert!(found.is_empty());
    }
}
