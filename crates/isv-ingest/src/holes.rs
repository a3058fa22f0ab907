//! Which edges of a mesh border a hole worth keeping open.
//!
//! Captures are almost closed: seams and cracks should vanish, but the open sole of a foot must not be covered by an
//! invented surface. A hole is a connected set of edges with one face; its width is the hydraulic diameter 4 A / P, with
//! P its length and A the magnitude of its vector area, which for a disc is the diameter and for a seam almost nothing.
//!
//! A crack all the way around a part counts as two wide holes, one on either side, as its two rims share no vertex.

use crate::tiles::VoxelMesh;
use glam::DVec3;
use isv_spatial::Feature;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Holes up to this width, in voxels, are closed by the winding number.
const WIDEST_CLOSED: f64 = 3.0;

/// Marks the edges and corners of triangles that lie on a wide hole.
pub(crate) struct HoleMarks {
    /// A byte a triangle: bit `i` for edge `i`, bit `3 + i` for corner `i`.
    marks: Vec<u8>,
}

impl HoleMarks {
    /// The marks of a mesh; `None` if it has no wide hole.
    pub(crate) fn find(mesh: &VoxelMesh) -> Option<Self> {
        let welded = weld(&mesh.vertices);
        let boundary = boundary_edges(mesh.triangles, &welded);
        let wide = wide_vertices(&boundary, &mesh.vertices, mesh.vertices.len());
        if !wide.contains(&true) {
            return None;
        }
        let mut marks = vec![0u8; mesh.triangles.len()];
        for (mark, triangle) in marks.iter_mut().zip(mesh.triangles) {
            for i in 0..3 {
                *mark |= u8::from(wide[welded[triangle[i] as usize] as usize]) << (3 + i);
            }
        }
        for edge in &boundary {
            marks[edge.face as usize] |= u8::from(wide[edge.from as usize]) << edge.side;
        }
        Some(Self { marks })
    }

    /// Whether any edge or corner of a triangle lies on a wide hole.
    pub(crate) fn touch(&self, face: u32) -> bool {
        self.marks[face as usize] != 0
    }

    /// Whether a part of a triangle lies on a wide hole.
    pub(crate) fn contain(&self, face: u32, feature: Feature) -> bool {
        let bit = match feature {
            Feature::Face => return false,
            Feature::Edge(i) => i,
            Feature::Vertex(i) => 3 + i,
        };
        self.marks[face as usize] >> bit & 1 != 0
    }
}

/// An edge with one face, in the direction of that face.
struct BoundaryEdge {
    from: u32,
    to: u32,
    face: u32,
    /// Which edge of the face it is.
    side: u8,
}

/// For each vertex the first one at exactly the same position.
fn weld(vertices: &[DVec3]) -> Vec<u32> {
    let mut first = FxHashMap::with_capacity_and_hasher(vertices.len(), Default::default());
    // Adding zero turns -0 into 0.
    let key = |v: &DVec3| (*v + 0.0).to_array().map(f64::to_bits);
    vertices.iter().enumerate().map(|(i, v)| *first.entry(key(v)).or_insert(i as u32)).collect()
}

/// Edges whose faces all have the same third corner, so that duplicates of a face do not hide a rim. Faces that name a
/// position twice have no area and border nothing.
fn boundary_edges(triangles: &[[u32; 3]], welded: &[u32]) -> Vec<BoundaryEdge> {
    let mut sides: Vec<(u64, u32, u32)> = triangles
        .par_iter()
        .enumerate()
        .flat_map_iter(|(face, triangle)| {
            let [a, b, c] = triangle.map(|v| welded[v as usize]);
            let proper = a != b && b != c && c != a;
            [(a, b, c), (b, c, a), (c, a, b)].into_iter().zip(0..).filter(move |_| proper).map(
                move |((from, to, opposite), side)| {
                    let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                    (key, opposite, face as u32 * 4 + side)
                },
            )
        })
        .collect();
    sides.par_sort_unstable();
    let mut boundary = Vec::new();
    for edge in sides.chunk_by(|a, b| a.0 == b.0) {
        if edge[0].1 == edge[edge.len() - 1].1 {
            let (face, side) = (edge[0].2 / 4, (edge[0].2 % 4) as usize);
            let corner = |i: usize| welded[triangles[face as usize][i % 3] as usize];
            boundary.push(BoundaryEdge { from: corner(side), to: corner(side + 1), face, side: side as u8 });
        }
    }
    boundary
}

/// For each vertex whether it lies on a wide hole.
fn wide_vertices(boundary: &[BoundaryEdge], positions: &[DVec3], count: usize) -> Vec<bool> {
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for edge in boundary {
        let (a, b) = (root(&mut parents, edge.from), root(&mut parents, edge.to));
        parents[a.max(b) as usize] = a.min(b);
    }
    let mut holes: FxHashMap<u32, (DVec3, f64)> = FxHashMap::default();
    for edge in boundary {
        let hole = root(&mut parents, edge.from);
        let (from, to) = (positions[edge.from as usize], positions[edge.to as usize]);
        let origin = positions[hole as usize];
        let (area, length) = holes.entry(hole).or_default();
        *area += 0.5 * (from - origin).cross(to - origin);
        *length += from.distance(to);
    }
    let mut wide = vec![false; count];
    for edge in boundary {
        let (area, length) = holes[&root(&mut parents, edge.from)];
        let is_wide = 4.0 * area.length() > WIDEST_CLOSED * length;
        wide[edge.from as usize] = is_wide;
        wide[edge.to as usize] = is_wide;
    }
    wide
}

/// The representative of a vertex, halving its path on the way.
fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        let grandparent = parents[parents[vertex as usize] as usize];
        parents[vertex as usize] = grandparent;
        vertex = grandparent;
    }
    vertex
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{open_box, sphere};

    fn marked(mesh: &isv_volume::TriangleMesh, scale: f64) -> usize {
        let vertices = mesh.vertices.iter().map(|v| *v * scale).collect();
        let mesh = VoxelMesh { vertices, triangles: &mesh.triangles };
        HoleMarks::find(&mesh).map_or(0, |m| m.marks.iter().map(|b| (b & 7).count_ones() as usize).sum())
    }

    #[test]
    fn a_closed_surface_has_no_holes_even_with_unwelded_corners() {
        let mut mesh = sphere(1.0, 12);
        mesh.vertices = (0..mesh.triangles.len()).flat_map(|f| mesh.corners(f)).collect();
        mesh.triangles = (0..mesh.triangles.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        assert_eq!(marked(&mesh, 100.0), 0);
    }

    #[test]
    fn the_rim_of_an_open_box_is_wide_from_three_voxels() {
        let mesh = open_box(1.0);
        assert_eq!(marked(&mesh, 1.4), 0, "hydraulic diameter of a square of edge 2 * 1.4 is 2.8");
        assert_eq!(marked(&mesh, 1.6), 4);
        let mut doubled = mesh.clone();
        doubled.triangles.extend_from_slice(&mesh.triangles);
        assert_eq!(marked(&doubled, 1.6), 4, "duplicate faces do not close a hole");
    }
}
