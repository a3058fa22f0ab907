//! Normals that are continuous over a surface.

use glam::DVec3;
use isv_spatial::Weld;
use isv_spatial::{Closest, Feature};
use isv_volume::TriangleMesh;

/// Below this length a sum of unit vectors is what rounding left of vectors that cancel.
const CANCELLED: f64 = 1e-9;

/// Vertex normals of a mesh, interpolated over its triangles as a renderer does.
///
/// They are computed from positions alone, whatever normals the mesh brought along. A vertex has the mean of
/// the normals of the triangles around it, each weighed by its angle there. So it does not depend on how
/// faces are cut into triangles (Thürmer and Wüthrich 1998, "Computing vertex normals from polygonal
/// facets"). Vertices at one position share a normal.
pub(crate) struct SmoothNormals<'a> {
    mesh: &'a TriangleMesh,
    weld: Weld,
    /// One a position; zero where the triangles around it cancel.
    normals: Vec<DVec3>,
}

impl<'a> SmoothNormals<'a> {
    /// The normals of a mesh and the weld of its vertices.
    pub(crate) fn new(mesh: &'a TriangleMesh, weld: Weld) -> Self {
        let mut normals = vec![DVec3::ZERO; weld.count];
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            let flat = mesh.area_vector(face).normalize_or_zero();
            let angles = corner_angles(mesh.corners(face));
            for (v, angle) in triangle.iter().zip(angles) {
                normals[weld.positions[*v as usize] as usize] += flat * angle;
            }
        }
        normals.iter_mut().for_each(|normal| *normal = unit_or_zero(*normal));
        Self { mesh, weld, normals }
    }

    /// The unit normal of a triangle where its corners have these weights (barycentric coordinates). Where the normals of
    /// the corners cancel, that of the triangle; zero if it has none.
    pub(crate) fn at(&self, face: usize, weights: [f64; 3]) -> DVec3 {
        let corners = self.mesh.triangles[face].map(|v| self.weld.positions[v as usize] as usize);
        let smooth = (0..3).map(|i| self.normals[corners[i]] * weights[i]).sum();
        match unit_or_zero(smooth) {
            DVec3::ZERO => self.mesh.area_vector(face).normalize_or_zero(),
            normal => normal,
        }
    }

    /// The unit normal at a point of the mesh.
    pub(crate) fn at_closest(&self, closest: &Closest) -> DVec3 {
        let face = closest.triangle as usize;
        self.at(face, weights_of(closest, self.mesh.corners(face)))
    }
}

/// Angles of a triangle at its corners, in radians.
fn corner_angles([a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let angle = |at: DVec3, to: DVec3, and: DVec3| angle_between(to - at, and - at);
    let (at_a, at_b) = (angle(a, b, c), angle(b, c, a));
    [at_a, at_b, std::f64::consts::PI - at_a - at_b]
}

/// The angle between two vectors, in radians; 0 if one of them is zero. Exact for small angles, as an arc cosine is not.
pub(crate) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    // For an arc tangent, a dot product of -0.0 is half a turn.
    a.cross(b).length().atan2(a.dot(b) + 0.0)
}

fn unit_or_zero(v: DVec3) -> DVec3 {
    let length = v.length();
    if length > CANCELLED { v / length } else { DVec3::ZERO }
}

/// Barycentric coordinates of a closest point.
pub(crate) fn weights_of(closest: &Closest, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let mut weights = [0.0; 3];
    match closest.feature {
        Feature::Vertex(i) => weights[usize::from(i)] = 1.0,
        Feature::Edge(i) => {
            let (i, next) = (usize::from(i), (usize::from(i) + 1) % 3);
            let (from, to) = ([a, b, c][i], [a, b, c][next]);
            let share = (closest.point - from).dot(to - from) / (to - from).length_squared();
            (weights[i], weights[next]) = (1.0 - share, share);
        }
        Feature::Face => {
            let normal = (b - a).cross(c - a);
            let opposite = |from: DVec3, to: DVec3| {
                normal.dot((to - from).cross(closest.point - from)) / normal.length_squared()
            };
            weights = [opposite(b, c), opposite(c, a), opposite(a, b)];
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::Bvh;

    fn cube(quads_cut_the_other_way: bool) -> TriangleMesh {
        let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let cut = |[a, b, c, d]: [u32; 4]| match quads_cut_the_other_way {
            false => [[a, b, c], [a, c, d]],
            true => [[a, b, d], [b, c, d]],
        };
        TriangleMesh {
            vertices: (0..8).map(corner).collect(),
            normals: Vec::new(),
            triangles: quads.into_iter().flat_map(cut).collect(),
            appearance: None,
        }
    }

    #[test]
    fn corners_of_a_cube_face_their_diagonal_however_it_is_cut() {
        for mesh in [cube(false), cube(true)] {
            let normals = SmoothNormals::new(&mesh, Weld::new(&mesh.vertices));
            for (face, triangle) in mesh.triangles.iter().enumerate() {
                let outward = (mesh.vertices[triangle[0] as usize] - DVec3::splat(0.5)).normalize();
                assert!(normals.at(face, [1.0, 0.0, 0.0]).distance(outward) < 1e-14);
            }
        }
    }

    #[test]
    fn nothing_has_no_angle_to_anything() {
        for x in [-1.0, 1.0] {
            assert_eq!(angle_between(DVec3::ZERO, DVec3::splat(x)), 0.0);
        }
    }

    #[test]
    fn weights_put_a_closest_point_back_together() {
        let mesh = cube(false);
        let bvh = Bvh::new(&mesh);
        for p in [[0.3, 0.2, -1.0], [0.6, 0.7, 2.0], [-1.0, -1.0, 0.25], [2.0, 3.0, 4.0], [1.1, 0.5, 0.5]] {
            let closest = bvh.closest_point(DVec3::from(p));
            let corners = mesh.corners(closest.triangle as usize);
            let weights = weights_of(&closest, corners);
            let point: DVec3 = (0..3).map(|i| corners[i] * weights[i]).sum();
            assert!(point.distance(closest.point) < 1e-14, "{p:?}: {weights:?}");
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn seams_are_smooth_and_two_sides_of_a_sheet_keep_their_own() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut mesh = TriangleMesh {
            vertices: [corners, corners].concat().into_iter().map(DVec3::from).collect(),
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [4, 7, 5]],
            appearance: None,
        };
        let weld = || Weld::new(&mesh.vertices);
        assert_eq!(weld().count, 4);
        let at_the_fold = SmoothNormals::new(&mesh, weld()).at(0, [0.5, 0.5, 0.0]);
        assert!(at_the_fold.distance(DVec3::new(0.0, 1.0, 1.0).normalize()) < 1e-15, "{at_the_fold}");
        mesh.triangles[1] = [4, 6, 5];
        let two_sided = SmoothNormals::new(&mesh, Weld::new(&mesh.vertices));
        assert_eq!([0, 1].map(|face| two_sided.at(face, [0.2, 0.3, 0.5])), [DVec3::Z, DVec3::NEG_Z]);
    }

    #[test]
    fn small_and_large_angles_are_exact() {
        for angle in [0.0, 1e-9, 0.5, 3.0, std::f64::consts::PI] {
            let turned = DVec3::new(f64::cos(angle), f64::sin(angle), 0.0) * 7.0;
            assert!((angle_between(DVec3::X, turned) - angle).abs() < 1e-15);
        }
    }
}
