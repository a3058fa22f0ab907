//! The steps from lists of triangles to samples, on as many blocks at a time as buffers hold.

use super::kernels::Kernels;
use super::parts::Part;
use super::reached::lines;
use super::{MASK_WORDS, OnGpu};
use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::kernel::Kernel;
use crate::pool::SamplePool;
use crate::storage::GrowingBuffer;
use crate::{Gpu, GpuError, Storage};
use isv_volume::BlockCoord;
use std::sync::MutexGuard;

/// A mesh whose blocks have slots.
pub(super) struct Sampling<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) pool: MutexGuard<'a, SamplePool>,
    pub(super) kernels: &'a Kernels,
    pub(super) mesh: OnGpu<'a>,
    pub(super) table: &'a BlockTable,
}

/// Memory that serves one frame after the other.
#[derive(Debug)]
pub(super) struct Buffers {
    next: GrowingBuffer,
    starts: GrowingBuffer,
    lists: GrowingBuffer,
    order: GrowingBuffer,
    lines: GrowingBuffer,
    flags: GrowingBuffer,
    masks: GrowingBuffer,
    flags_reading: GrowingBuffer,
    masks_reading: GrowingBuffer,
}

/// What was found out about blocks.
#[derive(Default)]
pub(super) struct Found {
    /// For each 1 if it has an observed voxel near the surface, and 2 if it has an unobserved one.
    pub(super) flags: Vec<u32>,
    /// Unobserved voxels, if there are rims.
    pub(super) masks: Vec<[u64; MASK_WORDS / 2]>,
}

impl Buffers {
    /// No memory yet.
    pub(super) fn new() -> Self {
        Self {
            next: GrowingBuffer::new("places of triangles"),
            starts: GrowingBuffer::new("starts of lists"),
            lists: GrowingBuffer::new("triangles of blocks"),
            order: GrowingBuffer::new("blocks in lines"),
            lines: GrowingBuffer::new("lines of blocks"),
            flags: GrowingBuffer::new("which blocks are near"),
            masks: GrowingBuffer::new("masks of sampled blocks"),
            flags_reading: GrowingBuffer::for_reading("which blocks are near, to read"),
            masks_reading: GrowingBuffer::for_reading("masks of sampled blocks, to read"),
        }
    }
}

impl Sampling<'_> {
    /// Lists the triangles of the blocks of a part.
    pub(super) fn list(&self, scratch: &mut Buffers, part: &Part) -> Result<(), GpuError> {
        scratch.starts.holding(self.gpu, &part.starts)?;
        let next = scratch.next.holding(self.gpu, &part.starts)?;
        let lists = scratch.lists.of(self.gpu, 4 * part.triangles())?;
        let OnGpu { vertices, triangles, parameters, .. } = &self.mesh;
        let buffers = [*vertices, triangles, &self.table.blocks, &self.table.table, next, lists];
        let mut commands = Commands::new(self.gpu);
        let words = parameters.of_part(part);
        commands.run(&self.kernels.list, None, words.words(), &buffers, self.mesh.groups())?;
        commands.submit()
    }

    /// Finds how winding numbers change in the blocks of a part, whose triangles are listed.
    pub(super) fn wind(&self, scratch: &mut Buffers, part: &Part) -> Result<(), GpuError> {
        let mut commands = Commands::new(self.gpu);
        self.run(&mut commands, &self.kernels.wind, [&mut scratch.starts, &mut scratch.lists], &[], part)?;
        commands.submit()
    }

    /// Adds up changes along lines of blocks.
    pub(super) fn carry(&self, scratch: &mut Buffers, coords: &[BlockCoord]) -> Result<(), GpuError> {
        let (order, starts) = lines(coords);
        let count = starts.len() as u32 - 1;
        let order = scratch.order.holding(self.gpu, &order)?;
        let buffers = [&self.table.blocks, order, scratch.lines.holding(self.gpu, &starts)?];
        let mut commands = Commands::new(self.gpu);
        commands.run(&self.kernels.carry, Some(&self.pool), &[count, 0, 0, 0], &buffers, count)?;
        commands.submit()
    }

    /// Samples the blocks of a part, whose triangles are listed.
    pub(super) fn measure(
        &self,
        scratch: &mut Buffers,
        part: &Part,
        found: &mut Found,
    ) -> Result<(), GpuError> {
        let flag_bytes = 4 * part.blocks.len() as u64;
        let mask_bytes = if self.mesh.lattice.rims() > 0 { MASK_WORDS as u64 * flag_bytes } else { 0 };
        let flags = scratch.flags.of(self.gpu, flag_bytes)?;
        let masks = scratch.masks.of(self.gpu, mask_bytes)?;
        let flags_reading = scratch.flags_reading.of(self.gpu, flag_bytes)?;
        let masks_reading = scratch.masks_reading.of(self.gpu, mask_bytes)?;
        let mut commands = Commands::new(self.gpu);
        let listed = [&mut scratch.starts, &mut scratch.lists];
        self.run(&mut commands, &self.kernels.measure, listed, &[flags, masks], part)?;
        commands.copy(flags, flags_reading, flag_bytes);
        commands.copy(masks, masks_reading, mask_bytes);
        commands.submit()?;
        let read = self.gpu.read(&[(flags_reading, flag_bytes), (masks_reading, mask_bytes)])?;
        found.flags.extend(bytemuck::pod_collect_to_vec::<u8, u32>(&read[0]));
        found.masks.extend(bytemuck::pod_collect_to_vec::<u8, [u64; MASK_WORDS / 2]>(&read[1]));
        Ok(())
    }

    /// Runs a kernel on each block of a part. `listed`: its triangles.
    fn run(
        &self,
        commands: &mut Commands,
        kernel: &Kernel,
        [starts, lists]: [&mut GrowingBuffer; 2],
        more: &[&Storage],
        part: &Part,
    ) -> Result<(), GpuError> {
        let OnGpu { vertices, triangles, parameters, .. } = &self.mesh;
        let starts = starts.of(self.gpu, 4 * part.starts.len() as u64)?;
        let lists = lists.of(self.gpu, 4 * part.triangles())?;
        let buffers = [&[vertices, triangles, &self.table.blocks, starts, lists], more].concat();
        let words = parameters.of_part(part);
        commands.run(kernel, Some(&self.pool), words.words(), &buffers, part.blocks.len() as u32)
    }
}
