//! Generalized winding number.
//!
//! The winding number of a point is the solid angle under which it sees the mesh, signed by orientation, over
//! 4 pi. It is 1 inside a closed surface and 0 outside, and 2 where two closed parts overlap. Near holes it
//! is in between, smoothly (Jacobson et al. 2013, "Robust inside-outside segmentation using generalized
//! winding numbers").
//!
//! It is evaluated as in Barill et al. 2018, "Fast winding numbers for soups and clouds". A cluster of
//! triangles seen from more than [`BETA`] times its radius is replaced by its Taylor expansion. Triangles
//! nearby are summed exactly.

use crate::expansion::{Expansion, Ways};
use crate::tree::{Content, MAX_DEPTH, Node, Tree};
use fearless_simd::{dispatch, prelude::*};
use glam::DVec3;
use isv_kernels::simd;
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A cluster is expanded when farther than this many of its radii (the value of Barill et al.). On coarse test meshes the
/// result is within 0.004 of the exact sum (test `hierarchy_agrees_with_the_exact_sum`).
const BETA: f64 = 2.0;

/// Triangles a leaf: one arc tangent is spent on each leaf, not on each triangle.
const LEAF_SIZE: usize = 8;

/// Subtrees of more nodes than this are expanded by two threads.
const PARALLEL_NODES: usize = 512;

/// Fast winding numbers on a copy of a mesh's triangles.
pub struct WindingNumber {
    clusters: Vec<Cluster>,
    /// Corners of the triangles in leaf order.
    corners: Vec<[DVec3; 3]>,
}

/// One node of the hierarchy, in the tree's order.
struct Cluster {
    far_field: Expansion,
    /// Square of the distance of the farthest corner from the centre.
    radius_sq: f64,
    content: Content,
}

impl WindingNumber {
    /// Builds the hierarchy.
    ///
    /// # Panics
    /// If the mesh has no triangles or names vertices that are not there ([`TriangleMesh::validate`] tells).
    #[must_use]
    pub fn new(mesh: &TriangleMesh) -> Self {
        let (Tree { nodes, .. }, corners) = Tree::by_place(mesh, LEAF_SIZE);
        let mut far_fields = vec![Expansion::default(); nodes.len()];
        expand(&nodes, &mut far_fields, &corners);
        let cluster = |((index, node), far_field): ((usize, &Node), &Expansion)| Cluster {
            far_field: *far_field,
            radius_sq: far_field.radius.powi(2),
            content: node.content(index),
        };
        let clusters = nodes.par_iter().enumerate().zip(&far_fields).map(cluster).collect();
        Self { clusters, corners }
    }

    /// The winding number at `p`. On the surface itself the value is one of those on either side, or between them.
    #[must_use]
    pub fn at(&self, p: DVec3) -> f64 {
        let mut total = 0.0;
        let mut stack = [0usize; MAX_DEPTH + 1];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let cluster = &self.clusters[stack[depth]];
            if cluster.far_field.centre.distance_squared(p) > BETA * BETA * cluster.radius_sq {
                total += cluster.far_field.solid_angle(p);
                continue;
            }
            match &cluster.content {
                Content::Leaf(range) => total += solid_angle_sum(&self.corners[range.clone()], p),
                Content::Inner(a, b) => {
                    stack[depth] = *b;
                    stack[depth + 1] = *a;
                    depth += 2;
                }
            }
        }
        total / (4.0 * PI)
    }
}

/// Expands the clusters of a subtree; large ones by two threads.
fn expand(nodes: &[Node], far_fields: &mut [Expansion], corners: &[[DVec3; 3]]) {
    far_fields[0] = match nodes[0].content(0) {
        Content::Leaf(range) => Expansion::of_triangles(&corners[range]),
        Content::Inner(first, second) => {
            let (low, high) = far_fields[first..].split_at_mut(second - first);
            let mut parts = [(&nodes[first..second], &mut *low), (&nodes[second..], &mut *high)];
            if nodes.len() > PARALLEL_NODES {
                parts.par_iter_mut().for_each(|(nodes, far_fields)| expand(nodes, far_fields, corners));
            } else {
                parts.iter_mut().for_each(|(nodes, far_fields)| expand(nodes, far_fields, corners));
            }
            Expansion::join(&low[0], &high[0], nodes[0].lo, nodes[0].hi)
        }
    };
}

/// Points asked about together.
const POINTS: usize = 8;

/// Vectors that hold one number for each of them, at most: the narrowest vectors hold two.
const MAX_PARTS: usize = POINTS / 2;

/// Fewer points than this are faster one by one.
const FEW: usize = 3;

impl WindingNumber {
    /// The winding numbers at many points, faster than one by one if points that follow each other are close together.
    ///
    /// A cluster is expanded for eight points together or not at all. So the numbers may differ from those of
    /// [`Self::at`], and by what the other points are, within the accuracy of the expansion.
    #[must_use]
    pub fn at_points(&self, points: &[DVec3]) -> Vec<f64> {
        let mut numbers = Vec::with_capacity(points.len());
        for eight in points.chunks(POINTS) {
            if eight.len() < FEW {
                numbers.extend(eight.iter().map(|p| self.at(*p)));
            } else {
                let lane = |i: usize| eight[i.min(eight.len() - 1)];
                let [x, y, z] = [0, 1, 2].map(|axis: usize| std::array::from_fn(|i| lane(i)[axis]));
                let found = dispatch!(simd::level(), simd => self.sum_eight(simd, [x, y, z]));
                numbers.extend_from_slice(&found[..eight.len()]);
            }
        }
        numbers
    }

    /// The winding numbers at eight points, to be compiled for one instruction set.
    #[inline(always)]
    fn sum_eight<S: Simd>(&self, simd: S, points: [[f64; POINTS]; 3]) -> [f64; POINTS] {
        let mut parts = [Part::new(simd, &points, 0); MAX_PARTS];
        let parts = &mut parts[..POINTS / S::f64s::LEN];
        for (number, part) in parts.iter_mut().enumerate() {
            *part = Part::new(simd, &points, number * S::f64s::LEN);
        }
        let mut stack = [0usize; MAX_DEPTH + 1];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let cluster = &self.clusters[stack[depth]];
            let mut is_far = true;
            for part in &*parts {
                is_far &= part.is_far(cluster);
            }
            if is_far {
                for part in &mut *parts {
                    part.far += cluster.far_field.solid_angles::<S>(&part.ways_to(cluster.far_field.centre));
                }
                continue;
            }
            match &cluster.content {
                Content::Leaf(range) => {
                    for part in &mut *parts {
                        part.add_triangles(&self.corners[range.clone()]);
                    }
                }
                Content::Inner(a, b) => {
                    stack[depth] = *b;
                    stack[depth + 1] = *a;
                    depth += 2;
                }
            }
        }
        let mut numbers = [0.0; POINTS];
        for (part, numbers) in parts.iter().zip(numbers.chunks_exact_mut(S::f64s::LEN)) {
            part.write_numbers(numbers);
        }
        numbers
    }
}

/// Points that one vector holds, as wide as the machine has them, and what was summed for them so far.
#[derive(Clone, Copy)]
struct Part<S: Simd> {
    points: [S::f64s; 3],
    /// Solid angles of clusters.
    far: S::f64s,
    near: HalfAngles<S>,
}

impl<S: Simd> Part<S> {
    #[inline(always)]
    fn new(simd: S, points: &[[f64; POINTS]; 3], first: usize) -> Self {
        let zero = S::f64s::splat(simd, 0.0);
        let mut part = Self {
            points: [zero; 3],
            far: zero,
            near: HalfAngles { re: S::f64s::splat(simd, 1.0), im: zero, turns: zero },
        };
        for axis in 0..3 {
            part.points[axis] = S::f64s::from_slice(simd, &points[axis][first..first + S::f64s::LEN]);
        }
        part
    }

    /// The ways from the points to one.
    #[inline(always)]
    fn ways_to(&self, p: DVec3) -> Ways<S> {
        let [x, y, z] = self.points;
        let simd = x.token();
        [S::f64s::splat(simd, p.x) - x, S::f64s::splat(simd, p.y) - y, S::f64s::splat(simd, p.z) - z]
    }

    /// Whether a cluster is far enough from all of the points to be expanded.
    #[inline(always)]
    fn is_far(&self, cluster: &Cluster) -> bool {
        let ways = self.ways_to(cluster.far_field.centre);
        dot::<S>(&ways, &ways).simd_gt(BETA * BETA * cluster.radius_sq).all_true()
    }

    #[inline(always)]
    fn add_triangles(&mut self, triangles: &[[DVec3; 3]]) {
        for [a, b, c] in triangles {
            self.near.add_triangle([self.ways_to(*a), self.ways_to(*b), self.ways_to(*c)]);
        }
        self.near.rescale();
    }

    #[inline(always)]
    fn write_numbers(&self, numbers: &mut [f64]) {
        let HalfAngles { re, im, turns } = &self.near;
        for (lane, number) in numbers.iter_mut().enumerate() {
            let radians = im[lane].atan2(re[lane]) + TAU * turns[lane];
            *number = (self.far[lane] + 2.0 * radians) / (4.0 * PI);
        }
    }
}

#[inline(always)]
fn dot<S: Simd>(u: &Ways<S>, v: &Ways<S>) -> S::f64s {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}

/// [`HalfAngle`] for the points of a vector.
#[derive(Clone, Copy)]
struct HalfAngles<S: Simd> {
    re: S::f64s,
    im: S::f64s,
    turns: S::f64s,
}

impl<S: Simd> HalfAngles<S> {
    /// Adds half the solid angle of a triangle, given by the ways from the points to its corners; as in [`solid_angle_sum`].
    #[inline(always)]
    fn add_triangle(&mut self, [a, b, c]: [Ways<S>; 3]) {
        let dot = dot::<S>;
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        let (la, lb, lc) = (dot(&a, &a).sqrt(), dot(&b, &b).sqrt(), dot(&c, &c).sqrt());
        let one = S::f64s::splat(la.token(), 1.0);
        let none = S::f64s::splat(la.token(), 0.0);
        let scale = one / (la * lb * lc);
        let im = dot(&a, &cross) * scale;
        let re = (dot(&a, &b) * lc + dot(&b, &c) * la + dot(&c, &a) * lb) * scale + 1.0;
        let zero = im * 0.0;
        // Zero: seen edge-on or without area. Not finite: the point is a corner, or nearly.
        let counts = im.abs().simd_gt(0.0) & re.abs().simd_lt(f64::INFINITY) & zero.simd_eq(0.0);
        let product = (self.re * re - self.im * im, self.re * im + self.im * re);
        let up = self.im.simd_ge(0.0) & im.simd_gt(0.0) & product.1.simd_lt(0.0) & counts;
        let down = self.im.simd_lt(0.0) & im.simd_lt(0.0) & product.1.simd_ge(0.0) & counts;
        self.turns += up.select(one, none) - down.select(one, none);
        self.re = counts.select(product.0, self.re);
        self.im = counts.select(product.1, self.im);
    }

    /// Keeps the product of many factors in range.
    #[inline(always)]
    fn rescale(&mut self) {
        let largest = self.re.abs().max(self.im.abs()).max(f64::MIN_POSITIVE);
        let scale = S::f64s::splat(largest.token(), 1.0) / largest;
        self.re *= scale;
        self.im *= scale;
    }
}

/// The winding number at `p` by summing every triangle: slow, and the reference for [`WindingNumber`].
#[must_use]
pub fn exact_winding_number(mesh: &TriangleMesh, p: DVec3) -> f64 {
    let sum: f64 = (0..mesh.triangles.len()).map(|face| solid_angle_sum(&[mesh.corners(face)], p)).sum();
    sum / (4.0 * PI)
}

/// Sum of the signed solid angles of triangles seen from `p`; a triangle through `p` counts 0.
///
/// By van Oosterom & Strackee 1983 half the solid angle of a triangle is the argument of a complex number. Those are
/// multiplied up, so that one arc tangent serves all triangles; [`HalfAngle`] counts the turns the product loses.
pub(crate) fn solid_angle_sum(triangles: &[[DVec3; 3]], p: DVec3) -> f64 {
    let mut sum = HalfAngle::default();
    for corners in triangles {
        let [a, b, c] = corners.map(|v| v - p);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let scale = la * lb * lc;
        let sine = a.dot(b.cross(c)) / scale;
        let cosine = 1.0 + a.dot(b) / (la * lb) + b.dot(c) / (lb * lc) + c.dot(a) / (lc * la);
        // Zero: seen edge-on or without area. NaN: `p` is a corner.
        if sine.abs() > 0.0 && cosine.is_finite() {
            sum.add(cosine, sine);
        }
    }
    2.0 * sum.radians()
}

/// A sum of angles in -pi..pi, kept as a product of complex numbers and a count of whole turns.
struct HalfAngle {
    re: f64,
    im: f64,
    turns: i32,
}

impl Default for HalfAngle {
    fn default() -> Self {
        Self { re: 1.0, im: 0.0, turns: 0 }
    }
}

impl HalfAngle {
    /// Adds the argument of `re + i im`, whose modulus is between tiny and a few units; `im` is not zero.
    fn add(&mut self, re: f64, im: f64) {
        let product = (self.re * re - self.im * im, self.re * im + self.im * re);
        // Two angles of one sign add up to more than pi exactly when the product lies on the other side of the real axis.
        if self.im >= 0.0 && im > 0.0 && product.1 < 0.0 {
            self.turns += 1;
        } else if self.im < 0.0 && im < 0.0 && product.1 >= 0.0 {
            self.turns -= 1;
        }
        (self.re, self.im) = product;
    }

    fn radians(&self) -> f64 {
        self.im.atan2(self.re) + TAU * f64::from(self.turns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{Random, soup, sphere};

    #[test]
    fn one_inside_and_zero_outside_a_sphere() {
        let mesh = sphere(1.0, 24);
        let fast = WindingNumber::new(&mesh);
        let mut random = Random::new(31);
        for _ in 0..2000 {
            let p = random.point() * 1.3;
            let expected = match p.length() {
                r if r < 0.98 => 1.0,
                r if r > 1.001 => 0.0,
                _ => continue,
            };
            assert!((exact_winding_number(&mesh, p) - expected).abs() < 1e-9, "{p}");
            assert!((fast.at(p) - expected).abs() < 4e-3, "{p}: {}", fast.at(p));
        }
    }

    #[test]
    fn hierarchy_agrees_with_the_exact_sum() {
        let mut worst = 0f64;
        for mesh in [sphere(0.8, 20), soup(6, 3000), soup(7, 1), soup(9, 9)] {
            let fast = WindingNumber::new(&mesh);
            let mut random = Random::new(41);
            for _ in 0..500 {
                let p = random.point() * 1.5;
                worst = worst.max((fast.at(p) - exact_winding_number(&mesh, p)).abs());
            }
        }
        assert!(worst < 4e-3, "{worst}");
    }

    #[test]
    fn many_points_at_once_agree_with_one_by_one() {
        for mesh in [sphere(0.8, 20), soup(6, 3000), soup(7, 1), soup(9, 9)] {
            let fast = WindingNumber::new(&mesh);
            let mut random = Random::new(43);
            let mut points: Vec<_> = (0..203).map(|_| random.point() * 1.5).collect();
            points.extend(mesh.corners(0));
            for (p, found) in points.iter().zip(fast.at_points(&points)) {
                let exact = exact_winding_number(&mesh, *p);
                let on_a_corner = mesh.corners(0).contains(p);
                assert!(
                    found.is_finite() && (on_a_corner || (found - exact).abs() < 4e-3),
                    "{found} against {exact}"
                );
            }
        }
    }

    #[test]
    fn angles_are_summed_over_more_than_a_turn() {
        let mut random = Random::new(51);
        let (mut sum, mut expected) = (HalfAngle::default(), 0.0);
        for _ in 0..10 {
            for _ in 0..8 {
                let (re, im) = (random.signed(), random.signed() + 0.4);
                sum.add(re, im);
                expected += im.atan2(re);
            }
            assert!((sum.radians() - expected).abs() < 1e-9, "{} against {expected}", sum.radians());
        }
    }

    #[test]
    fn corners_edges_and_degenerate_faces_are_finite() {
        let mesh = soup(3, 50);
        let fast = WindingNumber::new(&mesh);
        for face in 0..50 {
            let [a, b, c] = mesh.corners(face);
            for p in [a, b, c, a.lerp(b, 0.5), (a + b + c) / 3.0] {
                assert!(fast.at(p).is_finite() && exact_winding_number(&mesh, p).is_finite());
            }
        }
    }
}
