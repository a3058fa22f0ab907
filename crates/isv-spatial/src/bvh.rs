//! Closest point on a mesh.

use crate::closest::{Feature, closest_on_triangle};
use crate::tree::{Content, MAX_DEPTH, Node, Tree};
use glam::DVec3;
use isv_volume::TriangleMesh;

/// Triangles a leaf: fewer make the tree deeper, more waste distance tests.
const LEAF_SIZE: usize = 4;

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

/// A bounding-volume hierarchy that answers closest-point queries on a copy of a mesh's triangles.
pub struct Bvh {
    nodes: Vec<Node>,
    /// Corners of the triangles in leaf order.
    corners: Vec<[DVec3; 3]>,
    /// Leaf order to triangle index.
    faces: Vec<u32>,
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
        // An unbounded search of a tree with at least one triangle finds one, unless `p` is not finite.
        self.search(p, f64::INFINITY).unwrap_or(Closest {
            triangle: self.faces[0],
            point: self.corners[0][0],
            distance_sq: self.corners[0][0].distance_squared(p),
            feature: Feature::Vertex(0),
        })
    }

    /// The same, if the mesh comes closer to `p` than `max_distance` metres.
    #[must_use]
    pub fn closest_within(&self, p: DVec3, max_distance: f64) -> Option<Closest> {
        self.search(p, max_distance * max_distance)
    }

    /// Depth-first, nearer child first, skipping boxes that are farther than what was found.
    fn search(&self, p: DVec3, mut best_sq: f64) -> Option<Closest> {
        let mut best = None;
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
                self.search_leaf(range, p, &mut best_sq, &mut best);
            }
        }
        best
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
        best: &mut Option<Closest>,
    ) {
        for slot in range {
            let (point, feature) = closest_on_triangle(p, &self.corners[slot]);
            let distance_sq = point.distance_squared(p);
            if distance_sq < *best_sq {
                *best_sq = distance_sq;
                *best = Some(Closest { triangle: self.faces[slot], point, distance_sq, feature });
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
