//! Readback of the samples that entropy decoding needs, in one transfer.

use super::coded_blocks::pack_vector;
use super::extrapolated_blocks::ExtrapolatedBlocks;
use super::resources::FrameCommands;
use crate::GpuError;
use crate::blocks::BlockTable;
use crate::storage::GrowingBuffer;
use isv_decode::main::CodedBlock;
use isv_decode::main::cell_corners::Bits;
use isv_volume::VoxelMask;

/// Memory for questions and readback.
#[derive(Debug)]
pub(super) struct ReadbackBuffers {
    vectors: GrowingBuffer,
    activity: GrowingBuffer,
    beginnings: GrowingBuffer,
    cells: GrowingBuffer,
    insides_read: GrowingBuffer,
    activity_read: GrowingBuffer,
    cells_read: Vec<GrowingBuffer>,
}

impl Default for ReadbackBuffers {
    fn default() -> Self {
        Self {
            vectors: GrowingBuffer::new("vectors"),
            activity: GrowingBuffer::new("activity"),
            beginnings: GrowingBuffer::new("list of blocks where cells begin"),
            cells: GrowingBuffer::new("crossed cells"),
            insides_read: GrowingBuffer::for_reading("sides of blocks to read"),
            activity_read: GrowingBuffer::for_reading("activity to read"),
            cells_read: Vec::new(),
        }
    }
}

/// Bytes of a block's cells, a bit each.
const MASK_BYTES: u64 = 64;

/// The readback.
#[derive(Debug)]
pub(super) struct SyntaxReadback {
    /// Sides of all blocks: 1 for those that were extrapolated and lie inside.
    pub(super) insides: Vec<u32>,
    /// Activity of each block: edges that the surface is expected to cross, and from bit 16 on its distance where there are none.
    pub(super) activity: Vec<u32>,
    /// The crossed cells with a corner in an unsettled block, by the block of their lowest corners, in order.
    pub(super) cells: Vec<(u32, VoxelMask)>,
}

/// Asks of a frame whose samples are done, and reads the readback.
///
/// - `table`: of all blocks.
/// - `coded`: how each was coded.
/// - `beginnings`: which of them are looked at for cells, and the voxels where these begin.
///
/// # Errors
/// What went wrong on the GPU.
pub(super) fn read_back(
    mut frame: FrameCommands,
    table: &BlockTable,
    extrapolated: &ExtrapolatedBlocks,
    coded: &[Option<CodedBlock>],
    beginnings: &[(u32, Bits)],
    scratch: &mut ReadbackBuffers,
) -> Result<SyntaxReadback, GpuError> {
    let (gpu, count) = (frame.gpu, coded.len() as u32);
    let vectors: Vec<u32> =
        coded.iter().map(|coded| pack_vector(coded.and_then(|coded| coded.vector))).collect();
    let vectors = scratch.vectors.holding(gpu, &vectors)?;
    let word_bytes = 4 * u64::from(count);
    let activity = scratch.activity.of(gpu, word_bytes)?;
    let buffers = [&table.blocks, &table.table, vectors, activity];
    frame.run(&frame.kernels.activity, &[count, 0, 0, 0], &buffers, count)?;

    let at_once = (gpu.binding_bytes() / MASK_BYTES) as usize;
    let blocks: Vec<u32> = beginnings.iter().map(|(block, _)| *block).collect();
    let parts: Vec<&[u32]> = blocks.chunks(at_once).collect();
    while scratch.cells_read.len() < parts.len() {
        scratch.cells_read.push(GrowingBuffer::for_reading("crossed cells to read"));
    }
    let list = scratch.beginnings.holding(gpu, &blocks)?;
    let cells = scratch.cells.of(gpu, MASK_BYTES * blocks.len().min(at_once) as u64)?;
    let mut readings = Vec::new();
    for ((part, cells_read), number) in parts.iter().zip(&mut scratch.cells_read).zip(0u32..) {
        let (first, blocks) = (number * at_once as u32, part.len() as u32);
        let ExtrapolatedBlocks { kinds, opposed, masks, .. } = *extrapolated;
        let buffers = [&table.blocks, &table.table, kinds, opposed, masks, list, cells];
        frame.run(&frame.kernels.crossed_cells, &[first, blocks, 0, 0], &buffers, blocks)?;
        let bytes = MASK_BYTES * u64::from(blocks);
        let reading = cells_read.of(gpu, bytes)?;
        frame.commands.copy(cells, reading, bytes);
        readings.push((reading, bytes));
    }
    let insides_read = scratch.insides_read.of(gpu, word_bytes)?;
    let activity_read = scratch.activity_read.of(gpu, word_bytes)?;
    frame.commands.copy(extrapolated.insides, insides_read, word_bytes);
    frame.commands.copy(activity, activity_read, word_bytes);
    readings.extend([(insides_read, word_bytes), (activity_read, word_bytes)]);
    let FrameCommands { gpu, pool, commands, .. } = frame;
    commands.submit()?;
    drop(pool);
    let mut read = gpu.read(&readings)?;
    let activity = words(&read.pop().unwrap_or_default());
    let insides = words(&read.pop().unwrap_or_default());
    let found = read.iter().flat_map(|bytes| bytes.as_chunks::<{ MASK_BYTES as usize }>().0);
    let cells = beginnings.iter().zip(found);
    let cells = cells.filter_map(|((block, within), bytes)| Some((*block, mask(bytes, within)?)));
    Ok(SyntaxReadback { insides, activity, cells: cells.collect() })
}

/// Words of the GPU, which are little-endian.
fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

/// A mask's voxels among some, if there are any.
fn mask(bytes: &[u8; MASK_BYTES as usize], within: &Bits) -> Option<VoxelMask> {
    let layer = |z: usize| u64::from_le_bytes(std::array::from_fn(|byte| bytes[8 * z + byte]));
    let words: Bits = std::array::from_fn(|z| layer(z) & within[z]);
    (words != [0; 8]).then(|| VoxelMask::from_words(&words))
}
