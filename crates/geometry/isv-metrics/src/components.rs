//! Connected parts of a mesh.

use isv_spatial::{DisjointSets, Weld};
use isv_volume::TriangleMesh;

/// Number of parts of a mesh that share no point. Triangles hang together where they share a vertex or have
/// vertices at exactly the same position. Vertices without a triangle do not count. Stray specks show here
/// first.
#[must_use]
pub fn connected_components(mesh: &TriangleMesh) -> usize {
    components_of_weld(mesh, &Weld::new(&mesh.vertices))
}

pub(crate) fn components_of_weld(mesh: &TriangleMesh, weld: &Weld) -> usize {
    let count = weld.count as u32;
    let mut sets = DisjointSets::new(count);
    let mut used = vec![false; weld.count];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| weld.positions[v as usize]);
        sets.join(a, b);
        sets.join(b, c);
        [a, b, c].into_iter().for_each(|v| used[v as usize] = true);
    }
    (0..count).filter(|v| used[*v as usize] && sets.find(*v) == *v).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn seams_hold_parts_together_and_loose_vertices_do_not_count() {
        let mut mesh = TriangleMesh {
            vertices: vec![
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                DVec3::X,
                DVec3::Y,
                DVec3::ONE,
                DVec3::splat(9.0),
            ],
            normals: Vec::new(),
            triangles: vec![[0, 1, 2]],
            appearance: None,
        };
        assert_eq!(connected_components(&mesh), 1);
        mesh.triangles.push([3, 5, 4]);
        assert_eq!(connected_components(&mesh), 1);
        mesh.vertices[3..5].copy_from_slice(&[DVec3::X * 2.0, DVec3::Y * 2.0]);
        assert_eq!(connected_components(&mesh), 2);
        mesh.vertices[0] = DVec3::ZERO;
        mesh.vertices[3] = DVec3::new(-0.0, 0.0, -0.0);
        assert_eq!(connected_components(&mesh), 1);
        assert_eq!(connected_components(&TriangleMesh::default()), 0);
    }
}
