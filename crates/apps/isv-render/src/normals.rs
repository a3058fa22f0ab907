//! Normals for meshes that bring none.

use glam::DVec3;
use isv_volume::TriangleMesh;

/// Unit normals of all vertices: the mesh's own if it has them, else those of the faces around them.
pub(crate) fn vertex_normals(mesh: &TriangleMesh) -> Vec<DVec3> {
    if mesh.normals.len() == mesh.vertices.len() {
        mesh.normals.clone()
    } else {
        mesh.angle_weighted_normals()
    }
}

/// Unit normal of a triangle that is counter-clockwise seen from outside; zero if it has no area.
pub(crate) fn face_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corner_of_a_cube_points_along_its_diagonal_however_it_is_cut() {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
        let vertices = vec![DVec3::ZERO, x, y, z, x + y];
        // Three faces around the origin; the one in z = 0 is two triangles.
        let triangles = vec![[0, 4, 1], [0, 2, 4], [0, 3, 2], [0, 1, 3]];
        let normals =
            vertex_normals(&TriangleMesh { vertices, normals: vec![], triangles, appearance: None });
        assert!(normals[0].abs_diff_eq(DVec3::NEG_ONE.normalize(), 1e-12));
    }
}
