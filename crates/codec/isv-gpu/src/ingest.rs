//! Meshes to volumes, on the GPU: what `isv_ingest` says of a mesh ([`MeshJob`]), in integers wherever two kernels have to agree.
//!
//! 1. Each triangle enters the blocks that it matters in into a table and counts itself there (`ingest_find.wgsl`). The table is read
//!    back, and the blocks put in order (`reached`).
//! 2. Each triangle enters itself into the lists of its blocks (`ingest_list.wgsl`), of as many blocks at a time as a buffer holds.
//! 3. Each block draws its triangles onto its rows of voxels (`ingest_wind.wgsl`). Lines of blocks add up what that changes
//!    (`ingest_carry.wgsl`): winding numbers, which lie where samples will.
//! 4. Each block measures the distance from its voxels to the closest of its triangles (`ingest_measure.wgsl`).
//! 5. Blocks without an observed voxel near the surface are dropped. What wide holes need is done by the CPU.

pub(crate) mod kernels;
mod parts;
mod reached;
mod sampling;
#[cfg(test)]
mod tests;

use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::storage::GrowingBuffer;
use crate::store::Slots;
use crate::{GpuError, GpuVolume, Storage, VolumeStore};
use isv_ingest::{IngestError, LONGEST_EDGE, LatticeMesh, MeshIngest, MeshJob, SignDecision};
use isv_volume::{BlockCoord, BlockEdge, SparseVolume, TriangleMesh, VoxelMask};
use kernels::Kernels;
use parts::{Part, parts};
use reached::{Reached, TABLE_ENTRIES};
use sampling::{Buffers, Found, Sampling};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Words of a block's mask.
const MASK_WORDS: usize = 16;
/// Blocks along an axis that a kernel lets a triangle reach.
const MOST_REACHED: f64 = 16.0;
/// So many times the blocks allowed may be reached.
const REACHED_SHARE: usize = 4;
/// How far the triangles that close a mesh matter, in voxels: a row is changed less than a voxel behind them.
const CLOSING_REACH: f64 = 1.25;

/// A mesh that cannot become a volume, or a GPU that cannot make one of it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GpuIngestError {
    /// The mesh, or a setting.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// The GPU.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Makes volumes of meshes on a GPU, one after another, with the same working memory.
///
/// Distances are those of [`isv_ingest::ingest_mesh`] but for rounding where that has them exactly. Farther from the surface, with
/// `Reach::Surface`, they are those to the closest of the triangles near the block.
#[derive(Debug)]
pub struct GpuMeshIngester {
    settings: MeshIngest,
    store: VolumeStore,
    kernels: Kernels,
    vertices: GrowingBuffer,
    triangles: GrowingBuffer,
    scratch: Buffers,
    /// Entries of the table of reached blocks that the last frame needed.
    entries: u32,
}

/// What kernels look at of a mesh.
struct OnGpu<'a> {
    vertices: &'a Storage,
    triangles: &'a Storage,
    lattice: &'a LatticeMesh,
    parameters: Parameters,
}

/// `Parameters` of `ingest_triangles.wgsl`.
#[derive(Clone, Copy, bytemuck::NoUninit)]
#[repr(C)]
struct Parameters {
    origin: [i32; 3],
    fraction_bits: u32,
    ends: [u32; 3],
    entries: u32,
    reach: [i32; 3],
    truncation: i32,
    key_bits: [u32; 2],
    part: [u32; 2],
    near: f32,
    band: f32,
    offset: f32,
    is_signed: u32,
}

impl Parameters {
    fn words(&self) -> &[u32] {
        bytemuck::cast_slice(std::slice::from_ref(self))
    }

    /// For some of the blocks.
    fn of_part(&self, part: &Part) -> Self {
        Self { part: [part.blocks.start as u32, part.blocks.len() as u32], ..*self }
    }
}

impl GpuMeshIngester {
    /// For volumes in a store.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for blocks of another edge than 8 voxels, [`GpuError::Refused`].
    pub fn new(store: &VolumeStore, settings: MeshIngest) -> Result<Self, GpuError> {
        if settings.grid.edge != BlockEdge::E8 {
            return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
        }
        Ok(Self {
            settings,
            store: store.clone(),
            kernels: Kernels::new(store.gpu())?,
            vertices: GrowingBuffer::new("vertices"),
            triangles: GrowingBuffer::new("triangles"),
            scratch: Buffers::new(),
            entries: TABLE_ENTRIES,
        })
    }

    /// How meshes become volumes.
    #[must_use]
    pub fn settings(&self) -> &MeshIngest {
        &self.settings
    }

    /// The volume of a mesh.
    ///
    /// # Errors
    /// As `isv_ingest::ingest_mesh`, and what goes wrong on the GPU: [`GpuError::Unsupported`] and [`GpuError::TooLarge`] where the CPU
    /// might still do it.
    pub fn ingest(
        &mut self,
        mesh: &TriangleMesh,
        sign: SignDecision,
    ) -> Result<SparseVolume, GpuIngestError> {
        let job = MeshJob::new(mesh, &self.settings, sign)?;
        let volume = self.sample(&job)?.download()?;
        Ok(job.finish(volume))
    }

    /// The volume of a mesh, on the GPU. Only where the mesh has wide holes does it leave it meanwhile.
    ///
    /// # Errors
    /// As [`Self::ingest`].
    pub fn ingest_to_gpu(
        &mut self,
        mesh: &TriangleMesh,
        sign: SignDecision,
    ) -> Result<GpuVolume, GpuIngestError> {
        let job = MeshJob::new(mesh, &self.settings, sign)?;
        let volume = self.sample(&job)?;
        if !job.has_wide_holes() {
            return Ok(volume);
        }
        let finished = job.finish(volume.download()?);
        Ok(GpuVolume::upload(&self.store, &finished)?)
    }

    /// The volume of a job before what its holes need.
    fn sample(&mut self, job: &MeshJob) -> Result<GpuVolume, GpuIngestError> {
        let (store, gpu) = (self.store.clone(), self.store.gpu());
        if job.has_sheets() {
            return Err(refusal(job, "open surfaces signed by side"));
        }
        let lattice = job.lattice().ok_or_else(|| refusal(job, "a mesh of this extent"))?;
        let mesh = OnGpu {
            vertices: self.vertices.holding(gpu, lattice.vertices.as_flattened())?,
            triangles: self.triangles.holding(gpu, lattice.triangles.as_flattened())?,
            lattice,
            parameters: parameters(job, lattice)
                .ok_or_else(|| refusal(job, "a mesh of this extent or with so long a truncation"))?,
        };
        // Not all of them will have a voxel near the surface.
        let limit = job.max_blocks().saturating_mul(REACHED_SHARE);
        let reached = Reached::find(gpu, &self.kernels, &mesh, &mut self.entries, limit)?
            .ok_or_else(|| refusal(job, "a mesh that reaches so many blocks"))?;
        if reached.coords.len() > job.max_blocks() {
            job.check_blocks()?;
        }
        let taken = store.pool().take(reached.coords.len())?;
        let slots = Slots::new(&store, taken);
        let mut commands = Commands::new(gpu);
        let table = BlockTable::new(gpu, store.insert(), &reached.coords, slots.get(), &mut commands)?;
        commands.submit()?;
        let parts = parts(&reached.counts, gpu.binding_bytes())?;
        let sampling = Sampling { gpu, pool: store.pool(), kernels: &self.kernels, mesh, table: &table };
        let is_signed = job.offset().is_none();
        if is_signed {
            for part in &parts {
                sampling.list(&mut self.scratch, part)?;
                sampling.wind(&mut self.scratch, part)?;
            }
            sampling.carry(&mut self.scratch, &reached.coords)?;
        }
        let mut found = Found::default();
        for part in &parts {
            // The list of a single part is still there.
            if !is_signed || parts.len() > 1 {
                sampling.list(&mut self.scratch, part)?;
            }
            sampling.measure(&mut self.scratch, part, &mut found)?;
        }
        drop(sampling);
        Ok(near_the_surface(&store, job, &reached.coords, &slots, &found)?)
    }
}

impl OnGpu<'_> {
    /// Workgroups of a thread a triangle.
    fn groups(&self) -> u32 {
        (self.lattice.triangles.len() as u32).div_ceil(64)
    }
}

/// Why a mesh cannot be sampled here: it needs more blocks than allowed, or a GPU cannot do what the CPU can.
fn refusal(job: &MeshJob, what: &'static str) -> GpuIngestError {
    job.check_blocks().map_or_else(GpuIngestError::from, |()| GpuError::Unsupported(what).into())
}

/// What kernels are told of a job; nothing if numbers are too large for them.
fn parameters(job: &MeshJob, lattice: &LatticeMesh) -> Option<Parameters> {
    let key_bits = lattice.blocks.map(|blocks| blocks.next_power_of_two().ilog2());
    let reached = (f64::from(LONGEST_EDGE) + 2.0 * job.near().max(job.band())) / 8.0 + 2.0;
    if key_bits.iter().sum::<u32>() > 31 || reached > MOST_REACHED {
        return None;
    }
    let steps = |voxels: f64| (voxels * f64::from(1u32 << lattice.fraction_bits)).ceil() as i32 + 1;
    let ends = [lattice.faces, lattice.faces + lattice.closing, lattice.triangles.len()];
    Some(Parameters {
        origin: lattice.origin.to_array(),
        fraction_bits: lattice.fraction_bits,
        ends: ends.map(|end| end as u32),
        entries: 0,
        reach: [job.near().max(CLOSING_REACH), CLOSING_REACH, job.band()].map(steps),
        truncation: i32::from(job.grid().truncation.codes()),
        key_bits: [key_bits[0], key_bits[1]],
        part: [0; 2],
        near: job.near() as f32,
        band: job.band() as f32,
        offset: job.offset().unwrap_or(0.0) as f32,
        is_signed: u32::from(job.offset().is_none()),
    })
}

/// The volume of the blocks with an observed voxel near the surface.
fn near_the_surface(
    store: &VolumeStore,
    job: &MeshJob,
    coords: &[BlockCoord],
    slots: &Slots,
    found: &Found,
) -> Result<GpuVolume, GpuError> {
    let (mut kept, mut kept_slots, mut unobserved) = (Vec::new(), Vec::new(), BTreeMap::new());
    for (block, flags) in found.flags.iter().enumerate().filter(|(_, flags)| *flags & 1 != 0) {
        if flags & 2 != 0 {
            unobserved.insert(kept.len() as u32, VoxelMask::from_words(&found.masks[block]));
        }
        kept.push(coords[block]);
        kept_slots.push(slots.get()[block]);
    }
    store.pool().share(&kept_slots);
    let slots = Arc::new(Slots::new(store, kept_slots));
    let mut commands = Commands::new(store.gpu());
    let table = BlockTable::new(store.gpu(), store.insert(), &kept, slots.get(), &mut commands)?;
    commands.submit()?;
    let (store, grid, coords) = (store.clone(), *job.grid(), Arc::new(kept));
    Ok(GpuVolume { store, grid, coords, slots, table: Arc::new(table), unobserved: Arc::new(unobserved) })
}
