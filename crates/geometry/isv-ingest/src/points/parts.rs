//! Disjoint sets of points with sides.

use rustc_hash::FxHashMap;

/// Disjoint sets of points, each point knowing whether it is turned against the first of its set.
#[derive(Clone)]
pub(crate) struct Parts {
    parents: Vec<u32>,
    turned: Vec<bool>,
}

impl Parts {
    /// Every point by itself.
    pub(crate) fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect(), turned: vec![false; count] }
    }

    /// The first point of a point's set, and whether the point is turned against it.
    pub(crate) fn root(&mut self, point: u32) -> (u32, bool) {
        let (mut root, mut turned) = (point, false);
        while self.parents[root as usize] != root {
            turned ^= self.turned[root as usize];
            root = self.parents[root as usize];
        }
        let (mut at, mut rest) = (point, turned);
        while self.parents[at as usize] != root && at != root {
            let next = self.parents[at as usize];
            let step = self.turned[at as usize];
            (self.parents[at as usize], self.turned[at as usize]) = (root, rest);
            rest ^= step;
            at = next;
        }
        (root, turned)
    }

    /// Joins the sets of two points whose normals point to one side, or to different ones if `turned`.
    pub(crate) fn join(&mut self, a: u32, b: u32, turned: bool) {
        let ((a, a_turned), (b, b_turned)) = (self.root(a), self.root(b));
        if a != b {
            let (first, last) = (a.min(b), a.max(b));
            self.parents[last as usize] = first;
            self.turned[last as usize] = turned ^ a_turned ^ b_turned;
        }
    }

    /// Points by their sets, each with whether it is turned; sets in the order of their first points here.
    pub(crate) fn groups(&mut self, points: &[u32]) -> Vec<Vec<(u32, bool)>> {
        let mut numbers: FxHashMap<u32, usize> = FxHashMap::default();
        let mut groups: Vec<Vec<(u32, bool)>> = Vec::new();
        for point in points {
            let (root, turned) = self.root(*point);
            let number = *numbers.entry(root).or_insert(groups.len());
            if number == groups.len() {
                groups.push(Vec::new());
            }
            groups[number].push((*point, turned));
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_go_along_with_sets() {
        let mut parts = Parts::new(5);
        parts.join(3, 4, true);
        parts.join(1, 2, false);
        parts.join(4, 2, true);
        // Joined already: the first word counts.
        parts.join(3, 1, true);
        let sides: Vec<_> = (0..5).map(|point| parts.root(point)).collect();
        assert_eq!(sides, [(0, false), (1, false), (1, false), (1, false), (1, true)]);
        let groups = parts.groups(&[4, 0, 3]);
        assert_eq!(groups, [vec![(4, true), (3, false)], vec![(0, false)]]);
    }
}
