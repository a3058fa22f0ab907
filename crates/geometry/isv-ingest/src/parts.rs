//! The connected parts of a mesh, and which of them have an inside.
//!
//! Faces that share an edge are of one part. Vertices at exactly the same position count as one.

use crate::sign::{CLOSED_SHARE, SAMPLES, closed_share};
use isv_spatial::{DisjointSets, Weld};
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// A part of fewer faces encloses nothing.
const FEWEST_FACES: usize = 4;

/// Places that the smallest part is looked at in; the largest is looked at in [`SAMPLES`].
const FEWEST_SAMPLES: usize = 64;

/// Finds the faces of open parts, for each face of a mesh. A part is open if less than 0.9 of its area looks closed by its own winding
/// number, as in [`crate::decide_sign`].
pub(crate) fn open_faces(mesh: &TriangleMesh) -> Vec<bool> {
    let parts = connected_parts(mesh);
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|face| mesh.area_vector(face).length()).collect();
    let area_of = |faces: &[u32]| faces.iter().map(|face| areas[*face as usize]).sum::<f64>();
    let whole: f64 = areas.iter().sum();
    let is_open = |faces: &Vec<u32>| {
        let share = area_of(faces) / whole;
        let samples = ((share * SAMPLES as f64) as usize).max(FEWEST_SAMPLES);
        faces.len() < FEWEST_FACES || closed_share(&submesh(mesh, faces), samples) < CLOSED_SHARE
    };
    let open: Vec<bool> = parts.par_iter().map(is_open).collect();
    let mut open_faces = vec![false; mesh.triangles.len()];
    for (faces, _) in parts.iter().zip(&open).filter(|(_, is_open)| **is_open) {
        faces.iter().for_each(|face| open_faces[*face as usize] = true);
    }
    open_faces
}

/// The faces of each part, ascending; parts by their first faces.
fn connected_parts(mesh: &TriangleMesh) -> Vec<Vec<u32>> {
    let Weld { positions, .. } = Weld::new(&mesh.vertices);
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (triangle, face) in mesh.triangles.iter().zip(0..) {
        let corners = triangle.map(|vertex| positions[vertex as usize]);
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], face));
        }
    }
    sides.par_sort_unstable();
    let faces = mesh.triangles.len() as u32;
    let mut sets = DisjointSets::new(faces);
    for pair in sides.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        sets.join(pair[0].1, pair[1].1);
    }
    let mut numbers = vec![0; mesh.triangles.len()];
    let mut parts: Vec<Vec<u32>> = Vec::new();
    for face in 0..faces {
        // A set is represented by its first face.
        let first = sets.find(face) as usize;
        if first == face as usize {
            numbers[first] = parts.len();
            parts.push(Vec::new());
        }
        parts[numbers[first]].push(face);
    }
    parts
}

/// Copies some faces of a mesh into a mesh of their own.
fn submesh(mesh: &TriangleMesh, faces: &[u32]) -> TriangleMesh {
    let corners = |face: &u32| mesh.corners(*face as usize);
    TriangleMesh {
        vertices: faces.iter().flat_map(corners).collect(),
        normals: Vec::new(),
        triangles: (0..faces.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use isv_testkit::{sheet, sphere};

    #[test]
    fn a_body_and_a_sheet_beside_it_are_told_apart_and_so_are_their_soups() {
        let mut mesh = crate::faces::with_area(&sphere(0.4, 20)).into_owned();
        let (vertices, body) = (mesh.vertices.len() as u32, mesh.triangles.len());
        let beside = sheet(1.0);
        mesh.vertices.extend(beside.vertices.iter().map(|v| *v + DVec3::Z));
        mesh.triangles.extend(beside.triangles.iter().map(|t| t.map(|v| v + vertices)));
        let expected: Vec<bool> = (0..mesh.triangles.len()).map(|face| face >= body).collect();
        assert_eq!(connected_parts(&mesh).len(), 2);
        assert_eq!(open_faces(&mesh), expected);
        let faces: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        assert_eq!(open_faces(&submesh(&mesh, &faces)), expected);
    }
}
