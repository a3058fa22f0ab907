//! How the triangles of a mesh hang together, whatever they are: soups, duplicates and degenerate faces included.
//!
//! Vertices at exactly the same position count as one, as exporters split them along texture seams. Every edge and every
//! vertex is owned by the first triangle that has it.

use crate::tiles::VoxelMesh;
use glam::DVec3;
use isv_spatial::{PositionMap, position_key};

/// No vertex, or no triangle.
pub(crate) const NONE: u32 = u32::MAX;

/// One side of one triangle.
#[derive(Clone, Copy)]
pub(crate) struct Side {
    pub(crate) face: u32,
    /// From corner `side` to the next.
    pub(crate) side: u8,
}

/// An edge at a vertex.
#[derive(Clone, Copy)]
pub(crate) struct Spoke {
    /// The edge as a side of its owner.
    pub(crate) edge: Side,
    /// Whether it runs away from the vertex there, not towards it.
    pub(crate) outward: bool,
}

/// Edges and vertices of a mesh.
pub(crate) struct Topology {
    /// For each vertex the first one at exactly the same position.
    welded: Vec<u32>,
    /// A byte a triangle: bit `i` if it owns its edge `i`, bit `3 + i` if it owns its corner `i`.
    owned: Vec<u8>,
    /// For the owner of an edge: another triangle at that edge, with another third corner, times four plus the number of its
    /// side; or [`NONE`].
    across: Vec<[u32; 3]>,
    /// Edges of each vertex, vertex after vertex, and where each vertex's begin.
    spokes: Vec<Spoke>,
    starts: Vec<u32>,
}

/// Side of a triangle: its ends, the lower in the high half; the corner opposite, [`NONE`] if the triangle
/// names a position twice. The last number is four times the triangle's index plus the number of the side.
type Key = (u64, u32, u32);

impl Topology {
    pub(crate) fn new(mesh: &VoxelMesh) -> Self {
        let welded = weld(&mesh.vertices);
        let sides = sorted_sides(&mesh.triangles, &welded);
        let mut owned = own_vertices(&mesh.triangles, &welded);
        let mut across = vec![[NONE; 3]; mesh.triangles.len()];
        let mut edges = Vec::new();
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            let owner = edge.iter().map(|side| side.2).min().unwrap_or(0);
            let (face, side) = (owner / 4, (owner % 4) as usize);
            let ends = [0, 1].map(|i| welded[mesh.triangles[face as usize][(side + i) % 3] as usize]);
            let own_corner = welded[mesh.triangles[face as usize][(side + 2) % 3] as usize];
            owned[face as usize] |= 1 << side;
            let other = edge.iter().find(|side| side.1 != NONE && side.1 != own_corner);
            across[face as usize][side] = other.map_or(NONE, |side| side.2);
            edges.push((ends, Side { face, side: side as u8 }));
        }
        let (spokes, starts) = fans(&edges, mesh.vertices.len());
        Self { welded, owned, across, spokes, starts }
    }

    /// Whether a triangle owns its edge `side`.
    pub(crate) fn owns_edge(&self, face: u32, side: usize) -> bool {
        self.owned[face as usize] >> side & 1 != 0
    }

    /// Whether a triangle owns its corner `corner`.
    pub(crate) fn owns_vertex(&self, face: u32, corner: usize) -> bool {
        self.owned[face as usize] >> (3 + corner) & 1 != 0
    }

    /// Another triangle at an edge, if there is one; asked of the edge's owner.
    pub(crate) fn across(&self, face: u32, side: usize) -> Option<Side> {
        let found = self.across[face as usize][side];
        (found != NONE).then_some(Side { face: found / 4, side: (found % 4) as u8 })
    }

    /// The edges at a vertex.
    pub(crate) fn spokes(&self, vertex: u32) -> &[Spoke] {
        let vertex = self.welded[vertex as usize] as usize;
        &self.spokes[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

/// For each vertex the first one at exactly the same position.
fn weld(vertices: &[DVec3]) -> Vec<u32> {
    let mut first = PositionMap::with_capacity_and_hasher(vertices.len(), Default::default());
    vertices.iter().enumerate().map(|(i, v)| *first.entry(position_key(*v)).or_insert(i as u32)).collect()
}

/// The sides of all triangles that are not points, sorted, by way of one bucket for each lower end.
pub(crate) fn sorted_sides(triangles: &[[u32; 3]], welded: &[u32]) -> Vec<Key> {
    let sides = |face: usize| {
        let [a, b, c] = triangles[face].map(|v| welded[v as usize]);
        let proper = a != b && b != c && c != a;
        let sides = [(a, b, c), (b, c, a), (c, a, b)].into_iter().zip(0..);
        sides.filter(|((from, to, _), _)| from != to).map(move |((from, to, opposite), side)| {
            let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
            (key, if proper { opposite } else { NONE }, face as u32 * 4 + side)
        })
    };
    let all = || (0..triangles.len()).flat_map(sides);
    let bucket = |side: &Key| (side.0 >> 32) as usize;
    let starts = running_sums(all().map(|side| bucket(&side)), welded.len());
    let mut next = starts.clone();
    let mut sorted = vec![(0, 0, 0); starts[welded.len()] as usize];
    for side in all() {
        let place = &mut next[bucket(&side)];
        sorted[*place as usize] = side;
        *place += 1;
    }
    for bounds in starts.windows(2) {
        sorted[bounds[0] as usize..bounds[1] as usize].sort_unstable();
    }
    sorted
}

/// Beginning of each bucket, and the end of the last, if items fall into the given buckets.
pub(crate) fn running_sums(items: impl Iterator<Item = usize>, buckets: usize) -> Vec<u32> {
    let mut starts = vec![0u32; buckets + 1];
    for bucket in items {
        starts[bucket + 1] += 1;
    }
    for bucket in 0..buckets {
        starts[bucket + 1] += starts[bucket];
    }
    starts
}

/// Marks in each triangle the corners that it is the first to have.
fn own_vertices(triangles: &[[u32; 3]], welded: &[u32]) -> Vec<u8> {
    let mut seen = vec![false; welded.len()];
    let own = |triangle: &[u32; 3]| {
        (0..3).fold(0, |bits, corner| {
            let vertex = welded[triangle[corner] as usize] as usize;
            bits | u8::from(!std::mem::replace(&mut seen[vertex], true)) << (3 + corner)
        })
    };
    triangles.iter().map(own).collect()
}

/// The edges at every vertex, and where each vertex's begin.
fn fans(edges: &[([u32; 2], Side)], vertices: usize) -> (Vec<Spoke>, Vec<u32>) {
    let starts =
        running_sums(edges.iter().flat_map(|(ends, _)| ends).map(|vertex| *vertex as usize), vertices);
    let mut next = starts.clone();
    let nothing = Spoke { edge: Side { face: NONE, side: 0 }, outward: false };
    let mut spokes = vec![nothing; 2 * edges.len()];
    for (ends, edge) in edges {
        for (vertex, outward) in ends.iter().zip([true, false]) {
            let place = &mut next[*vertex as usize];
            spokes[*place as usize] = Spoke { edge: *edge, outward };
            *place += 1;
        }
    }
    (spokes, starts)
}
