//! Closest point on a mesh. Rays are in `ray.rs`.

use crate::closest::{Feature, closest_on_triangle};
use crate::tree::{Content, MAX_DEPTH, Node, Tree};
use glam::DVec3;
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// Triangles a leaf: fewer make the tree deeper, more waste distance tests.
const LEAF_SIZE: usize = 4;

/// Points searched for by one thread; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 256;

/// The closest point of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Index of a triangle the point lies on.
    pub triangle: u32,
    /// The point, in metres.
    pub point: DVec3,
    /// Square of its distance, in square metres.
    pub distance_sq: f64,
    /// The part of the triangle the point lies on.
    pub feature: Feature,
}

/// A bounding-volume hierarchy that answers closest-point and ray queries on a copy of a mesh's triangles.
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    /// Corners of the triangles in leaf order.
    pub(crate) corners: Vec<[DVec3; 3]>,
    /// Leaf order to triangle index.
    pub(crate) faces: Vec<u32>,
}

impl Bvh {
    /// Builds the hierarchy.
    ///
    /// # Panics
    /// If the mesh has no triangles or names vertices that are not there ([`TriangleMesh::validate`] tells).
    #[must_use]
    pub fn new(mesh: &TriangleMesh) -> Self {
        let Tree { nodes, order } = Tree::build(mesh, LEAF_SIZE);
        let corners = order.iter().map(|face| mesh.corners(*face as usize)).collect();
        Self { nodes, corners, faces: order }
    }

    /// The point of the mesh closest to `p`, exact up to rounding.
    ///
    /// Where several triangles are equally close (a shared edge or corner), which of them is reported is arbitrary
    /// but always the same.
    #[must_use]
    pub fn closest_point(&self, p: DVec3) -> Closest {
        self.closest_after(p, 0).0
    }

    /// Distance of `p` to the mesh, in metres.
    #[must_use]
    pub fn distance(&self, p: DVec3) -> f64 {
        self.closest_point(p).distance_sq.sqrt()
    }

    /// Closest points as by [`Self::closest_point`], for each of many points. It is fastest where points that
    /// follow each other lie near each other: each search starts from what the one before it found. Which of
    /// equally close triangles is reported depends on that.
    #[must_use]
    pub fn closest_to_each(&self, points: &[DVec3]) -> Vec<Closest> {
        let in_turn = |chunk: &[DVec3]| {
            let mut slot = 0;
            let search = |p: &DVec3| {
                let closest;
                (closest, slot) = self.closest_after(*p, slot);
                closest
            };
            chunk.iter().map(search).collect::<Vec<_>>()
        };
        points.par_chunks(CHUNK).flat_map_iter(in_turn).collect()
    }

    /// Closest point, if the mesh comes closer to `p` than `max_distance` metres.
    #[must_use]
    pub fn closest_within(&self, p: DVec3, max_distance: f64) -> Option<Closest> {
        let mut best = None;
        self.search(p, max_distance * max_distance, &mut best);
        best.map(|(closest, _)| closest)
    }

    /// The closest point, and the slot of its triangle in leaf order, looked for from another slot.
    fn closest_after(&self, p: DVec3, slot: usize) -> (Closest, usize) {
        let first = self.closest_in(slot, p);
        let mut best = Some((first, slot));
        self.search(p, first.distance_sq, &mut best);
        best.unwrap_or((first, slot))
    }

    /// The closest point of the triangle in a slot.
    fn closest_in(&self, slot: usize, p: DVec3) -> Closest {
        let (point, feature) = closest_on_triangle(p, &self.corners[slot]);
        Closest { triangle: self.faces[slot], point, distance_sq: point.distance_squared(p), feature }
    }

    /// Puts what is closer than `best_sq`, and its slot, into `best`: depth-first, nearer child first, skipping boxes that
    /// are farther than what was found.
    fn search(&self, p: DVec3, mut best_sq: f64, best: &mut Option<(Closest, usize)>) {
        let mut stack = [(0usize, 0f64); MAX_DEPTH + 1];
        stack[0].1 = box_distance_sq(&self.nodes[0], p);
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (mut index, bound) = stack[depth];
            if bound >= best_sq {
                continue;
            }
            while let Content::Inner(a, b) = self.nodes[index].content(index) {
                let (near, far) = self.order_children(a, b, p);
                if far.1 < best_sq {
                    stack[depth] = far;
                    depth += 1;
                }
                index = near.0;
                if near.1 >= best_sq {
                    break;
                }
            }
            if let Content::Leaf(range) = self.nodes[index].content(index) {
                self.search_leaf(range, p, &mut best_sq, best);
            }
        }
    }

    /// Both children with the square of their box's distance, nearer first.
    fn order_children(&self, a: usize, b: usize, p: DVec3) -> ((usize, f64), (usize, f64)) {
        let (to_a, to_b) = (box_distance_sq(&self.nodes[a], p), box_distance_sq(&self.nodes[b], p));
        if to_a <= to_b { ((a, to_a), (b, to_b)) } else { ((b, to_b), (a, to_a)) }
    }

    fn search_leaf(
        &self,
        range: std::ops::Range<usize>,
        p: DVec3,
        best_sq: &mut f64,
        best: &mut Option<(Closest, usize)>,
    ) {
        for slot in range {
            let closest = self.closest_in(slot, p);
            if closest.distance_sq < *best_sq {
                *best_sq = closest.distance_sq;
                *best = Some((closest, slot));
            }
        }
    }
}

fn box_distance_sq(node: &Node, p: DVec3) -> f64 {
    (node.lo - p).max(p - node.hi).max(DVec3::ZERO).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{Random, soup, sphere};

    fn brute_force(mesh: &TriangleMesh, p: DVec3) -> f64 {
        (0..mesh.triangles.len())
            .map(|face| closest_on_triangle(p, &mesh.corners(face)).0.distance_squared(p))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn finds_what_brute_force_finds() {
        for mesh in [soup(1, 700), soup(2, 1), soup(5, 6), sphere(0.7, 16)] {
            let bvh = Bvh::new(&mesh);
            let mut random = Random::new(21);
            for _ in 0..500 {
                let p = random.point() * 2.0;
                let found = bvh.closest_point(p);
                assert_eq!(found.distance_sq, brute_force(&mesh, p), "{p}");
                assert_eq!(found.point.distance_squared(p), found.distance_sq);
                let corners = mesh.corners(found.triangle as usize);
                assert_eq!(closest_on_triangle(p, &corners), (found.point, found.feature));
            }
        }
    }

    #[test]
    fn many_points_at_once_are_as_close_as_one_by_one() {
        let bvh = Bvh::new(&soup(9, 2000));
        let mut random = Random::new(33);
        let points: Vec<_> = (0..3 * CHUNK + 5).map(|_| random.point() * 1.5).collect();
        let found = bvh.closest_to_each(&points);
        assert_eq!(found.len(), points.len());
        for (closest, p) in found.iter().zip(&points) {
            assert_eq!(closest.distance_sq, bvh.closest_point(*p).distance_sq, "{p}");
        }
        assert!(bvh.closest_to_each(&[]).is_empty());
    }

    #[test]
    fn bounded_search_finds_within_the_bound_only() {
        let bvh = Bvh::new(&sphere(1.0, 24));
        assert_eq!(bvh.closest_within(DVec3::new(0.0, 0.0, 1.5), 0.49), None);
        let found = bvh.closest_within(DVec3::new(0.0, 0.0, 1.5), 0.51).unwrap();
        assert!((found.distance_sq - 0.25).abs() < 1e-9);
        assert_eq!(Some(found), Some(bvh.closest_point(DVec3::new(0.0, 0.0, 1.5))));
    }

    #[test]
    fn stacked_duplicates_do_not_break_it() {
        let mut mesh = soup(4, 2);
        mesh.triangles = vec![[3, 4, 5]; 50_000];
        let p = DVec3::splat(3.0);
        let expected = closest_on_triangle(p, &mesh.corners(0)).0;
        assert_eq!(Bvh::new(&mesh).closest_point(p).point, expected);
    }
}
