//! The passes over a volume's blocks.

use crate::chunk::{CHUNK, Chunk, Counts};
use crate::fill::{Numbering, Place, Scratch};
use crate::signs::Signs;
use bytemuck::{Zeroable, zeroed_vec};
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, SparseVolume, TriangleMesh};
use rayon::prelude::*;
use thiserror::Error;
use tracing::debug_span;

/// What to extract beside positions and triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceOptions {
    /// Whether vertices get normals: the unit gradient of the field, which is smoother than the triangles.
    pub normals: bool,
}

/// A surface that is larger than the caller allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("a surface of {vertices} vertices, above the limit of {limit}")]
pub struct TooManyVertices {
    /// Vertices it has.
    pub vertices: usize,
    /// The caller's limit.
    pub limit: usize,
}

/// Zero crossing of a volume as an indexed mesh. Positions are in metres, and triangles counter-clockwise
/// seen from the outside (positive codes). There is one vertex an edge, and no vertex without a triangle.
///
/// - Code 0 counts as outside.
/// - A cell with a corner in a missing block or at an unobserved voxel gets no triangles: the mesh ends there.
/// - Vertices are in the order of the voxel where their edge starts, triangles in that of their cell's lowest
///   corner. That is blocks in Morton order, then z, y, x.
///
/// # Panics
/// If the surface has more than `u32::MAX` vertices, which takes over 10^9 voxels.
#[must_use]
pub fn extract_surface(volume: &SparseVolume, options: &SurfaceOptions) -> TriangleMesh {
    let mut extractor = SurfaceExtractor::new(*options);
    extractor.extract(volume);
    extractor.into_mesh()
}

/// Extracts the surfaces of one volume after another, as [`extract_surface`] does, into the same memory.
#[derive(Clone, Debug, Default)]
pub struct SurfaceExtractor {
    options: SurfaceOptions,
    mesh: TriangleMesh,
}

impl SurfaceExtractor {
    /// An extractor that has no surface yet.
    #[must_use]
    pub fn new(options: SurfaceOptions) -> Self {
        Self { options, mesh: TriangleMesh::default() }
    }

    /// The surface of a volume, until the next one is extracted.
    ///
    /// # Panics
    /// As [`extract_surface`].
    pub fn extract(&mut self, volume: &SparseVolume) -> &TriangleMesh {
        self.extract_within(volume, u32::MAX as usize).expect("at most u32::MAX vertices")
    }

    /// [`Self::extract`], unless the surface has more vertices than `limit`, which is `u32::MAX` at most. Found out before there is
    /// memory for any of them.
    ///
    /// # Errors
    /// [`TooManyVertices`]; the last surface is what it was.
    pub fn extract_within(
        &mut self,
        volume: &SparseVolume,
        limit: usize,
    ) -> Result<&TriangleMesh, TooManyVertices> {
        extract_blocks(volume, self.options, limit, &mut self.mesh, |_| ())?;
        Ok(&self.mesh)
    }

    /// The last surface.
    #[must_use]
    pub fn into_mesh(self) -> TriangleMesh {
        self.mesh
    }
}

/// What a block has of a mesh: that many vertices and triangles behind those of the blocks before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockShare {
    pub(crate) block: BlockCoord,
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
}

/// Extracts the surface of a volume into a mesh, and hands the shares of its blocks to `shares`, in order.
pub(crate) fn extract_blocks<T>(
    volume: &SparseVolume,
    options: SurfaceOptions,
    limit: usize,
    mesh: &mut TriangleMesh,
    shares: impl FnOnce(&mut dyn Iterator<Item = BlockShare>) -> T + Send,
) -> Result<T, TooManyVertices>
where
    T: Send,
{
    // Within the pool of threads: from outside, each parallel loop would put this thread to sleep and wake it again.
    rayon::scope(|_| match volume.grid().edge {
        BlockEdge::E4 => extract::<4, T>(volume, &options, limit, mesh, shares),
        BlockEdge::E8 => extract::<8, T>(volume, &options, limit, mesh, shares),
        BlockEdge::E16 => extract::<16, T>(volume, &options, limit, mesh, shares),
    })
}

fn extract<const SIDE: usize, T>(
    volume: &SparseVolume,
    options: &SurfaceOptions,
    limit: usize,
    mesh: &mut TriangleMesh,
    shares: impl FnOnce(&mut dyn Iterator<Item = BlockShare>) -> T,
) -> Result<T, TooManyVertices> {
    let signs = debug_span!("surface signs").in_scope(|| Signs::<SIDE>::new(volume));
    let surface = debug_span!("surface cells").in_scope(|| Surface::find(volume, signs));
    let vertices = surface.chunks.iter().map(|chunk| chunk.total().vertices).sum();
    if vertices > limit {
        return Err(TooManyVertices { vertices, limit });
    }
    debug_span!("surface mesh").in_scope(|| surface.fill(options, mesh));
    Ok(shares(&mut surface.shares()))
}

/// The blocks that hold any part of a volume's surface.
pub(crate) struct Surface<'a, const SIDE: usize> {
    pub(crate) volume: &'a SparseVolume,
    pub(crate) signs: Signs<SIDE>,
    pub(crate) index: BlockIndex,
    /// Their indices in the volume.
    pub(crate) blocks: Vec<u32>,
    /// What is in them, [`CHUNK`] blocks at a time.
    pub(crate) chunks: Vec<Chunk<SIDE>>,
}

impl<'a, const SIDE: usize> Surface<'a, SIDE> {
    fn find(volume: &'a SparseVolume, signs: Signs<SIDE>) -> Self {
        let index = volume.index();
        let blocks = signs.crossed_blocks(volume, &index);
        let find = |blocks: &[u32]| {
            vectorized(
                #[inline(always)]
                || Chunk::find(volume, &signs, &index, blocks),
            )
        };
        let chunks = blocks.par_chunks(CHUNK).map(find).collect();
        Self { volume, signs, index, blocks, chunks }
    }

    fn shares(&self) -> impl Iterator<Item = BlockShare> {
        let counts = self.chunks.iter().flat_map(|chunk| &chunk.counts);
        self.blocks.iter().zip(counts).map(|(block, counts)| BlockShare {
            block: self.volume.coords()[*block as usize],
            vertices: counts.vertices,
            triangles: counts.triangles,
        })
    }

    fn fill(&self, options: &SurfaceOptions, mesh: &mut TriangleMesh) {
        let totals: Vec<Counts> = self.chunks.iter().map(Chunk::total).collect();
        let vertex_counts = || totals.iter().map(|total| total.vertices);
        let normal_counts = || vertex_counts().map(|count| if options.normals { count } else { 0 });
        let triangle_counts = || totals.iter().map(|total| total.triangles);
        resize(&mut mesh.vertices, vertex_counts().sum());
        resize(&mut mesh.normals, normal_counts().sum());
        resize(&mut mesh.triangles, triangle_counts().sum());
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
    }
}

/// Makes a list as long as wanted, whatever is in it. Fresh memory is zeros that the system gives when it is written to.
fn resize<T: Zeroable + Clone>(list: &mut Vec<T>, length: usize) {
    if list.capacity() < length {
        *list = zeroed_vec(length);
    }
    list.resize(length, T::zeroed());
}

/// Cuts a slice into consecutive pieces of the given lengths.
fn carve<T>(mut rest: &mut [T], lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = &mut [T]> {
    lengths.map(move |length| rest.split_off_mut(..length).expect("lengths that add up to the slice's"))
}
