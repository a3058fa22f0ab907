//! Surfaces of volumes, on the GPU: what `isv_surface::extract_surface` does, with the same vertices and triangles in the same order.
//!
//! 1. The signs of each block become bits (`surface_signs.wgsl`).
//! 2. Each block that the surface can cross finds the edges and cells that it crosses there. It counts the vertices and triangles
//!    that they make (`surface_count.wgsl`); prefix sums number them.
//! 3. The two totals are read back, to make room for the mesh. It is split into parts where it is larger than a kernel may see.
//! 4. Each block writes its vertices (`surface_positions.wgsl`), their normals (`surface_normals.wgsl`) and its triangles
//!    (`surface_triangles.wgsl`).

pub(crate) mod kernels;
mod mesh;
#[cfg(test)]
mod tests;

pub use mesh::GpuMesh;

use crate::commands::Commands;
use crate::kernel::Kernel;
use crate::pool::SamplePool;
use crate::prefix_sums::PrefixSums;
use crate::storage::{GrowingBuffer, Usage, write};
use crate::volume::MaskTable;
use crate::{Gpu, GpuError, GpuVolume, Storage, VolumeStore};
use isv_surface::SurfaceOptions;
use kernels::Kernels;
use mesh::{Parts, Share};

/// Bytes of what is known of a block: `SurfaceBlock` in `surface_blocks.wgsl`.
const SURFACE_BLOCK_BYTES: u64 = 4 * 33;
/// Bytes of the crossing edges that start in a block: `surface_edges.wgsl`.
const EDGES_BYTES: u64 = 8 * 32;

/// Extracts the surfaces of volumes on a GPU, one after another, with the same working memory.
#[derive(Debug)]
pub struct GpuSurfaceExtractor {
    gpu: Gpu,
    kernels: Kernels,
    sums: PrefixSums,
    cases: Storage,
    /// Masks of a volume that was observed in full.
    no_masks: MaskTable,
    surface: GrowingBuffer,
    edges: GrowingBuffer,
    /// Numbers of vertices and triangles before each block, and before the end.
    first: GrowingBuffer,
    totals: GrowingBuffer,
}

impl GpuSurfaceExtractor {
    /// For volumes of a store.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::Refused`].
    pub fn new(store: &VolumeStore, options: SurfaceOptions) -> Result<Self, GpuError> {
        let gpu = store.gpu();
        let cases = kernels::cases();
        let extractor = Self {
            gpu: gpu.clone(),
            kernels: Kernels::new(gpu, options)?,
            sums: PrefixSums::new(gpu)?,
            cases: gpu.storage("surface cases", size_of_val(&cases) as u64, Usage::Kernels)?,
            no_masks: MaskTable {
                numbers: gpu.storage("mask numbers", 4, Usage::Kernels)?,
                words: gpu.storage("masks", 4, Usage::Kernels)?,
            },
            surface: GrowingBuffer::new("signs of blocks"),
            edges: GrowingBuffer::new("crossing edges"),
            first: GrowingBuffer::new("vertices before blocks"),
            totals: GrowingBuffer::for_reading("vertices and triangles of a surface"),
        };
        write(gpu, &extractor.cases, 0, bytemuck::cast_slice(&cases));
        Ok(extractor)
    }

    /// The zero crossing of a volume: the mesh of `isv_surface::extract_surface`, with positions and normals rounded to `f32`.
    ///
    /// Positions are within 2^-22 of a coordinate and 10^-6 of a voxel of those there.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if it has 2^32 - 1 vertices or triangles or more, [`GpuError::OutOfMemory`] if it does not fit, and what
    /// else goes wrong on the GPU.
    pub fn extract(&mut self, volume: &GpuVolume) -> Result<GpuMesh, GpuError> {
        if volume.block_count() == 0 {
            return Ok(GpuMesh::empty(&self.gpu, self.kernels.normals.is_some()));
        }
        let fresh = if volume.unobserved.is_empty() { None } else { Some(volume.masks()?) };
        let blocks = volume.block_count() as u32;
        let working = Working {
            blocks,
            surface: self.surface.of(&self.gpu, SURFACE_BLOCK_BYTES * u64::from(blocks))?,
            edges: self.edges.of(&self.gpu, EDGES_BYTES * u64::from(blocks))?,
            first: self.first.of(&self.gpu, PrefixSums::bytes(blocks + 1))?,
            masks: fresh.as_ref().unwrap_or(&self.no_masks),
            cases: &self.cases,
        };
        let totals = self.totals.of(&self.gpu, 8)?;
        let mut commands = Commands::new(&self.gpu);
        working.count(&mut commands, &self.kernels, volume, &volume.store.pool())?;
        self.sums.run(&mut commands, working.first, blocks + 1)?;
        commands.copy_between((working.first.buffer(), 8 * u64::from(blocks)), (totals.buffer(), 0), 8);
        commands.submit()?;
        let [vertices, triangles] = bytemuck::pod_read_unaligned(&self.gpu.read(&[(totals, 8)])?[0]);

        let mesh = GpuMesh::new(&self.gpu, [vertices, triangles], self.kernels.normals.is_some())?;
        let mut commands = Commands::new(&self.gpu);
        working.fill(&mut commands, &self.kernels, volume, &volume.store.pool(), &mesh)?;
        commands.submit()?;
        Ok(mesh)
    }
}

/// What is known of a volume's blocks.
struct Working<'a> {
    blocks: u32,
    surface: &'a Storage,
    edges: &'a Storage,
    first: &'a Storage,
    masks: &'a MaskTable,
    cases: &'a Storage,
}

impl Working<'_> {
    /// Finds the crossing edges and crossed cells, and writes how many vertices and triangles each block has.
    fn count(
        &self,
        commands: &mut Commands,
        kernels: &Kernels,
        volume: &GpuVolume,
        pool: &SamplePool,
    ) -> Result<(), GpuError> {
        let Self { blocks, surface, edges, first, masks, cases } = *self;
        let (table, parameters) = (&*volume.table, [blocks, 0, 0, 0]);
        commands.run(&kernels.signs, Some(pool), &parameters, &[&table.blocks, surface], blocks)?;
        let buffers =
            [&table.blocks, &table.table, surface, &masks.numbers, &masks.words, cases, edges, first];
        commands.run(&kernels.count, None, &parameters, &buffers, blocks)
    }

    /// Writes the mesh.
    fn fill(
        &self,
        commands: &mut Commands,
        kernels: &Kernels,
        volume: &GpuVolume,
        pool: &SamplePool,
        mesh: &GpuMesh,
    ) -> Result<(), GpuError> {
        let Self { blocks, surface, edges, first, masks, cases } = *self;
        let table = &*volume.table;
        let voxel_m = volume.grid.voxel_size.metres() as f32;
        let mut fill = |kernel: &Kernel, before: &[&Storage], parts: &Parts| {
            parts.shares().try_for_each(|Share { start, count, storage }| {
                let buffers = [&[&table.blocks, &table.table], before, &[storage]].concat();
                commands.run(kernel, Some(pool), &[blocks, start, count, voxel_m.to_bits()], &buffers, blocks)
            })
        };
        fill(&kernels.positions, &[edges, first], &mesh.positions_m)?;
        if let (Some(kernel), Some(normals)) = (&kernels.normals, &mesh.normals) {
            fill(kernel, &[edges, first, &masks.numbers, &masks.words], normals)?;
        }
        fill(&kernels.triangles, &[surface, cases, edges, first], &mesh.triangles)
    }
}
