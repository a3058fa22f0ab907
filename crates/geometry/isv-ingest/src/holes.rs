//! Which edges of a mesh border a hole worth keeping open.
//!
//! Captures are almost closed. Seams and cracks should vanish, but the open sole of a foot must not be
//! covered by an invented surface. A hole is a connected set of edges with one face. Its width is the
//! hydraulic diameter 4 A / P, with P its length and A the magnitude of its vector area. That is the diameter
//! for a disc, and almost nothing for a seam.
//!
//! A crack all the way around a part counts as two wide holes, one on either side, as its two rims share no vertex.

use crate::boundary::{Boundary, Rim};
use crate::tiles::VoxelMesh;
use glam::DVec3;
use rustc_hash::{FxHashMap, FxHashSet};

/// Holes up to this width, in voxels, are closed by the winding number.
const WIDEST_CLOSED: f64 = 3.0;

/// The edges and vertices on wide holes.
#[derive(Clone)]
pub(crate) struct WideHoles {
    /// The ends of all edges, in voxels.
    pub(crate) rims: Vec<[DVec3; 2]>,
    /// A byte a triangle: bit `i` if it owns its edge `i` and that lies on a wide hole.
    edges: Vec<u8>,
    /// For each vertex whether it does.
    vertices: Vec<bool>,
}

impl WideHoles {
    /// The wide holes of a mesh; `None` if it has none.
    pub(crate) fn find(mesh: &VoxelMesh, boundary: &Boundary) -> Option<Self> {
        let wide = wide_vertices(&boundary.rims, &mesh.vertices);
        if wide.is_empty() {
            return None;
        }
        let mut edges = vec![0u8; mesh.triangles.len()];
        for rim in &boundary.rims {
            edges[rim.side.face as usize] |= u8::from(wide.contains(&rim.from)) << rim.side.side;
        }
        let is_wide = |vertex| boundary.welded(vertex).is_some_and(|first| wide.contains(&first));
        let vertices = (0..mesh.vertices.len() as u32).map(is_wide).collect();
        let rims = boundary.rims.iter().filter(|rim| wide.contains(&rim.from));
        let rims = rims.map(|rim| [rim.from, rim.to].map(|vertex| mesh.vertices[vertex as usize])).collect();
        Some(Self { rims, edges, vertices })
    }

    /// Which of a triangle's edges, as far as it owns them, and corners lie on wide holes: a bit each, edges first.
    pub(crate) fn marks(&self, mesh: &VoxelMesh, face: u32) -> u8 {
        let corners = (0..3).zip(mesh.triangles[face as usize]);
        corners.fold(self.edges[face as usize], |marks, (corner, vertex)| {
            marks | u8::from(self.has_vertex(vertex)) << (3 + corner)
        })
    }

    /// Whether an edge lies on a wide hole; asked of its owner.
    pub(crate) fn has_edge(&self, face: u32, side: usize) -> bool {
        self.edges[face as usize] >> side & 1 != 0
    }

    /// Whether a triangle does, if only at a corner.
    pub(crate) fn touch(&self, mesh: &VoxelMesh, face: u32) -> bool {
        mesh.triangles[face as usize].iter().any(|vertex| self.has_vertex(*vertex))
    }

    /// Whether a vertex lies on a wide hole.
    pub(crate) fn has_vertex(&self, vertex: u32) -> bool {
        self.vertices[vertex as usize]
    }
}

/// The vertices on wide holes.
fn wide_vertices(rims: &[Rim], positions: &[DVec3]) -> FxHashSet<u32> {
    let mut parents = FxHashMap::default();
    for rim in rims {
        let [a, b] = [rim.from, rim.to].map(|vertex| root(&mut parents, vertex));
        parents.insert(a.max(b), a.min(b));
    }
    let mut holes: FxHashMap<u32, (DVec3, f64)> = FxHashMap::default();
    for rim in rims {
        let hole = root(&mut parents, rim.from);
        let (from, to) = (positions[rim.from as usize], positions[rim.to as usize]);
        let origin = positions[hole as usize];
        let (area, length) = holes.entry(hole).or_default();
        *area += 0.5 * (from - origin).cross(to - origin);
        *length += from.distance(to);
    }
    let is_wide = |rim: &&Rim| {
        let (area, length) = holes[&root(&mut parents, rim.from)];
        4.0 * area.length() > WIDEST_CLOSED * length
    };
    rims.iter().filter(is_wide).flat_map(|rim| [rim.from, rim.to]).collect()
}

/// The representative of a vertex, halving its path on the way.
fn root(parents: &mut FxHashMap<u32, u32>, mut vertex: u32) -> u32 {
    while let Some(parent) = parents.get(&vertex).copied().filter(|parent| *parent != vertex) {
        let grandparent = parents.get(&parent).copied().unwrap_or(parent);
        parents.insert(vertex, grandparent);
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
        let mesh = VoxelMesh { vertices, triangles: (&mesh.triangles).into() };
        let holes = WideHoles::find(&mesh, &Boundary::new(&mesh));
        holes.map_or(0, |holes| holes.edges.iter().map(|bits| bits.count_ones() as usize).sum())
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
