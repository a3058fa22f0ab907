//! The passes over a volume's blocks.

use crate::edges::EdgeRow;
use crate::normals::CodeWindow;
use crate::signs::{PLUS_SLOTS, Signs};
use crate::triangles::{CrossedCell, VertexIds, entry, find_cells};
use crate::vertices::EdgeZeros;
use crate::window::SignWindow;
use bytemuck::zeroed_vec;
use glam::DVec3;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockEdge, BlockIndex, NeighbourWalk, Neighbourhood, SparseVolume, TriangleMesh};
use rayon::prelude::*;
use tracing::debug_span;

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
    match volume.grid().edge {
        BlockEdge::E4 => extract::<4>(volume, options),
        BlockEdge::E8 => extract::<8>(volume, options),
        BlockEdge::E16 => extract::<16>(volume, options),
    }
}

fn extract<const SIDE: usize>(volume: &SparseVolume, options: &SurfaceOptions) -> TriangleMesh {
    let signs = debug_span!("surface signs").in_scope(|| Signs::<SIDE>::new(volume));
    let surface = debug_span!("surface edges").in_scope(|| Surface::find(volume, signs));
    debug_span!("surface mesh").in_scope(|| surface.mesh(options))
}

/// Blocks that a thread works on at a time.
const CHUNK: usize = 64;

/// The crossing edges that start in a block.
type EdgeRows<const SIDE: usize> = [[EdgeRow; SIDE]; SIDE];

/// The blocks that hold any part of the surface.
struct Surface<'a, const SIDE: usize> {
    volume: &'a SparseVolume,
    signs: Signs<SIDE>,
    index: BlockIndex,
    /// Their indices in the volume.
    blocks: Vec<u32>,
    /// What is in them, so many blocks at a time.
    chunks: Vec<Chunk<SIDE>>,
}

/// What is in some blocks.
#[derive(Default)]
struct Chunk<const SIDE: usize> {
    edges: Vec<EdgeRows<SIDE>>,
    counts: Vec<Counts>,
    /// Block after block.
    cells: Vec<CrossedCell>,
}

/// How much of the surface a block or more of them hold.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    vertices: usize,
    triangles: usize,
    cells: usize,
}

impl<'a, const SIDE: usize> Surface<'a, SIDE> {
    fn find(volume: &'a SparseVolume, signs: Signs<SIDE>) -> Self {
        let index = volume.index();
        let blocks = signs.crossed_blocks(volume, &index);
        let chunks = blocks
            .par_chunks(CHUNK)
            .map(|blocks| {
                vectorized(
                    #[inline(always)]
                    || Chunk::find(volume, &signs, &index, blocks),
                )
            })
            .collect();
        Self { volume, signs, index, blocks, chunks }
    }

    fn mesh(&self, options: &SurfaceOptions) -> TriangleMesh {
        let totals: Vec<Counts> = self.chunks.iter().map(Chunk::total).collect();
        let vertex_counts = || totals.iter().map(|total| total.vertices);
        let normal_counts = || vertex_counts().map(|count| if options.normals { count } else { 0 });
        let triangle_counts = || totals.iter().map(|total| total.triangles);
        let mut mesh = TriangleMesh {
            vertices: zeroed_vec(vertex_counts().sum()),
            normals: zeroed_vec(normal_counts().sum()),
            triangles: zeroed_vec(triangle_counts().sum()),
        };
        let numbering = Numbering::new(self);
        let places = carve(&mut mesh.vertices, vertex_counts())
            .zip(carve(&mut mesh.normals, normal_counts()))
            .zip(carve(&mut mesh.triangles, triangle_counts()))
            .map(|((vertices, normals), triangles)| Place { vertices, normals, triangles })
            .collect::<Vec<_>>();
        places.into_par_iter().enumerate().for_each_init(Scratch::default, |scratch, (number, place)| {
            vectorized(
                #[inline(always)]
                || self.fill_chunk(number, place, &numbering, scratch),
            );
        });
        mesh
    }

    /// Writes the part of the mesh that the blocks of a chunk hold.
    #[inline(always)]
    fn fill_chunk(&self, number: usize, mut place: Place, numbering: &Numbering, scratch: &mut Scratch) {
        let chunk = &self.chunks[number];
        let mut walk = NeighbourWalk::new(&self.index);
        let mut cells = &chunk.cells[..];
        for (i, counts) in chunk.counts.iter().enumerate() {
            let block = number * CHUNK + i;
            let around = walk.neighbourhood(self.volume.coords()[self.blocks[block] as usize]);
            let part = place.split_off(counts);
            let (cells_here, others) = cells.split_at(counts.cells);
            cells = others;
            if !part.normals.is_empty() {
                scratch.codes.gather(self.volume, &self.signs, &around);
            }
            self.fill_vertices(block, &around, numbering, part.vertices, part.normals, scratch);
            self.enter_neighbours(&around, numbering, &mut scratch.ids);
            scratch.ids.fill_triangles(part.triangles, cells_here);
        }
    }

    /// Writes the vertices of a block, enters them and, unless `normals` is empty, writes their normals.
    #[inline(always)]
    fn fill_vertices(
        &self,
        block: usize,
        around: &Neighbourhood,
        numbering: &Numbering,
        vertices: &mut [DVec3],
        normals: &mut [DVec3],
        scratch: &mut Scratch,
    ) {
        let zeros = EdgeZeros::<SIDE>::new(self.volume, self.blocks[block], around);
        let first = numbering.first[block];
        let mut number = 0;
        for (z, layer) in self.edges(block).iter().enumerate() {
            for (y, row) in layer.iter().enumerate() {
                let start = entry([0, y, z]);
                for edge in row.edges() {
                    let zero = zeros.on_edge([edge / 3, y, z], edge % 3);
                    zeros.place(&zero, &mut vertices[number]);
                    scratch.ids.set(start + edge, first + number as u32);
                    if let Some(normal) = normals.get_mut(number) {
                        *normal = scratch.codes.normal(&zero);
                    }
                    number += 1;
                }
            }
        }
    }

    /// Enters the vertices of the neighbours that the cells of a block reach.
    #[inline(always)]
    fn enter_neighbours(&self, around: &Neighbourhood, numbering: &Numbering, ids: &mut VertexIds) {
        for (step, slot) in PLUS_SLOTS.into_iter().enumerate().skip(1) {
            let Some((block, first)) = around[slot].and_then(|block| numbering.get(block)) else { continue };
            let edges = self.edges(block);
            let next = [step & 1 != 0, step & 2 != 0, step & 4 != 0];
            let start = next.map(|next| if next { SIDE } else { 0 });
            let reach = next.map(|next| if next { 1 } else { SIDE });
            for z in 0..reach[2] {
                for y in 0..reach[1] {
                    let row = if next[0] { edges[z][y].first_voxel() } else { edges[z][y] };
                    ids.enter(row, [start[0], start[1] + y, start[2] + z], first);
                }
            }
        }
    }

    #[inline(always)]
    fn edges(&self, block: usize) -> &EdgeRows<SIDE> {
        &self.chunks[block / CHUNK].edges[block % CHUNK]
    }
}

impl<const SIDE: usize> Chunk<SIDE> {
    #[inline(always)]
    fn find(volume: &SparseVolume, signs: &Signs<SIDE>, index: &BlockIndex, blocks: &[u32]) -> Self {
        let mut chunk = Self {
            edges: Vec::with_capacity(blocks.len()),
            counts: Vec::with_capacity(blocks.len()),
            // As many as in a plane across each block.
            cells: Vec::with_capacity(blocks.len() * SIDE * SIDE),
        };
        let mut walk = NeighbourWalk::new(index);
        for &block in blocks {
            let around = walk.neighbourhood(volume.coords()[block as usize]);
            let window = SignWindow::gather(signs, &around);
            let (edges, vertices) = find_edges(&window);
            chunk.edges.push(edges);
            let cells_before = chunk.cells.len();
            let triangles = find_cells(&window, &mut chunk.cells);
            chunk.counts.push(Counts { vertices, triangles, cells: chunk.cells.len() - cells_before });
        }
        chunk
    }

    fn total(&self) -> Counts {
        self.counts.iter().fold(Counts::default(), |sum, count| Counts {
            vertices: sum.vertices + count.vertices,
            triangles: sum.triangles + count.triangles,
            cells: sum.cells + count.cells,
        })
    }
}

/// The crossing edges that start in a block, and how many there are.
#[inline(always)]
fn find_edges<const SIDE: usize>(window: &SignWindow<SIDE>) -> (EdgeRows<SIDE>, usize) {
    let mut edges = [[EdgeRow::default(); SIDE]; SIDE];
    let mut count = 0;
    for (z, layer) in edges.iter_mut().enumerate() {
        let crossings = window.crossings(z);
        for y in 0..SIDE {
            layer[y] = EdgeRow::new([crossings[0][y], crossings[1][y], crossings[2][y]]);
        }
        for row in layer {
            *row = row.with_first(count);
            count += row.count();
        }
    }
    (edges, count as usize)
}

/// The numbers of the blocks among those of the surface, and of their first vertices.
struct Numbering {
    /// Of each block of the volume, one more than its number among those of the surface; 0 for the others.
    numbers: Vec<u32>,
    first: Vec<u32>,
}

impl Numbering {
    fn new<const SIDE: usize>(surface: &Surface<SIDE>) -> Self {
        let mut numbers = vec![0; surface.volume.block_count()];
        for (number, block) in (1..).zip(&surface.blocks) {
            numbers[*block as usize] = number;
        }
        let counts = surface.chunks.iter().flat_map(|chunk| &chunk.counts);
        let mut sum = 0u32;
        let first = counts.map(|count| {
            let first = sum;
            sum = sum.checked_add(count.vertices as u32).expect("at most u32::MAX vertices");
            first
        });
        Self { first: first.collect(), numbers }
    }

    /// The number of a block and that of its first vertex, if it holds any of the surface.
    #[inline(always)]
    fn get(&self, block: u32) -> Option<(usize, u32)> {
        let number = self.numbers[block as usize].checked_sub(1)? as usize;
        Some((number, self.first[number]))
    }
}

/// What a thread keeps between chunks.
#[derive(Default)]
struct Scratch {
    codes: CodeWindow,
    ids: VertexIds,
}

/// Where a part of the mesh goes.
struct Place<'a> {
    vertices: &'a mut [DVec3],
    normals: &'a mut [DVec3],
    triangles: &'a mut [[u32; 3]],
}

impl<'a> Place<'a> {
    /// Takes so much from the front.
    #[inline(always)]
    fn split_off(&mut self, counts: &Counts) -> Self {
        let normals = if self.normals.is_empty() { 0 } else { counts.vertices };
        let enough = "a place for each vertex and triangle";
        Self {
            vertices: self.vertices.split_off_mut(..counts.vertices).expect(enough),
            normals: self.normals.split_off_mut(..normals).expect(enough),
            triangles: self.triangles.split_off_mut(..counts.triangles).expect(enough),
        }
    }
}

/// Cuts a slice into consecutive pieces of the given lengths.
fn carve<T>(mut rest: &mut [T], lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = &mut [T]> {
    lengths.map(move |length| {
        let (piece, tail) = std::mem::take(&mut rest).split_at_mut(length);
        rest = tail;
        piece
    })
}
