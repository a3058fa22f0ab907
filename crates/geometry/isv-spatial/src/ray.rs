//! The first point of a mesh on a ray.

use crate::bvh::Bvh;
use crate::tree::{Content, MAX_DEPTH, Node};
use glam::DVec3;
use rayon::prelude::*;

/// Widening of the part of a ray inside a box, so that rounding hides no triangle from it. It is that of Ize
/// 2013, "Robust BVH ray traversal", Journal of Computer Graphics Techniques 2.
const WIDENING: f64 = 1.0 + 4.0 * f64::EPSILON;

/// Rays followed by one thread.
const CHUNK: usize = 256;

/// A half line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start in metres.
    pub origin: DVec3,
    /// Unit vector along the ray.
    pub direction: DVec3,
}

/// The first point of a mesh on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle.
    pub triangle: u32,
    /// Distance from the ray's origin, in metres.
    pub distance: f64,
    /// Weights of the triangle's corners at the point (barycentric coordinates).
    pub weights: [f64; 3],
}

impl Bvh {
    /// The first point of the mesh on a ray, at most `max_distance` metres from its origin. Both sides of triangles count.
    ///
    /// No ray passes between two triangles that share an edge. A triangle exactly along the ray is not met, and on one
    /// without width the place is lost in rounding. Of several
    /// triangles at the same distance, which one is reported is arbitrary but always the same.
    #[must_use]
    pub fn first_hit(&self, ray: &Ray, max_distance: f64) -> Option<Hit> {
        let slabs = Slabs::new(ray);
        let shear = Shear::new(ray);
        // Boxes that the ray misses are infinitely far, and so beyond any reach.
        let (mut first, mut reach) = (None, max_distance.min(f64::MAX));
        let mut stack = [(0usize, 0f64); MAX_DEPTH + 1];
        stack[0].1 = slabs.entry(&self.nodes[0]);
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (mut index, mut entry) = stack[depth];
            while entry <= reach {
                match self.nodes[index].content(index) {
                    Content::Inner(a, b) => {
                        let [a, b] = [a, b].map(|child| (child, slabs.entry(&self.nodes[child])));
                        let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
                        if far.1 <= reach {
                            stack[depth] = far;
                            depth += 1;
                        }
                        (index, entry) = near;
                    }
                    Content::Leaf(range) => {
                        for slot in range {
                            let Some((distance, weights)) = shear.meet(&self.corners[slot]) else { continue };
                            if distance < reach || (first.is_none() && distance == reach) {
                                reach = distance;
                                first = Some(Hit { triangle: self.faces[slot], distance, weights });
                            }
                        }
                        break;
                    }
                }
            }
        }
        first
    }

    /// [`Self::first_hit`] of each ray.
    #[must_use]
    pub fn first_hit_of_each(&self, rays: &[Ray], max_distance: f64) -> Vec<Option<Hit>> {
        let hits =
            |chunk: &[Ray]| -> Vec<_> { chunk.iter().map(|ray| self.first_hit(ray, max_distance)).collect() };
        rays.par_chunks(CHUNK).flat_map_iter(hits).collect()
    }
}

/// A ray made ready for many boxes.
struct Slabs {
    origin: DVec3,
    /// One over the direction.
    inverse: DVec3,
}

impl Slabs {
    fn new(ray: &Ray) -> Self {
        Self { origin: ray.origin, inverse: ray.direction.recip() }
    }

    /// Distance at which the ray enters a box, 0 from inside; infinite where it misses the box.
    fn entry(&self, node: &Node) -> f64 {
        let (mut enters, mut leaves) = (0f64, f64::INFINITY);
        for axis in 0..3 {
            let [low, high] = [node.lo[axis], node.hi[axis]].map(|side| side - self.origin[axis]);
            if self.inverse[axis].is_finite() {
                let [low, high] = [low, high].map(|side| side * self.inverse[axis]);
                enters = enters.max(low.min(high) / WIDENING);
                leaves = leaves.min(low.max(high) * WIDENING);
            } else if low > 0.0 || high < 0.0 {
                return f64::INFINITY;
            }
        }
        if enters <= leaves { enters } else { f64::INFINITY }
    }
}

/// A ray made ready for many triangles, as the map of space that makes it the third axis. It is that of Woop,
/// Benthin and Wald 2013, "Watertight ray/triangle intersection", Journal of Computer Graphics Techniques 2.
struct Shear {
    origin: DVec3,
    /// The axes in their new order: the third is the one that the ray is most along.
    axes: [usize; 3],
    /// Shear along the first two, and scale of the third.
    shear: [f64; 3],
}

impl Shear {
    fn new(ray: &Ray) -> Self {
        let along = ray.direction.abs().max_position();
        let axes = [(along + 1) % 3, (along + 2) % 3, along];
        let [x, y, z] = axes.map(|axis| ray.direction[axis]);
        Self { origin: ray.origin, axes, shear: [x / z, y / z, 1.0 / z] }
    }

    /// Distance at which the ray meets a triangle, and the weights of the corners there.
    fn meet(&self, corners: &[DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [a, b, c] = corners.map(|corner| {
            let [x, y, z] = self.axes.map(|axis| corner[axis] - self.origin[axis]);
            let [shear_x, shear_y, scale] = self.shear;
            [x - shear_x * z, y - shear_y * z, scale * z]
        });
        // Twice the signed areas that the ray makes with the edges. Two triangles compute that of their common edge from the
        // same numbers, so it has opposite signs, and the ray cannot be outside of both.
        let area = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let areas = [area(b, c), area(c, a), area(a, b)];
        let outside = areas.iter().any(|area| *area < 0.0) && areas.iter().any(|area| *area > 0.0);
        let all = areas[0] + areas[1] + areas[2];
        if outside || all == 0.0 {
            return None;
        }
        let weights = areas.map(|area| area / all);
        let distance = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
        (distance >= 0.0).then_some((distance, weights))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{Random, cube, soup, sphere};
    use isv_volume::TriangleMesh;

    /// The textbook way: where the ray meets the plane, if that is inside of all edges.
    fn meet_slowly(ray: &Ray, [a, b, c]: [DVec3; 3]) -> Option<f64> {
        let normal = (b - a).cross(c - a);
        let distance = normal.dot(a - ray.origin) / normal.dot(ray.direction);
        let point = ray.origin + ray.direction * distance;
        let inside =
            [(a, b), (b, c), (c, a)].iter().all(|(p, q)| normal.dot((*q - *p).cross(point - *p)) >= 0.0);
        (distance >= 0.0 && inside).then_some(distance)
    }

    fn brute_force(mesh: &TriangleMesh, ray: &Ray) -> Option<f64> {
        (0..mesh.triangles.len()).filter_map(|face| meet_slowly(ray, mesh.corners(face))).reduce(f64::min)
    }

    fn random_ray(random: &mut Random) -> Ray {
        let direction = (random.point() * 0.7 - random.point() * 0.3).normalize();
        Ray { origin: random.point() * 2.0, direction }
    }

    #[test]
    fn finds_what_brute_force_finds() {
        for mesh in [soup(1, 700), soup(2, 1), soup(5, 6), sphere(0.7, 16)] {
            let bvh = Bvh::new(&mesh);
            let mut random = Random::new(3);
            let mut hits = 0;
            for _ in 0..2000 {
                let ray = random_ray(&mut random);
                let found = bvh.first_hit(&ray, f64::INFINITY);
                let expected = brute_force(&mesh, &ray);
                assert_eq!(found.is_some(), expected.is_some(), "{ray:?}: {found:?}, {expected:?}");
                let (Some(hit), Some(expected)) = (found, expected) else { continue };
                hits += 1;
                assert!((hit.distance - expected).abs() < 1e-11, "{ray:?}: {hit:?}, {expected}");
                let corners = mesh.corners(hit.triangle as usize);
                let point: DVec3 = (0..3).map(|i| corners[i] * hit.weights[i]).sum();
                assert!(point.distance(ray.origin + ray.direction * hit.distance) < 1e-11);
                assert!((hit.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
            assert!(mesh.triangles.len() < 10 || hits > 50, "{hits}");
        }
    }

    #[test]
    fn rays_through_corners_edges_and_along_axes_meet_a_cube() {
        let bvh = Bvh::new(&cube(1.0));
        let (low, high) = cube(1.0).bounds().unwrap();
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let place = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    if place == DVec3::ZERO {
                        continue;
                    }
                    let start = middle + place * half * 3.0;
                    let ray = Ray { origin: start, direction: -place.normalize() };
                    let hit = bvh.first_hit(&ray, f64::INFINITY).expect("the ray aims at the middle");
                    assert!((hit.distance - 2.0 * (place * half).length()).abs() < 1e-12, "{place}");
                }
            }
        }
    }

    /// Rays from the inside of a sphere to its vertices and edges: none gets out. At its poles the sphere has triangles without
    /// width.
    #[test]
    fn no_ray_passes_between_triangles() {
        let mesh = sphere(1.0, 24);
        let bvh = Bvh::new(&mesh);
        let mut random = Random::new(8);
        for _ in 0..20 {
            let origin = random.point() * 0.3;
            for face in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(face);
                if [a, b, c].iter().any(|corner| corner.z.abs() > 0.999) {
                    continue;
                }
                let share = (random.signed() + 1.0) / 2.0;
                for target in [a, a.lerp(b, share), b.lerp(c, share)] {
                    let ray = Ray { origin, direction: (target - origin).normalize() };
                    let hit = bvh.first_hit(&ray, f64::INFINITY).expect("a sphere is closed");
                    assert!((hit.distance - origin.distance(target)).abs() < 1e-9, "{hit:?}");
                }
            }
        }
    }

    #[test]
    fn both_sides_count_and_distances_are_bounded() {
        let square = |z: f64| {
            let corners = [[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
            corners.map(DVec3::from)
        };
        let mesh = TriangleMesh {
            vertices: [square(0.0), square(1.0)].concat(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]],
            ..TriangleMesh::default()
        };
        let bvh = Bvh::new(&mesh);
        let down = |z: f64| Ray { origin: DVec3::new(0.25, 0.5, z), direction: DVec3::NEG_Z };
        let distance = |ray: Ray, limit: f64| bvh.first_hit(&ray, limit).map(|hit| hit.distance);
        assert_eq!(distance(down(3.0), f64::INFINITY), Some(2.0));
        assert_eq!(distance(down(3.0), 2.0), Some(2.0), "the bound itself is inside");
        assert_eq!(distance(down(3.0), 1.999), None);
        assert_eq!(distance(down(0.5), f64::INFINITY), Some(0.5));
        assert_eq!(distance(down(0.0), f64::INFINITY), Some(0.0), "the origin may lie on the mesh");
        assert_eq!(distance(down(-0.1), f64::INFINITY), None);
        let along = Ray { origin: DVec3::new(-3.0, 0.0, 0.0), direction: DVec3::X };
        assert_eq!(distance(along, f64::INFINITY), None, "exactly along the first square");
    }

    #[test]
    fn many_rays_at_once_meet_what_each_meets() {
        let bvh = Bvh::new(&soup(9, 500));
        let mut random = Random::new(33);
        let rays: Vec<_> = (0..2 * CHUNK + 3).map(|_| random_ray(&mut random)).collect();
        let hits = bvh.first_hit_of_each(&rays, 1.5);
        assert_eq!(hits.len(), rays.len());
        assert!(hits.iter().zip(&rays).all(|(hit, ray)| *hit == bvh.first_hit(ray, 1.5)));
    }
}
