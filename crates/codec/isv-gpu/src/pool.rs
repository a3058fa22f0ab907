//! The samples of all volumes on a GPU: slots of a block each, in up to four buffers.

use crate::commands::Commands;
use crate::storage::Usage;
use crate::{Gpu, GpuError, Storage};
use wgpu::{BindGroupEntry, BufferSize};

/// Buffers that a pool is split into: kernels bind all of them.
pub(crate) const SEGMENTS: usize = 4;
/// Bytes of a block's samples, two to a word.
pub(crate) const BLOCK_BYTES: u64 = 1024;
/// Blocks that a pool begins with.
const FIRST_BLOCKS: u32 = 1 << 12;

/// Slots for the samples of blocks of 8 voxels a side. A slot belongs to one volume, or to several that share the block.
#[derive(Debug)]
pub(crate) struct SamplePool {
    gpu: Gpu,
    segments: [Storage; SEGMENTS],
    /// Base-2 logarithm of a segment's blocks.
    segment_bits: u32,
    /// For each slot that there is memory for, how many volumes have it.
    users: Vec<u32>,
    /// Slots that nobody has, the lowest last.
    free: Vec<u32>,
}

impl SamplePool {
    /// Without slots.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let empty = || gpu.storage("samples", 4, Usage::Kernels);
        let segments = [empty()?, empty()?, empty()?, empty()?];
        let segment_bits = segment_bits(gpu);
        Ok(Self { gpu: gpu.clone(), segments, segment_bits, users: Vec::new(), free: Vec::new() })
    }

    /// The segments as kernels bind them.
    pub(crate) fn entries(&self) -> [BindGroupEntry<'_>; SEGMENTS] {
        std::array::from_fn(|segment| BindGroupEntry {
            binding: segment as u32,
            resource: self.segments[segment].buffer().as_entire_binding(),
        })
    }

    /// Slots for so many blocks, whatever is in them. No commands that write samples may be in the making: they would write where
    /// the samples were before the pool grew.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if there are more than all segments can hold, and as [`Gpu::storage`].
    pub(crate) fn take(&mut self, count: usize) -> Result<Vec<u32>, GpuError> {
        let missing = count.saturating_sub(self.free.len());
        if missing > 0 {
            self.grow(missing)?;
        }
        let mut slots = self.free.split_off(self.free.len() - count);
        // In order, so that runs of them are copied at once.
        slots.reverse();
        slots.iter().for_each(|slot| self.users[*slot as usize] = 1);
        Ok(slots)
    }

    /// Notes that another volume has these slots.
    pub(crate) fn share(&mut self, slots: &[u32]) {
        slots.iter().for_each(|slot| self.users[*slot as usize] += 1);
    }

    /// Notes that a volume has these slots no more.
    pub(crate) fn give_back(&mut self, slots: &[u32]) {
        for slot in slots.iter().rev() {
            let users = &mut self.users[*slot as usize];
            *users -= 1;
            if *users == 0 {
                self.free.push(*slot);
            }
        }
    }

    /// Writes the samples of blocks, which `block` has by their place in `slots`, before all commands that are submitted later. Each
    /// write is memory of its own to the driver: slots in a row are written at once.
    pub(crate) fn write<'a>(&self, slots: &[u32], block: impl Fn(usize) -> &'a [i16]) {
        let mut at = 0;
        for run in self.runs(slots) {
            let (segment, first) = self.place(run[0]);
            let bytes = BufferSize::new(run.len() as u64 * BLOCK_BYTES).expect("runs are not empty");
            let view = self.gpu.queue().write_buffer_with(segment.buffer(), first, bytes);
            let blocks = (at..at + run.len()).map(&block);
            at += run.len();
            // Nothing is written to a device that is lost.
            let Some(mut view) = view else { continue };
            for (number, samples) in blocks.enumerate() {
                let start = number * BLOCK_BYTES as usize;
                let bytes = bytemuck::cast_slice(samples);
                view.slice(start..start + bytes.len()).copy_from_slice(bytes);
            }
        }
    }

    /// Slots that follow one another in memory, as often as they do.
    pub(crate) fn runs<'a>(&self, slots: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
        let bits = self.segment_bits;
        slots.chunk_by(move |a, b| b.wrapping_sub(*a) == 1 && a >> bits == b >> bits)
    }

    /// Storage of a slot's samples, and the byte at which they begin.
    pub(crate) fn place(&self, slot: u32) -> (&Storage, u64) {
        let within = slot & ((1 << self.segment_bits) - 1);
        (&self.segments[(slot >> self.segment_bits) as usize], u64::from(within) * BLOCK_BYTES)
    }

    /// Makes room for so many more blocks, at least twice as many as there are.
    fn grow(&mut self, more: usize) -> Result<(), GpuError> {
        let most = SEGMENTS << self.segment_bits;
        let needed = self.users.len() + more;
        if needed > most {
            let (bytes, limit) = (needed as u64 * BLOCK_BYTES, most as u64 * BLOCK_BYTES);
            return Err(GpuError::TooLarge { what: "samples", bytes, limit });
        }
        let wanted = needed.max(2 * self.users.len()).max(FIRST_BLOCKS as usize).min(most);
        for segment in 0..SEGMENTS {
            let blocks = wanted.saturating_sub(segment << self.segment_bits).min(1 << self.segment_bits);
            let (bytes, before) = (blocks as u64 * BLOCK_BYTES, self.segments[segment].bytes());
            if bytes <= before {
                continue;
            }
            let larger = self.gpu.storage("samples", bytes, Usage::Kernels)?;
            let mut commands = Commands::new(&self.gpu);
            commands.copy(&self.segments[segment], &larger, before);
            commands.submit()?;
            self.segments[segment] = larger;
        }
        let fresh = self.users.len() as u32..wanted as u32;
        self.users.resize(wanted, 0);
        // The lowest slots are taken first.
        let before = std::mem::replace(&mut self.free, fresh.rev().collect());
        self.free.extend(before);
        Ok(())
    }
}

/// Base-2 logarithm of the blocks of a segment: as many as a kernel may see at once.
pub(crate) fn segment_bits(gpu: &Gpu) -> u32 {
    (gpu.binding_bytes() / BLOCK_BYTES).max(1).ilog2()
}
