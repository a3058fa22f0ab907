//! The edges of a mesh that have one face.
//!
//! Vertices at exactly the same position count as one, as exporters split them along texture seams. Most edges have two faces by the
//! vertices that they name, so positions are compared only around those that have not.

use crate::tiles::VoxelMesh;
use crate::topology::{NONE, Side, position_key, running_sums};
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// The boundary of a mesh.
pub(crate) struct Boundary {
    pub(crate) edges: Vec<BoundaryEdge>,
    /// For each vertex on the boundary the first one at exactly the same position, and [`NONE`] for others, except that some
    /// which are not on the boundary may be known as well.
    pub(crate) welded: Vec<u32>,
}

/// An edge with one face, in the direction of that face.
pub(crate) struct BoundaryEdge {
    /// Its ends, by the first vertices at their positions.
    pub(crate) from: u32,
    pub(crate) to: u32,
    /// The first triangle that has it, and which of its sides it is.
    pub(crate) side: Side,
}

/// A side of a triangle at its lower end: the other end, the corner opposite.
#[derive(Clone, Copy, Default)]
struct Spoke {
    end: u32,
    opposite: u32,
}

impl Boundary {
    pub(crate) fn of(mesh: &VoxelMesh) -> Self {
        let suspects = suspects(mesh);
        let welded = weld(&mesh.vertices, &suspects);
        let mut sides = suspect_sides(mesh, &welded);
        sides.sort_unstable();
        let mut edges = Vec::new();
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            let mut opposite = edge.iter().map(|side| side.1).filter(|corner| *corner != NONE);
            // Duplicates of a face do not hide a rim. Faces that name a position twice have no area and border nothing.
            if let Some(first) = opposite.next()
                && opposite.all(|corner| corner == first)
            {
                let owner = edge.iter().map(|side| side.2).min().unwrap_or(0);
                let side = Side { face: owner / 4, side: (owner % 4) as u8 };
                let corner = |i: usize| mesh.triangles[side.face as usize][(usize::from(side.side) + i) % 3];
                let [from, to] = [0, 1].map(|i| welded[corner(i) as usize]);
                edges.push(BoundaryEdge { from, to, side });
            }
        }
        Self { edges, welded }
    }
}

/// Whether each vertex is the end of an edge that has not two faces with different third corners, by the vertices that they name.
fn suspects(mesh: &VoxelMesh) -> Vec<bool> {
    let sides = || mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b, c), (b, c, a), (c, a, b)]);
    let starts = running_sums(sides().map(|(from, to, _)| from.min(to) as usize), mesh.vertices.len());
    let mut next = starts.clone();
    let mut spokes = vec![Spoke::default(); starts[mesh.vertices.len()] as usize];
    for (from, to, opposite) in sides() {
        let place = &mut next[from.min(to) as usize];
        spokes[*place as usize] = Spoke { end: from.max(to), opposite };
        *place += 1;
    }
    let lonely = |vertex: usize| {
        let spokes = &spokes[starts[vertex] as usize..starts[vertex + 1] as usize];
        let is_paired = |spoke: &Spoke| {
            spokes.iter().any(|other| {
                let (a, b) = (spoke.opposite as usize, other.opposite as usize);
                other.end == spoke.end && a != b && mesh.vertices[a] != mesh.vertices[b]
            })
        };
        spokes.iter().filter(move |spoke| !is_paired(spoke)).map(move |spoke| (vertex as u32, spoke.end))
    };
    let found: Vec<(u32, u32)> = (0..mesh.vertices.len()).into_par_iter().flat_map_iter(lonely).collect();
    let mut suspects = vec![false; mesh.vertices.len()];
    for (a, b) in found {
        suspects[a as usize] = true;
        suspects[b as usize] = true;
    }
    suspects
}

/// For each vertex at the position of a suspect the first one there, and [`NONE`] for all others.
fn weld(vertices: &[DVec3], suspects: &[bool]) -> Vec<u32> {
    let places = vertices.iter().zip(suspects).filter(|(_, suspect)| **suspect);
    let mut first: FxHashMap<[u64; 3], u32> = places.map(|(v, _)| (position_key(v), NONE)).collect();
    if first.is_empty() {
        return vec![NONE; vertices.len()];
    }
    let mut weld = |(i, v): (usize, &DVec3)| match first.get_mut(&position_key(v)) {
        Some(first) => {
            *first = (*first).min(i as u32);
            *first
        }
        None => NONE,
    };
    vertices.iter().enumerate().map(&mut weld).collect()
}

/// The sides of triangles between suspects: their ends, the lower in the high half; the corner opposite, [`NONE`] if the triangle
/// names a position twice; four times the triangle's index plus the number of the side.
fn suspect_sides(mesh: &VoxelMesh, welded: &[u32]) -> Vec<(u64, u32, u32)> {
    let mut sides = Vec::new();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let known = triangle.map(|v| welded[v as usize]);
        if known.iter().filter(|v| **v != NONE).count() < 2 {
            continue;
        }
        let [a, b, c] = [0, 1, 2].map(|i| if known[i] == NONE { triangle[i] } else { known[i] });
        let proper = a != b && b != c && c != a;
        for (side, (from, to, opposite)) in [(a, b, c), (b, c, a), (c, a, b)].into_iter().enumerate() {
            if known[side] != NONE && known[(side + 1) % 3] != NONE && from != to {
                let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                sides.push((key, if proper { opposite } else { NONE }, face as u32 * 4 + side as u32));
            }
        }
    }
    sides
}
