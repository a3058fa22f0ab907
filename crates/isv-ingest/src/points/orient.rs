//! Which way normals point.

use glam::DVec3;
use rayon::prelude::*;

/// Neighbours of each point, itself among them, that its normal is compared with.
pub(crate) const NEIGHBOURS: usize = 9;

/// The nearest points of a point; none where there are fewer.
pub(crate) type Neighbours = [Option<u32>; NEIGHBOURS];

/// Turns normals towards a point.
pub(crate) fn orient_towards(viewpoint: DVec3, positions: &[DVec3], normals: &mut [DVec3]) {
    for (normal, p) in normals.iter_mut().zip(positions) {
        if normal.dot(viewpoint - p) < 0.0 {
            *normal = -*normal;
        }
    }
}

/// Makes the normals of neighbours point to the same side wherever they can, starting with those that are most nearly
/// parallel (Hoppe et al. 1992), and the outermost ones of each connected part outward. Gives the share of the points in parts whose
/// outermost points do not agree on what is outward, as those of a closed body do.
pub(crate) fn orient_consistently(
    positions: &[DVec3],
    neighbours: &[Neighbours],
    normals: &mut [DVec3],
) -> f64 {
    /// Sum over six directions of how far outward the outermost normals look, from which on a part is sure: a closed body has 5 or more.
    const SURE: f64 = 3.0;
    let mut parts = Parts::new(positions.len());
    for Edge { from, to, .. } in edges(neighbours, normals) {
        let turned = normals[from as usize].dot(normals[to as usize]) < 0.0;
        parts.join(from, to, turned);
    }
    for (i, normal) in normals.iter_mut().enumerate() {
        if parts.root(i as u32).1 {
            *normal = -*normal;
        }
    }
    let outward = parts.outward(positions, normals);
    let mut doubtful = 0;
    for (i, normal) in normals.iter_mut().enumerate() {
        let outward = outward[parts.root(i as u32).0 as usize];
        if outward < 0.0 {
            *normal = -*normal;
        }
        doubtful += usize::from(outward.abs() < SURE);
    }
    doubtful as f64 / normals.len().max(1) as f64
}

/// Two neighbours; ordered by how far from parallel their normals are.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    /// Bits of a number that is not negative, which are in the order of the numbers.
    bend: u32,
    from: u32,
    to: u32,
}

/// All pairs of neighbours that both have a normal, the most nearly parallel first.
fn edges(neighbours: &[Neighbours], normals: &[DVec3]) -> Vec<Edge> {
    let mut edges: Vec<Edge> = neighbours
        .par_iter()
        .zip(0..neighbours.len() as u32)
        .flat_map_iter(|(list, from)| {
            let n = normals[from as usize];
            list.iter().flatten().filter(move |to| **to != from).filter_map(move |to| {
                let m = normals[*to as usize];
                let bend = ((1.0 - n.dot(m).abs()).max(0.0) as f32).to_bits();
                let known = n != DVec3::ZERO && m != DVec3::ZERO;
                known.then_some(Edge { bend, from: from.min(*to), to: from.max(*to) })
            })
        })
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    edges
}

/// Disjoint sets of points, each point knowing whether it is turned against the first of its set.
struct Parts {
    parents: Vec<u32>,
    turned: Vec<bool>,
}

impl Parts {
    fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect(), turned: vec![false; count] }
    }

    /// The first point of a point's set, and whether the point is turned against it.
    fn root(&mut self, point: u32) -> (u32, bool) {
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
    fn join(&mut self, a: u32, b: u32, turned: bool) {
        let ((a, a_turned), (b, b_turned)) = (self.root(a), self.root(b));
        if a != b {
            let (first, last) = (a.min(b), a.max(b));
            self.parents[last as usize] = first;
            self.turned[last as usize] = turned ^ a_turned ^ b_turned;
        }
    }

    /// For the first point of each set how far outward the normals of the set's outermost points along the axes look, -6 to 6.
    fn outward(&mut self, positions: &[DVec3], normals: &[DVec3]) -> Vec<f64> {
        const DIRECTIONS: [DVec3; 6] =
            [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut outermost: Vec<[u32; 6]> = (0..positions.len() as u32).map(|i| [i; 6]).collect();
        for i in 0..positions.len() as u32 {
            let root = self.root(i).0 as usize;
            for (slot, direction) in DIRECTIONS.iter().enumerate() {
                let farthest = &mut outermost[root][slot];
                if positions[i as usize].dot(*direction) > positions[*farthest as usize].dot(*direction) {
                    *farthest = i;
                }
            }
        }
        let outward = |points: &[u32; 6]| -> f64 {
            points.iter().zip(DIRECTIONS).map(|(i, direction)| normals[*i as usize].dot(direction)).sum()
        };
        outermost.iter().map(outward).collect()
    }
}
