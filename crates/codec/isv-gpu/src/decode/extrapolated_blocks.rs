//! The blocks of a frame of profile `main` that were not coded: extrapolation, and the faces on which different signs meet.

use super::resources::FrameCommands;
use crate::blocks::BlockTable;
use crate::storage::GrowingBuffer;
use crate::{Gpu, GpuError, Storage};
use isv_decode::ReferenceBlocks;
use isv_decode::main::extension::ExtensionPlan;
use isv_volume::{BlockOrigin, Truncation};

/// Bits of a kind, as `frame_blocks.wgsl` has them.
const CODED: u32 = 1;
const UNSETTLED: u32 = 2;
/// Bit of a block's kind at which the number of its mask begins, as `crossed_cells.wgsl` has it.
const MASK_BITS: u32 = 8;

/// Memory for what is known of all blocks of a frame.
#[derive(Debug)]
pub(super) struct ExtrapolatedBuffers {
    kinds: GrowingBuffer,
    insides: GrowingBuffer,
    opposed: GrowingBuffer,
    masks: GrowingBuffer,
    list: GrowingBuffer,
}

impl Default for ExtrapolatedBuffers {
    fn default() -> Self {
        Self {
            kinds: GrowingBuffer::new("kinds of blocks"),
            insides: GrowingBuffer::new("sides of blocks"),
            opposed: GrowingBuffer::new("opposed faces"),
            masks: GrowingBuffer::new("masks of settled blocks"),
            list: GrowingBuffer::new("list of extrapolated blocks"),
        }
    }
}

/// What all blocks of a frame are, uploaded.
pub(super) struct ExtrapolatedBlocks<'a> {
    table: &'a BlockTable,
    /// Kinds of all blocks.
    pub(super) kinds: &'a Storage,
    /// Sides of all blocks: 1 for those that were extrapolated and lie inside.
    pub(super) insides: &'a Storage,
    pub(super) opposed: &'a Storage,
    /// Masks of settled blocks.
    pub(super) masks: &'a Storage,
    list: &'a Storage,
    /// Blocks to be extrapolated.
    count: u32,
    blocks: u32,
}

/// The frame before, as far as something is kept of it.
#[derive(Clone, Copy)]
pub(super) struct KeptFrame<'a> {
    pub(super) blocks: ReferenceBlocks<'a>,
    /// Sides of all blocks: 1 for those that were extrapolated and lie inside.
    pub(super) insides: &'a [u32],
}

impl<'a> ExtrapolatedBlocks<'a> {
    /// Uploads what is known of all blocks of a frame, which are in `table`.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn upload(
        gpu: &Gpu,
        plan: &ExtensionPlan,
        before: Option<KeptFrame>,
        table: &'a BlockTable,
        scratch: &'a mut ExtrapolatedBuffers,
    ) -> Result<Self, GpuError> {
        let unsettled = plan.blocks().unsettled.marks_in(&plan.blocks().all);
        let marks = plan.coded().iter().zip(unsettled);
        let kind = |(coded, unsettled): (&bool, bool)| {
            (u32::from(*coded) * CODED) | (u32::from(unsettled) * UNSETTLED)
        };
        let mut kinds: Vec<u32> = marks.map(kind).collect();
        let settled = before.filter(|_| plan.keeps()).map(|before| plan.settled_masks(before.blocks));
        let mut masks: Vec<u64> = Vec::new();
        for (number, (block, mask)) in (1..).zip(settled.unwrap_or_default()) {
            kinds[block as usize] |= number << MASK_BITS;
            masks.extend(mask.words());
        }
        let inside = |origin: &BlockOrigin| match (*origin, before) {
            (BlockOrigin::Kept(block), Some(before)) => before.insides[block as usize],
            _ => 0,
        };
        let insides: Vec<u32> = plan.origins().iter().map(inside).collect();
        let blocks = (0..).zip(plan.origins()).zip(plan.coded());
        let is_extrapolated =
            |origin: &BlockOrigin, coded: bool| matches!(origin, BlockOrigin::Fresh(_)) && !coded;
        let list =
            blocks.filter_map(|((block, origin), coded)| is_extrapolated(origin, *coded).then_some(block));
        let list: Vec<u32> = list.collect();
        Ok(Self {
            table,
            kinds: scratch.kinds.holding(gpu, &kinds)?,
            insides: scratch.insides.holding(gpu, &insides)?,
            opposed: scratch.opposed.of(gpu, 4 * kinds.len() as u64)?,
            masks: scratch.masks.holding(gpu, &masks)?,
            list: scratch.list.holding(gpu, &list)?,
            count: list.len() as u32,
            blocks: kinds.len() as u32,
        })
    }

    /// Makes them up from the coded blocks around them.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn extrapolate(
        &self,
        frame: &mut FrameCommands,
        truncation: Truncation,
    ) -> Result<(), GpuError> {
        let Self { table, kinds, insides, opposed, list, count, blocks, .. } = *self;
        let truncation = u32::from(truncation.codes().unsigned_abs());
        let buffers = [&table.blocks, &table.table, kinds, list, insides];
        frame.run(&frame.kernels.extrapolate, &[truncation, 0, count, 0], &buffers, count)?;
        let buffers = [&table.blocks, &table.table, kinds, insides, opposed];
        frame.run(&frame.kernels.conflicts, &[blocks, 0, 0, 0], &buffers, blocks.div_ceil(64))
    }
}
