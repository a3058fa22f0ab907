//! The passes over a volume's blocks.

use crate::bits::{PaddedBits, SignRows};
use crate::edges::EdgeRow;
use crate::triangles::{VertexIds, fill_triangles, for_each_crossed_cell};
use crate::vertices::Sampler;
use glam::DVec3;
use isv_volume::{BlockEdge, Neighbourhood, SparseVolume, TriangleMesh};
use rayon::prelude::*;

/// What to extract beside positions and triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceOptions {
    /// Whether vertices get normals: the unit gradient of the field, which is smoother than the triangles.
    pub normals: bool,
}

/// The zero crossing of a volume as an indexed mesh: positions in metres, triangles counter-clockwise seen from the
/// outside (positive codes), one vertex an edge, no vertex without a triangle.
///
/// - Code 0 counts as outside.
/// - A cell with a corner in a missing block or at an unobserved voxel gets no triangles: the mesh ends there.
/// - Vertices are in the order of the voxel where their edge starts, triangles in that of their cell's lowest corner:
///   blocks in Morton order, then z, y, x.
///
/// # Panics
/// If the surface has more than `u32::MAX` vertices, which takes over 10^9 voxels.
#[must_use]
pub fn extract_surface(volume: &SparseVolume, options: &SurfaceOptions) -> TriangleMesh {
    let edge = volume.grid().edge;
    let signs = SignRows::new(volume);
    let (rows, blocks) = find_crossings(volume, &signs);
    let first = first_vertices(volume.block_count(), &blocks);
    let vertex_counts = || blocks.iter().map(|b| b.vertices as usize);

    let vertex_total = vertex_counts().sum();
    let mut mesh = TriangleMesh {
        vertices: vec![DVec3::ZERO; vertex_total],
        normals: vec![DVec3::ZERO; if options.normals { vertex_total } else { 0 }],
        triangles: vec![[0; 3]; blocks.iter().map(|b| b.triangles as usize).sum()],
    };
    let normal_counts = vertex_counts().map(|n| if options.normals { n } else { 0 });
    let places = carve(&mut mesh.vertices, vertex_counts())
        .zip(carve(&mut mesh.normals, normal_counts))
        .zip(carve(&mut mesh.triangles, blocks.iter().map(|b| b.triangles as usize)))
        .collect::<Vec<_>>();
    let ids = VertexIds { edge, rows: &rows, first: &first };
    blocks.par_iter().zip(places).for_each(|(block, ((vertices, normals), triangles))| {
        let sampler = Sampler { volume, signs: &signs, around: &block.around };
        fill_vertices(vertices, normals, &sampler, block.index, &rows);
        if block.triangles > 0 {
            fill_triangles(triangles, &PaddedBits::gather(&signs, &block.around), &block.around, &ids);
        }
    });
    mesh
}

/// A block that has vertices or triangles.
struct SurfaceBlock {
    index: usize,
    around: Neighbourhood,
    vertices: u32,
    triangles: u32,
}

/// The crossing edges of all blocks, `edge^2` rows each, and the blocks that hold any part of the surface.
fn find_crossings(volume: &SparseVolume, signs: &SignRows) -> (Vec<EdgeRow>, Vec<SurfaceBlock>) {
    let edge = volume.grid().edge;
    let rows_a_block = edge.voxels().pow(2);
    let index = volume.index();
    let mut rows = vec![EdgeRow::default(); volume.block_count() * rows_a_block];
    let blocks = rows
        .par_chunks_exact_mut(rows_a_block)
        .zip(volume.coords())
        .enumerate()
        .filter_map(|(block, (rows, &coord))| {
            let around = index.neighbourhood(coord);
            if !signs.may_cross(&around) {
                return None;
            }
            let bits = PaddedBits::gather(signs, &around);
            let vertices = find_edges(rows, &bits, edge);
            let mut triangles = 0;
            for_each_crossed_cell(&bits, edge, |_, case| triangles += case.triangles().len() as u32);
            (vertices + triangles > 0).then_some(SurfaceBlock { index: block, around, vertices, triangles })
        })
        .collect();
    (rows, blocks)
}

/// Fills in the crossing edges that start in a block; returns how many there are.
fn find_edges(rows: &mut [EdgeRow], bits: &PaddedBits, edge: BlockEdge) -> u32 {
    let side = edge.voxels();
    let mut count = 0;
    for (i, row) in rows.iter_mut().enumerate() {
        *row = EdgeRow::new(bits.crossings(i % side, i / side), count);
        count += row.count();
    }
    count
}

/// Number of the first vertex of every block; 0 for blocks without any.
fn first_vertices(block_count: usize, blocks: &[SurfaceBlock]) -> Vec<u32> {
    let mut first = vec![0; block_count];
    let mut sum = 0u32;
    for block in blocks {
        first[block.index] = sum;
        sum = sum.checked_add(block.vertices).expect("at most u32::MAX vertices");
    }
    first
}

/// Cuts a slice into consecutive pieces of the given lengths.
fn carve<T>(mut rest: &mut [T], lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = &mut [T]> {
    lengths.map(move |length| {
        let (piece, tail) = std::mem::take(&mut rest).split_at_mut(length);
        rest = tail;
        piece
    })
}

/// Writes the vertices of a block and, unless `normals` is empty, their normals.
fn fill_vertices(
    vertices: &mut [DVec3],
    normals: &mut [DVec3],
    sampler: &Sampler,
    block: usize,
    rows: &[EdgeRow],
) {
    let grid = sampler.volume.grid();
    let side = grid.edge.voxels();
    let origin_m = grid.voxel_centre_m(sampler.volume.coords()[block], [0; 3]);
    let rows_a_block = side * side;
    let mut next = 0;
    for (i, row) in rows[block * rows_a_block..][..rows_a_block].iter().enumerate() {
        for (x, axis) in row.iter() {
            let crossing = sampler.crossing([x, i % side, i / side], axis);
            vertices[next] = crossing.position_m(origin_m, grid.voxel_size.metres());
            if let Some(normal) = normals.get_mut(next) {
                *normal = sampler.normal(&crossing);
            }
            next += 1;
        }
    }
}
