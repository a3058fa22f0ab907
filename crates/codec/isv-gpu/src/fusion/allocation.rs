//! Which blocks the band around the seen surface reaches (Sec. 3.6).

use super::GpuFusion;
use super::views::{Batch, GpuViews, Strip};
use crate::commands::Commands;
use crate::prefix_sums::PrefixSums;
use crate::storage::{GrowingBuffer, Usage};
use crate::{GpuError, Storage};
use isv_volume::{BlockCoord, COORD_LIMIT, Grid, MortonCode};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::ops::Range;

/// Entries that a table begins with, and by how much it grows where they are not enough.
const FIRST_ENTRIES: u64 = 1 << 17;
const GROWTH: u64 = 4;
/// Bytes of an entry, and of a block's name.
const NAME_BYTES: u64 = 8;
/// Rays of a dispatch; more are handed over one after the other, and it is looked after each whether there are too many blocks.
const RAYS_AT_ONCE: usize = 1 << 22;
/// Block faces that a surface covers across the rays for each block, at most: see `isv-fusion`.
const FACES_OF_BLOCK: u64 = 2;

/// A table of blocks that grows to what was needed once.
#[derive(Debug)]
pub(super) struct Allocator {
    entries: u64,
    rays: GrowingBuffer,
    /// Sums of rays, the state of the table, or names.
    reading: GrowingBuffer,
}

impl Default for Allocator {
    fn default() -> Self {
        let reading = GrowingBuffer::for_reading("blocks found, to read");
        Self { entries: FIRST_ENTRIES, rays: GrowingBuffer::new("rays"), reading }
    }
}

/// Blocks as they are found.
struct Table {
    /// Blocks that there is room for, half as many as entries.
    capacity: u64,
    entries: u64,
    key: u32,
    table: Storage,
    /// How many blocks were found, and whether one found no entry.
    state: Storage,
    found: Storage,
}

/// What became of a search.
enum Search {
    Found(Vec<BlockCoord>),
    /// More than the limit.
    OverLimit,
    /// More than there was room for.
    Crowded,
}

/// The grid whose blocks are looked for.
struct Scale {
    /// Edge of a block, in voxels of the views.
    block_edge: f64,
    /// Edge of a block, in the voxels that bands are measured in.
    edge: f32,
    limit: u64,
}

impl GpuFusion {
    /// The blocks that rays pass through, if they are not more than a limit.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] or [`GpuError::Unsupported`] if there are more blocks or rays than can be counted here, though not
    /// more than the limit. Also what goes wrong on the GPU.
    pub(super) fn allocate(
        &mut self,
        views: &GpuViews,
        grid: &Grid,
        scale: f64,
        limit: usize,
    ) -> Result<Option<Vec<BlockCoord>>, GpuError> {
        let edge = grid.edge.voxels();
        let scale = Scale { block_edge: edge as f64 * scale, edge: edge as f32, limit: limit as u64 };
        loop {
            match self.search(views, &scale)? {
                Search::Found(blocks) => return Ok(Some(blocks)),
                Search::OverLimit => return Ok(None),
                Search::Crowded => self.grow_table()?,
            }
        }
    }

    /// Has the next table be larger.
    fn grow_table(&mut self) -> Result<(), GpuError> {
        let (entries, limit) = (self.allocator.entries, self.gpu.binding_bytes());
        let most = 1 << (limit / NAME_BYTES).ilog2();
        if entries >= most {
            let bytes = NAME_BYTES * entries * GROWTH;
            return Err(GpuError::TooLarge { what: "blocks found", bytes, limit });
        }
        self.allocator.entries = (entries * GROWTH).min(most);
        Ok(())
    }

    /// Looks for blocks with a table of the present size.
    fn search(&mut self, views: &GpuViews, scale: &Scale) -> Result<Search, GpuError> {
        let table = self.new_table(scale.limit)?;
        for batch in &views.batches {
            for strip in &batch.strips {
                let [rays, faces] = self.count_rays(batch, strip, scale)?;
                if u64::from(faces) / FACES_OF_BLOCK > scale.limit {
                    return Ok(Search::OverLimit);
                }
                if rays == u32::MAX {
                    return Err(GpuError::Unsupported("depth images whose pixels cover thousands of blocks"));
                }
                for first in (0..rays).step_by(RAYS_AT_ONCE) {
                    let end = first.saturating_add(RAYS_AT_ONCE as u32).min(rays);
                    self.walk_rays(batch, strip, scale, &table, first..end)?;
                    if end < rays && self.read_state(&table)?[0] > table.capacity {
                        break;
                    }
                }
            }
        }
        let [found, crowded] = self.read_state(&table)?;
        Ok(if found > scale.limit {
            Search::OverLimit
        } else if found > table.capacity || crowded != 0 {
            Search::Crowded
        } else {
            Search::Found(self.read_blocks(&table, found)?)
        })
    }

    /// An empty table. No larger than for twice the limit, at first.
    fn new_table(&mut self, limit: u64) -> Result<Table, GpuError> {
        let gpu = &self.gpu;
        let entries = self.allocator.entries;
        let capacity = (entries / 2).min(limit);
        // New memory is zeros.
        let table = gpu.storage("blocks found", NAME_BYTES * entries, Usage::Kernels)?;
        let state = gpu.storage("number of blocks found", NAME_BYTES, Usage::Kernels)?;
        let found = gpu.storage("names of blocks", NAME_BYTES * capacity.max(1), Usage::Kernels)?;
        // What is found does not depend on it.
        let key = RandomState::new().build_hasher().finish() as u32;
        Ok(Table { capacity, entries, key, table, state, found })
    }

    /// Counts the rays of all pixels of a strip, and adds them up. Returns how many there are, and the block faces that they cover.
    fn count_rays(&mut self, batch: &Batch, strip: &Strip, scale: &Scale) -> Result<[u32; 2], GpuError> {
        let (gpu, pixels) = (&self.gpu, strip.pixels());
        let counts = self.allocator.rays.of(gpu, PrefixSums::bytes(pixels + 1))?;
        let reading = self.allocator.reading.of(gpu, NAME_BYTES)?;
        let mut words: Vec<u32> = bytemuck::cast_slice(&[strip.words(scale.block_edge)]).to_vec();
        words.extend([(scale.block_edge as f32).to_bits(), 0, 0, 0]);
        let mut commands = Commands::new(gpu);
        let groups = (pixels + 1).div_ceil(64);
        commands.run(&self.kernels.count, None, &words, &[&batch.surfels, counts], groups)?;
        self.kernels.prefix_sums.run(&mut commands, counts, pixels + 1)?;
        let all = (counts.buffer(), NAME_BYTES * u64::from(pixels));
        commands.copy_between(all, (reading.buffer(), 0), NAME_BYTES);
        commands.submit()?;
        Ok(pairs(&gpu.read(&[(reading, NAME_BYTES)])?[0])[0])
    }

    /// Enters the blocks on some rays of a strip, counted last.
    fn walk_rays(
        &mut self,
        batch: &Batch,
        strip: &Strip,
        scale: &Scale,
        table: &Table,
        rays: Range<u32>,
    ) -> Result<(), GpuError> {
        let gpu = &self.gpu;
        let counts = self.allocator.rays.of(gpu, PrefixSums::bytes(strip.pixels() + 1))?;
        let mut words: Vec<u32> = bytemuck::cast_slice(&[strip.words(scale.block_edge)]).to_vec();
        words.extend([scale.block_edge as f32, scale.edge].map(f32::to_bits));
        words.extend([rays.start, rays.end, table.entries as u32, table.capacity as u32, table.key, 0]);
        let buffers = [&batch.surfels, counts, &table.table, &table.state, &table.found];
        let mut commands = Commands::new(gpu);
        commands.run(&self.kernels.allocate, None, &words, &buffers, (rays.len() as u32).div_ceil(64))?;
        commands.submit()
    }

    /// How many blocks were found so far, and whether one found no entry.
    fn read_state(&mut self, table: &Table) -> Result<[u64; 2], GpuError> {
        let reading = self.allocator.reading.of(&self.gpu, NAME_BYTES)?;
        let mut commands = Commands::new(&self.gpu);
        commands.copy(&table.state, reading, NAME_BYTES);
        commands.submit()?;
        Ok(pairs(&self.gpu.read(&[(reading, NAME_BYTES)])?[0])[0].map(u64::from))
    }

    /// The blocks that were found, in Morton order.
    fn read_blocks(&mut self, table: &Table, count: u64) -> Result<Vec<BlockCoord>, GpuError> {
        let bytes = NAME_BYTES * count;
        let reading = self.allocator.reading.of(&self.gpu, bytes)?;
        let mut commands = Commands::new(&self.gpu);
        commands.copy(&table.found, reading, bytes);
        commands.submit()?;
        let names = pairs(&self.gpu.read(&[(reading, bytes)])?[0]);
        let mut codes: Vec<MortonCode> = names.iter().map(|name| block_of(*name).morton()).collect();
        codes.sort_unstable();
        Ok(codes.into_iter().map(MortonCode::coord).collect())
    }
}

/// The block of a name, which is its coordinates of 21 bits one after the other.
fn block_of([low, high]: [u32; 2]) -> BlockCoord {
    let bits = 2 * COORD_LIMIT as u32 - 1;
    let y = low >> 21 | (high >> 21) << 11;
    BlockCoord::from([low & bits, y & bits, high & bits].map(|c| c as i32 - COORD_LIMIT))
}

/// Pairs of words as they are read.
fn pairs(bytes: &[u8]) -> Vec<[u32; 2]> {
    bytemuck::pod_collect_to_vec(bytes)
}
