//! Points of a lattice as a mesh of cubes, so that they can be drawn.

use glam::DVec3;
use isv::raw::io::Geometry;
use isv::raw::volume::{Appearance, PointCloud, TriangleMesh};
use std::collections::HashMap;
use std::sync::Arc;

/// Returns the mesh to draw of a decoded shape: points of a lattice become cubes. `point_step_m`: the step of their lattice (m);
/// without it points are not drawn.
#[must_use]
pub fn drawable(shape: Geometry, point_step_m: Option<f64>) -> TriangleMesh {
    match shape {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Points(points) => cubes(&points, point_step_m.unwrap_or_default()),
    }
}

/// Points of a lattice as cubes: the outer faces alone, in the colours of the points if they have any. `step_m`: edge of a cube (m);
/// nothing is drawn if it is 0.
pub(crate) fn cubes(points: &PointCloud, step_m: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let Some((low, _)) = points.bounds().filter(|_| step_m > 0.0) else { return mesh };
    let cell = |p: &DVec3| ((*p - low) / step_m).round().to_array().map(|x| x as i64);
    let filled: HashMap<_, _> = points.positions.iter().map(cell).zip(0..).collect();
    let mut cells: Vec<_> = filled.iter().map(|(cell, point)| (*cell, *point)).collect();
    cells.sort_unstable();
    let mut vertex_colours = Vec::new();
    for (cell, point) in cells {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beside = cell;
            beside[axis] += 2 * side - 1;
            if !filled.contains_key(&beside) {
                add_face(&mut mesh, cell, axis, side, |corner| low + (DVec3::from(corner) - 0.5) * step_m);
                if let Some(colour) = points.colours.get::<usize>(point) {
                    vertex_colours.extend([*colour; 4]);
                }
            }
        }
    }
    if !vertex_colours.is_empty() {
        mesh.appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
    }
    mesh
}

/// Adds the face of a cell at one end of an axis, seen from outside.
fn add_face(
    mesh: &mut TriangleMesh,
    cell: [i64; 3],
    axis: usize,
    side: i64,
    place: impl Fn([f64; 3]) -> DVec3,
) {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let first = mesh.vertices.len() as u32;
    for [along_u, along_v] in [[0, 0], [1, 0], [1, 1], [0, 1]] {
        let mut corner = cell;
        corner[axis] += side;
        corner[u] += along_u;
        corner[v] += along_v;
        mesh.vertices.push(place(corner.map(|x| x as f64)));
    }
    let order = if side == 1 { [0, 1, 2, 3] } else { [3, 2, 1, 0] };
    let [a, b, c, d] = order.map(|corner| first + corner);
    mesh.triangles.extend([[a, b, c], [a, c, d]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beside_each_other_have_no_face_between_them() {
        let positions = vec![DVec3::ZERO, DVec3::new(0.01, 0.0, 0.0)];
        let plain = cubes(&PointCloud { positions: positions.clone(), ..PointCloud::default() }, 0.01);
        // Ten faces of two triangles each, seen from outside.
        assert_eq!((plain.triangles.len(), plain.appearance.is_none()), (20, true));
        let (low, high) = plain.bounds().unwrap();
        assert!(low.abs_diff_eq(DVec3::splat(-0.005), 1e-9), "{low}");
        assert!(high.abs_diff_eq(DVec3::new(0.015, 0.005, 0.005), 1e-9), "{high}");
        let colours = vec![[255, 0, 0], [0, 0, 255]];
        let coloured = cubes(&PointCloud { positions, colours, ..PointCloud::default() }, 0.01);
        let appearance = coloured.appearance.as_deref().unwrap();
        appearance.validate(coloured.vertices.len(), coloured.triangles.len()).unwrap();
        let red = appearance.vertex_colours.iter().filter(|colour| **colour == [255, 0, 0]);
        assert_eq!(red.count(), 20);
    }
}
