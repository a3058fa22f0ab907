//! Boundary of a mesh: the edges at which it is not closed.
//!
//! Vertices at exactly the same position count as one, as exporters split them along texture seams. By the
//! vertices that triangles name, most edges are run along as often one way as the other. So positions are
//! compared only around the others.

use crate::tiles::VoxelMesh;
use crate::topology::{NONE, Side};
use glam::DVec3;
use isv_spatial::{PositionMap, position_key};
use rayon::prelude::*;

/// The boundary of a mesh.
pub(crate) struct Boundary {
    /// The edges with one face, whichever way that faces.
    pub(crate) rims: Vec<Rim>,
    /// The boundary of the mesh as a chain: its sides added up, of which opposite ones cancel out. It has the
    /// ends of edges in the direction of the sides that are too many, each as often as there are too many. As
    /// many begin at a vertex as end there.
    pub(crate) chain: Vec<[u32; 2]>,
    /// For each vertex on the boundary the first one at exactly the same position, and [`NONE`] for others.
    /// Some vertices that are not on the boundary may be known as well. Empty if nothing is on the boundary.
    welded: Vec<u32>,
}

/// An edge with one face, in the direction of that face.
pub(crate) struct Rim {
    /// Ends of the edge, by the first vertices at their positions.
    pub(crate) from: u32,
    pub(crate) to: u32,
    /// The first triangle that has it, and which of its sides it is.
    pub(crate) side: Side,
}

/// A side of a triangle between suspects.
struct SuspectSide {
    /// Ends of the edge, the lower in the high half.
    ends: u64,
    /// The corner opposite, [`NONE`] if the triangle names a position twice.
    opposite: u32,
    /// Four times the triangle's index plus the number of the side.
    number: u32,
    /// Whether it runs from the lower end to the higher.
    is_upward: bool,
}

impl Boundary {
    pub(crate) fn new(mesh: &VoxelMesh) -> Self {
        let suspects = suspects(mesh);
        let mut boundary = Self { rims: Vec::new(), chain: Vec::new(), welded: Vec::new() };
        if !suspects.contains(&true) {
            return boundary;
        }
        boundary.welded = weld(&mesh.vertices, &suspects);
        let mut sides = suspect_sides(mesh, &boundary.welded);
        sides.par_sort_unstable_by_key(|side| (side.ends, side.number));
        for edge in sides.chunk_by(|a, b| a.ends == b.ends) {
            boundary.add_edge(edge);
        }
        boundary
    }

    /// The first vertex at the position of one, if that is on the boundary.
    pub(crate) fn welded(&self, vertex: u32) -> Option<u32> {
        self.welded.get(vertex as usize).copied().filter(|first| *first != NONE)
    }

    /// Looks at all sides at an edge, of which the lowest number is first.
    fn add_edge(&mut self, sides: &[SuspectSide]) {
        let [low, high] = [(sides[0].ends >> 32) as u32, sides[0].ends as u32];
        let upward: i32 = sides.iter().map(|side| if side.is_upward { 1 } else { -1 }).sum();
        let edge = if upward > 0 { [low, high] } else { [high, low] };
        self.chain.extend((0..upward.abs()).map(|_| edge));
        // Duplicates of a face do not hide a rim. Faces that name a position twice have no area and border nothing.
        let mut opposite = sides.iter().map(|side| side.opposite).filter(|corner| *corner != NONE);
        if let Some(first) = opposite.next()
            && opposite.all(|corner| corner == first)
        {
            let SuspectSide { number, is_upward, .. } = sides[0];
            let [from, to] = if is_upward { [low, high] } else { [high, low] };
            self.rims.push(Rim { from, to, side: Side { face: number / 4, side: (number % 4) as u8 } });
        }
    }
}

/// Whether each vertex may be the end of an edge that triangles run along more often one way than the other.
/// Edges are told apart by the vertices that triangles name. All that are such ends are found, but for a
/// chance of one in 2^64.
fn suspects(mesh: &VoxelMesh) -> Vec<bool> {
    // Each side adds what stands for its other end at its start, and takes it away at its end: sides that run both ways leave nothing.
    let mut sums = vec![0u64; mesh.vertices.len()];
    for &[a, b, c] in mesh.triangles.iter() {
        let [at_a, at_b, at_c] = [a, b, c].map(scramble);
        sums[a as usize] = sums[a as usize].wrapping_add(at_b).wrapping_sub(at_c);
        sums[b as usize] = sums[b as usize].wrapping_add(at_c).wrapping_sub(at_a);
        sums[c as usize] = sums[c as usize].wrapping_add(at_a).wrapping_sub(at_b);
    }
    sums.into_iter().map(|sum| sum != 0).collect()
}

/// A number that stands for a vertex and has nothing to do with those of others (Steele et al. 2014, "Fast splittable pseudorandom
/// number generators").
fn scramble(vertex: u32) -> u64 {
    let mut bits = (u64::from(vertex) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ bits >> 31
}

/// For each vertex at the position of a suspect the first one there, and [`NONE`] for all others.
fn weld(vertices: &[DVec3], suspects: &[bool]) -> Vec<u32> {
    let places = vertices.iter().zip(suspects).filter(|(_, suspect)| **suspect);
    let mut first: PositionMap<u32> = places.map(|(v, _)| (position_key(*v), NONE)).collect();
    let at_suspects: Vec<u32> = (0..vertices.len() as u32)
        .into_par_iter()
        .filter(|vertex| first.contains_key(&position_key(vertices[*vertex as usize])))
        .collect();
    let mut welded = vec![NONE; vertices.len()];
    for vertex in at_suspects {
        let first = first.entry(position_key(vertices[vertex as usize])).or_insert(NONE);
        *first = (*first).min(vertex);
        welded[vertex as usize] = *first;
    }
    welded
}

/// The sides of triangles between suspects.
fn suspect_sides(mesh: &VoxelMesh, welded: &[u32]) -> Vec<SuspectSide> {
    let sides = |face: usize| {
        let triangle = mesh.triangles[face];
        let known = triangle.map(|v| welded[v as usize]);
        let is_beside = known.iter().filter(|v| **v != NONE).count() >= 2;
        let [a, b, c] = [0, 1, 2].map(|i| if known[i] == NONE { triangle[i] } else { known[i] });
        let proper = a != b && b != c && c != a;
        let all = [(a, b, c), (b, c, a), (c, a, b)].into_iter().enumerate();
        all.filter(move |(side, (from, to, _))| {
            is_beside && known[*side] != NONE && known[(side + 1) % 3] != NONE && from != to
        })
        .map(move |(side, (from, to, opposite))| SuspectSide {
            ends: u64::from(from.min(to)) << 32 | u64::from(from.max(to)),
            opposite: if proper { opposite } else { NONE },
            number: face as u32 * 4 + side as u32,
            is_upward: from < to,
        })
    };
    (0..mesh.triangles.len()).into_par_iter().flat_map_iter(sides).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{cube, open_box, sheet};
    use isv_volume::TriangleMesh;
    use std::collections::BTreeMap;

    fn boundary_of(mesh: &TriangleMesh) -> Boundary {
        Boundary::new(&VoxelMesh { vertices: mesh.vertices.clone(), triangles: (&mesh.triangles).into() })
    }

    #[test]
    fn a_closed_mesh_has_none_however_its_vertices_are_named() {
        let mut mesh = cube(1.0);
        assert!(boundary_of(&mesh).chain.is_empty() && boundary_of(&mesh).rims.is_empty());
        mesh.vertices = (0..mesh.triangles.len()).flat_map(|f| mesh.corners(f)).collect();
        mesh.triangles = (0..mesh.triangles.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        assert!(boundary_of(&mesh).chain.is_empty() && boundary_of(&mesh).rims.is_empty());
    }

    #[test]
    fn the_chain_is_a_cycle_and_counts_what_is_there_twice() {
        let mut mesh = open_box(1.0);
        assert_eq!((boundary_of(&mesh).chain.len(), boundary_of(&mesh).rims.len()), (4, 4));
        mesh.triangles.extend_from_within(..);
        // One more, the wrong way round.
        mesh.triangles.push([mesh.triangles[0][0], mesh.triangles[0][2], mesh.triangles[0][1]]);
        let Boundary { rims, chain, .. } = boundary_of(&mesh);
        assert_eq!((chain.len(), rims.len()), (8 + 3, 4));
        let mut balance = BTreeMap::new();
        for [from, to] in chain {
            *balance.entry(from).or_insert(0) += 1;
            *balance.entry(to).or_insert(0) -= 1;
        }
        assert!(balance.values().all(|sum| *sum == 0));
    }

    #[test]
    fn sides_that_run_the_same_way_are_in_the_chain_and_no_rim() {
        let mut mesh = sheet(1.0);
        let rims = boundary_of(&mesh).rims.len();
        let first = &mut mesh.triangles[0];
        first.swap(0, 1);
        let Boundary { rims: after, chain, .. } = boundary_of(&mesh);
        assert_eq!(after.len(), rims);
        assert!(chain.len() > rims);
    }
}
