//! Which vertices are one, and which are needed.

use glam::DVec3;
use isv_volume::TriangleMesh;
use rustc_hash::FxHashMap;

/// A mesh with one vertex a position and without the faces that have no area for it; normals are dropped.
#[must_use]
pub fn weld(mesh: &TriangleMesh) -> TriangleMesh {
    let mut places = FxHashMap::default();
    let mut vertices = Vec::new();
    let merged: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|vertex| {
            // Zero has two signs and one place.
            let place = (*vertex + DVec3::ZERO).to_array().map(f64::to_bits);
            *places.entry(place).or_insert_with(|| {
                vertices.push(*vertex);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| merged[v as usize]));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    TriangleMesh { vertices, normals: Vec::new(), triangles, appearance: None }
}

/// A mesh of these triangles with only the vertices that they name, in the order in which they are named.
#[must_use]
pub fn without_unused(vertices: &[DVec3], triangles: &[[u32; 3]]) -> TriangleMesh {
    let mut renamed = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    let triangles = triangles
        .iter()
        .map(|triangle| {
            triangle.map(|v| {
                let name = &mut renamed[v as usize];
                if *name == u32::MAX {
                    *name = kept.len() as u32;
                    kept.push(vertices[v as usize]);
                }
                *name
            })
        })
        .collect();
    TriangleMesh { vertices: kept, normals: Vec::new(), triangles, appearance: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welding_joins_equal_positions_and_drops_what_has_no_area() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let mesh = TriangleMesh {
            vertices: corners.map(DVec3::from).to_vec(),
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [3, 1, 0], [4, 2, 1]],
            appearance: None,
        };
        let welded = weld(&mesh);
        assert_eq!(welded.vertices.len(), 4);
        assert_eq!(welded.triangles, [[0, 1, 2], [3, 2, 1]]);
    }

    #[test]
    fn vertices_that_no_triangle_has_go() {
        let vertices = [0.0, 1.0, 2.0, 3.0].map(DVec3::splat);
        let mesh = without_unused(&vertices, &[[3, 1, 0]]);
        assert_eq!(mesh.vertices, [3.0, 1.0, 0.0].map(DVec3::splat));
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }
}
