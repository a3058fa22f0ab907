//! Meshes for tests.

use isv_io::{Unit, read_mesh};
use isv_testkit::capture;
use isv_volume::{Appearance, Material, TriangleMesh};
use std::sync::Arc;

/// One frame of a sequence, if the data is there; says so plainly if it is not.
pub(crate) fn load(sequence: &str, frame: usize) -> Option<TriangleMesh> {
    let path = capture(&format!("{sequence}/frame_{frame:04}.ply"))?;
    Some(read_mesh(&path, Unit::Metre).expect("a mesh"))
}

/// A square of 1 m at z = 0 in `2 * cells * cells` triangles. Its texture coordinates are x and y, and 2 more in x from x = 0.5 on: there
/// is a seam.
#[allow(dead_code)]
pub(crate) fn textured_square(cells: u32) -> TriangleMesh {
    let side = cells + 1;
    let at = |i: u32| f64::from(i) / f64::from(cells);
    let vertices = (0..side * side).map(|v| [at(v % side), at(v / side), 0.0].into()).collect();
    let (mut triangles, mut texture_coordinates) = (Vec::new(), Vec::new());
    for cell in 0..cells * cells {
        let (x, y) = (cell % cells, cell / cells);
        let corner = |dx: u32, dy: u32| (y + dy) * side + x + dx;
        let beyond_seam = if 2 * x >= cells { 2.0 } else { 0.0 };
        for corners in [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]] {
            triangles.push(corners.map(|[dx, dy]| corner(dx, dy)));
            let coordinate = |[dx, dy]: [u32; 2]| [at(x + dx) as f32 + beyond_seam, at(y + dy) as f32];
            texture_coordinates.push(corners.map(coordinate));
        }
    }
    let appearance =
        Appearance { texture_coordinates, materials: vec![Material::default()], ..Appearance::default() };
    TriangleMesh { vertices, normals: Vec::new(), triangles, appearance: Some(Arc::new(appearance)) }
}

/// The largest difference between the texture coordinates of a mesh and those that [`textured_square`] has at the same positions.
#[allow(dead_code)]
pub(crate) fn farthest_coordinate(mesh: &TriangleMesh) -> f64 {
    let coordinates = &mesh.appearance.as_ref().expect("a texture").texture_coordinates;
    assert_eq!(coordinates.len(), mesh.triangles.len());
    let mut farthest: f64 = 0.0;
    for (triangle, coordinates) in mesh.triangles.iter().zip(coordinates) {
        let beyond_seam = if coordinates.iter().all(|c| c[0] > 1.75) { 2.0 } else { 0.0 };
        for (vertex, coordinate) in triangle.iter().zip(coordinates) {
            let place = mesh.vertices[*vertex as usize];
            let [u, v] = coordinate.map(f64::from);
            farthest = farthest.max((u - beyond_seam - place.x).abs()).max((v - place.y).abs());
        }
    }
    farthest
}
