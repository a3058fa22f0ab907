//! What views say about voxels: sums, and the samples that they resolve to (Eq. 3 to 5).

use super::GpuFusion;
use super::kernels::Kernels;
use super::views::GpuViews;
use crate::commands::Commands;
use crate::storage::{GrowingBuffer, Usage, write};
use crate::{Gpu, GpuError, Storage};
use isv_fusion::backend::{MOST_WEIGHT, SampledBlocks, UNKNOWN};
use isv_volume::{BlockCoord, BlockEdge, Grid, MortonCode, VoxelMask};
use std::collections::BTreeMap;

/// Bytes of sums that are worked on at a time.
const PART_BYTES: u64 = 64 << 20;
/// Bytes of a voxel's sums.
const VOXEL_BYTES: u64 = 12;

/// Sums of an accumulator's blocks on a GPU, in parts, in the order in which the blocks came.
#[derive(Debug, Default)]
pub struct GpuSums {
    places: BTreeMap<MortonCode, u32>,
    parts: Vec<Part>,
}

/// Sums of as many blocks as are worked on at a time.
#[derive(Debug)]
struct Part {
    coords: Storage,
    sums: Storage,
    blocks: u32,
}

/// Memory that serves one part after the other.
#[derive(Debug)]
pub(super) struct SumBuffers {
    coords: GrowingBuffer,
    sums: GrowingBuffer,
    resolved: ResolvedBuffers,
}

/// Memory for what sums resolve to. It serves one part after the other.
#[derive(Debug)]
struct ResolvedBuffers {
    samples: GrowingBuffer,
    masks: GrowingBuffer,
    samples_to_read: GrowingBuffer,
    masks_to_read: GrowingBuffer,
}

impl Default for SumBuffers {
    fn default() -> Self {
        let resolved = ResolvedBuffers {
            samples: GrowingBuffer::new("samples of voxels"),
            masks: GrowingBuffer::new("masks of voxels"),
            samples_to_read: GrowingBuffer::for_reading("samples to read"),
            masks_to_read: GrowingBuffer::for_reading("masks to read"),
        };
        Self {
            coords: GrowingBuffer::new("blocks to sample"),
            sums: GrowingBuffer::new("sums of voxels"),
            resolved,
        }
    }
}

impl GpuSums {
    /// The blocks, in Morton order.
    pub(super) fn coords(&self) -> Vec<BlockCoord> {
        self.places.keys().map(|code| code.coord()).collect()
    }

    /// Makes room for blocks that are new.
    fn add(&mut self, gpu: &Gpu, grid: &Grid, coords: &[BlockCoord]) -> Result<(), GpuError> {
        let at_once = blocks_at_once(gpu, grid.edge);
        let is_new = |coord: &&BlockCoord| {
            let next = self.places.len() as u32;
            *self.places.entry(coord.morton()).or_insert(next) == next
        };
        let rows: Vec<_> = coords.iter().filter(is_new).map(row).collect();
        let mut rest = &rows[..];
        while !rest.is_empty() {
            if self.parts.last().is_none_or(|part| part.blocks == at_once) {
                let bytes = u64::from(at_once) * block_bytes(grid.edge);
                self.parts.push(Part {
                    coords: gpu.storage("blocks with sums", 16 * u64::from(at_once), Usage::Kernels)?,
                    // New memory is zeros.
                    sums: gpu.storage("sums of voxels", bytes, Usage::Kernels)?,
                    blocks: 0,
                });
            }
            let part = self.parts.last_mut().expect("there is room");
            let (now, later) = rest.split_at(rest.len().min((at_once - part.blocks) as usize));
            write(gpu, &part.coords, 16 * u64::from(part.blocks), bytemuck::cast_slice(now));
            part.blocks += now.len() as u32;
            rest = later;
        }
        Ok(())
    }
}

/// Bytes of a block's sums.
fn block_bytes(edge: BlockEdge) -> u64 {
    VOXEL_BYTES * edge.block_voxels() as u64
}

/// Blocks whose sums a kernel sees, at least one.
fn blocks_at_once(gpu: &Gpu, edge: BlockEdge) -> u32 {
    (PART_BYTES.min(gpu.binding_bytes()) / block_bytes(edge)).max(1) as u32
}

/// A coordinate as kernels see it.
fn row(coord: &BlockCoord) -> [i32; 4] {
    [coord.x, coord.y, coord.z, 0]
}

/// Sums of blocks, where kernels work on them.
#[derive(Clone, Copy)]
struct SumBindings<'a> {
    coords: &'a Storage,
    sums: &'a Storage,
    blocks: u32,
}

/// What becomes of sums before and after views are added.
#[derive(Clone, Copy)]
enum Mode {
    /// They begin with these views.
    Fresh,
    /// They go on, and are scaled down to [`MOST_WEIGHT`] in the end.
    Running,
}

impl GpuFusion {
    /// What the views say about some blocks.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn sample_blocks(
        &mut self,
        views: &GpuViews,
        grid: &Grid,
        coords: &[BlockCoord],
    ) -> Result<SampledBlocks, GpuError> {
        let Self { gpu, kernels, sum_buffers: scratch, .. } = self;
        let mut sampled = unknown(grid, coords.len());
        let at_once = blocks_at_once(gpu, grid.edge);
        for (first, part) in (0..).step_by(at_once as usize).zip(coords.chunks(at_once as usize)) {
            let rows: Vec<_> = part.iter().map(row).collect();
            let buffers = SumBindings {
                coords: scratch.coords.holding(gpu, &rows)?,
                sums: scratch.sums.of(gpu, part.len() as u64 * block_bytes(grid.edge))?,
                blocks: part.len() as u32,
            };
            let mut commands = Commands::new(gpu);
            integrate(&mut commands, kernels, views, grid, buffers, Mode::Fresh)?;
            let resolved = scratch.resolved.resolve(gpu, kernels, commands, grid, buffers)?;
            resolved.put(grid.edge, first.., &mut sampled);
        }
        Ok(sampled)
    }

    /// Adds what the views say to the sums of all blocks.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn add_to_sums(
        &mut self,
        sums: &mut GpuSums,
        views: &GpuViews,
        grid: &Grid,
        touched: &[BlockCoord],
    ) -> Result<(), GpuError> {
        sums.add(&self.gpu, grid, touched)?;
        let mut commands = Commands::new(&self.gpu);
        for part in &sums.parts {
            integrate(&mut commands, &self.kernels, views, grid, part.buffers(), Mode::Running)?;
        }
        commands.submit()
    }

    /// What the sums say about their blocks.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn resolve_sums(&mut self, sums: &GpuSums, grid: &Grid) -> Result<SampledBlocks, GpuError> {
        let Self { gpu, kernels, sum_buffers: scratch, .. } = self;
        let mut sampled = unknown(grid, sums.places.len());
        let mut ranks = vec![0; sums.places.len()];
        for (rank, place) in sums.places.values().enumerate() {
            ranks[*place as usize] = rank;
        }
        for (part, ranks) in sums.parts.iter().zip(ranks.chunks(blocks_at_once(gpu, grid.edge) as usize)) {
            let commands = Commands::new(gpu);
            let resolved = scratch.resolved.resolve(gpu, kernels, commands, grid, part.buffers())?;
            resolved.put(grid.edge, ranks.iter().copied(), &mut sampled);
        }
        Ok(sampled)
    }
}

impl Part {
    fn buffers(&self) -> SumBindings<'_> {
        SumBindings { coords: &self.coords, sums: &self.sums, blocks: self.blocks }
    }
}

/// Adds what the views say, batch after batch.
fn integrate(
    commands: &mut Commands,
    kernels: &Kernels,
    views: &GpuViews,
    grid: &Grid,
    buffers: SumBindings,
    mode: Mode,
) -> Result<(), GpuError> {
    let last = views.batches.len().saturating_sub(1);
    for (number, batch) in views.batches.iter().enumerate() {
        let (fresh, most_weight) = match mode {
            Mode::Fresh => (number == 0, 0.0),
            Mode::Running => (false, if number == last { MOST_WEIGHT } else { 0.0 }),
        };
        let views = batch.strips.len() as u32;
        let words = [buffers.blocks, grid.edge.log2(), views, fresh.into(), most_weight.to_bits(), 0, 0, 0];
        let storages = [&batch.views, &batch.surfels, buffers.coords, buffers.sums];
        let groups = buffers.blocks * (grid.edge.block_voxels() as u32 / 64);
        commands.run(&kernels.integrate, None, &words, &storages, groups)?;
    }
    Ok(())
}

/// Samples and masks of some blocks, as they are read.
struct Resolved {
    samples: Vec<u8>,
    masks: Vec<u8>,
}

impl ResolvedBuffers {
    /// Resolves sums after some commands, and reads what they give.
    fn resolve(
        &mut self,
        gpu: &Gpu,
        kernels: &Kernels,
        mut commands: Commands,
        grid: &Grid,
        buffers: SumBindings,
    ) -> Result<Resolved, GpuError> {
        let size = grid.edge.block_voxels() as u32;
        let voxels = u64::from(size) * u64::from(buffers.blocks);
        let [sample_bytes, mask_bytes] = [2 * voxels, voxels / 8];
        let samples = self.samples.of(gpu, sample_bytes)?;
        let masks = self.masks.of(gpu, mask_bytes)?;
        let samples_to_read = self.samples_to_read.of(gpu, sample_bytes)?;
        let masks_to_read = self.masks_to_read.of(gpu, mask_bytes)?;
        let words = [buffers.blocks, size, u32::from(grid.truncation.codes().unsigned_abs()), 0];
        let groups = (buffers.blocks * (size / 32)).div_ceil(64);
        commands.run(&kernels.resolve, None, &words, &[buffers.sums, samples, masks], groups)?;
        commands.copy(samples, samples_to_read, sample_bytes);
        commands.copy(masks, masks_to_read, mask_bytes);
        commands.submit()?;
        let mut read = gpu.read(&[(samples_to_read, sample_bytes), (masks_to_read, mask_bytes)])?;
        let masks = read.pop().unwrap_or_default();
        Ok(Resolved { samples: read.pop().unwrap_or_default(), masks })
    }
}

impl Resolved {
    /// Puts each block where it belongs.
    fn put(&self, edge: BlockEdge, ranks: impl Iterator<Item = usize>, to: &mut SampledBlocks) {
        let size = edge.block_voxels();
        let blocks = self.samples.chunks_exact(2 * size).zip(self.masks.chunks_exact(size / 8));
        for (rank, (samples, mask)) in ranks.zip(blocks) {
            let place = to.samples[rank * size..][..size].iter_mut();
            place.zip(samples.as_chunks::<2>().0).for_each(|(to, pair)| *to = i16::from_le_bytes(*pair));
            let words = mask.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes));
            to.unobserved[rank] = VoxelMask::from_words(&words.collect::<Vec<_>>());
        }
    }
}

/// So many blocks of which nothing is known.
fn unknown(grid: &Grid, blocks: usize) -> SampledBlocks {
    let samples = vec![UNKNOWN; blocks * grid.edge.block_voxels()];
    SampledBlocks { samples, unobserved: vec![VoxelMask::empty(grid.edge); blocks] }
}
