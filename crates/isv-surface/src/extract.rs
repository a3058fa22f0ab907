//! The passes over a volume's blocks.

use crate::edges::EdgeRow;
use crate::normals::CodeWindow;
use crate::signs::{MIN_BLOCKS, PLUS_SLOTS, Signs};
use crate::triangles::{VertexIds, for_each_crossed_cell};
use crate::vertices::EdgeZeros;
use crate::window::SignWindow;
use glam::DVec3;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockEdge, BlockIndex, Neighbourhood, SparseVolume, TriangleMesh};
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
    let surface = debug_span!("surface edges").in_scope(|| SurfaceBlocks::find(volume, &signs));
    debug_span!("surface mesh").in_scope(|| surface.mesh(&signs, options))
}

/// The crossing edges that start in a block.
type EdgeRows<const SIDE: usize> = [[EdgeRow; SIDE]; SIDE];

/// The blocks that hold any part of the surface.
struct SurfaceBlocks<'a, const SIDE: usize> {
    volume: &'a SparseVolume,
    index: BlockIndex,
    /// Their indices in the volume.
    blocks: Vec<u32>,
    edges: Vec<EdgeRows<SIDE>>,
    counts: Vec<Counts>,
}

/// How much of the surface a block holds.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    vertices: u32,
    triangles: u32,
}

impl<'a, const SIDE: usize> SurfaceBlocks<'a, SIDE> {
    fn find(volume: &'a SparseVolume, signs: &Signs<SIDE>) -> Self {
        let index = volume.index();
        let blocks = signs.crossed_blocks(volume, &index);
        let (edges, counts) = blocks
            .par_iter()
            .with_min_len(MIN_BLOCKS)
            .map(|&block| {
                let around = index.neighbourhood(volume.coords()[block as usize]);
                vectorized(
                    #[inline(always)]
                    || find_edges(&SignWindow::gather(signs, &around)),
                )
            })
            .unzip();
        Self { volume, index, blocks, edges, counts }
    }

    fn mesh(&self, signs: &Signs<SIDE>, options: &SurfaceOptions) -> TriangleMesh {
        let first = self.first_vertices();
        let vertex_counts = || self.counts.iter().map(|count| count.vertices as usize);
        let triangle_counts = || self.counts.iter().map(|count| count.triangles as usize);
        let normal_counts = || vertex_counts().map(|count| if options.normals { count } else { 0 });
        let mut mesh = TriangleMesh {
            vertices: bytemuck::zeroed_vec(vertex_counts().sum()),
            normals: bytemuck::zeroed_vec(normal_counts().sum()),
            triangles: bytemuck::zeroed_vec(triangle_counts().sum()),
        };
        let places = carve(&mut mesh.vertices, vertex_counts())
            .zip(carve(&mut mesh.normals, normal_counts()))
            .zip(carve(&mut mesh.triangles, triangle_counts()))
            .map(|((vertices, normals), triangles)| Place { vertices, normals, triangles })
            .collect::<Vec<_>>();
        places.into_par_iter().enumerate().with_min_len(MIN_BLOCKS).for_each_init(
            Scratch::<SIDE>::default,
            |scratch, (place, out)| {
                vectorized(
                    #[inline(always)]
                    || self.fill(place, out, scratch, signs, &first),
                );
            },
        );
        mesh
    }

    /// By the block's index in the volume, its place in the lists and the number of its first vertex.
    fn first_vertices(&self) -> Vec<Option<(u32, u32)>> {
        let mut first = vec![None; self.volume.block_count()];
        let mut sum = 0u32;
        for (place, (block, count)) in self.blocks.iter().zip(&self.counts).enumerate() {
            first[*block as usize] = Some((place as u32, sum));
            sum = sum.checked_add(count.vertices).expect("at most u32::MAX vertices");
        }
        first
    }

    #[inline(always)]
    fn fill(
        &self,
        place: usize,
        out: Place,
        scratch: &mut Scratch<SIDE>,
        signs: &Signs<SIDE>,
        first: &[Option<(u32, u32)>],
    ) {
        let block = self.blocks[place];
        let around = self.index.neighbourhood(self.volume.coords()[block as usize]);
        self.fill_vertices(place, &around, out.vertices, out.normals, signs, &mut scratch.codes);
        self.enter_vertices(&around, first, &mut scratch.ids);
        scratch.ids.fill_triangles(out.triangles, &SignWindow::gather(signs, &around));
    }

    /// Writes the vertices of a block and, unless `normals` is empty, their normals.
    #[inline(always)]
    fn fill_vertices(
        &self,
        place: usize,
        around: &Neighbourhood,
        vertices: &mut [DVec3],
        normals: &mut [DVec3],
        signs: &Signs<SIDE>,
        codes: &mut CodeWindow,
    ) {
        let (volume, block) = (self.volume, self.blocks[place]);
        let next = [around[PLUS_SLOTS[1]], around[PLUS_SLOTS[2]], around[PLUS_SLOTS[4]]];
        let coord = volume.coords()[block as usize];
        let zeros = EdgeZeros::<SIDE>::new(volume.samples(), volume.grid(), coord, block, next);
        if !normals.is_empty() {
            codes.gather(volume, signs, around);
        }
        let mut number = 0;
        for (z, layer) in self.edges[place].iter().enumerate() {
            for (y, row) in layer.iter().enumerate() {
                zeros.for_each(*row, y, z, |zero| {
                    vertices[number] = zero.position_m;
                    if let Some(normal) = normals.get_mut(number) {
                        *normal = codes.normal(&zero);
                    }
                    number += 1;
                });
            }
        }
    }

    /// Enters the vertices that the cells of a block reach.
    #[inline(always)]
    fn enter_vertices(&self, around: &Neighbourhood, first: &[Option<(u32, u32)>], ids: &mut VertexIds<SIDE>) {
        for (step, slot) in PLUS_SLOTS.into_iter().enumerate() {
            let Some((place, first)) = around[slot].and_then(|block| first[block as usize]) else { continue };
            let edges = &self.edges[place as usize];
            let reach = |axis: usize| if step >> axis & 1 == 0 { SIDE } else { 1 };
            let start = |axis: usize| if step >> axis & 1 == 0 { 0 } else { SIDE };
            for z in 0..reach(2) {
                for y in 0..reach(1) {
                    let row = if reach(0) == 1 { edges[z][y].first_voxel() } else { edges[z][y] };
                    ids.enter(row, [start(0), start(1) + y, start(2) + z], first);
                }
            }
        }
    }
}

/// What the threads keep between blocks.
#[derive(Default)]
struct Scratch<const SIDE: usize> {
    codes: CodeWindow,
    ids: VertexIds<SIDE>,
}

/// Where the part of the mesh goes that a block holds.
struct Place<'a> {
    vertices: &'a mut [DVec3],
    normals: &'a mut [DVec3],
    triangles: &'a mut [[u32; 3]],
}

/// The crossing edges that start in a block, and how much of the surface that makes.
#[inline(always)]
fn find_edges<const SIDE: usize>(window: &SignWindow<SIDE>) -> (EdgeRows<SIDE>, Counts) {
    let mut edges = [[EdgeRow::default(); SIDE]; SIDE];
    let mut counts = Counts::default();
    for (z, layer) in edges.iter_mut().enumerate() {
        let crossings = window.crossings(z);
        for (y, row) in layer.iter_mut().enumerate() {
            *row = EdgeRow::new([crossings[0][y], crossings[1][y], crossings[2][y]], counts.vertices);
            counts.vertices += row.count();
        }
    }
    for_each_crossed_cell(window, |_, case| counts.triangles += case.triangles().len() as u32);
    (edges, counts)
}

/// Cuts a slice into consecutive pieces of the given lengths.
fn carve<T>(mut rest: &mut [T], lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = &mut [T]> {
    lengths.map(move |length| {
        let (piece, tail) = std::mem::take(&mut rest).split_at_mut(length);
        rest = tail;
        piece
    })
}
