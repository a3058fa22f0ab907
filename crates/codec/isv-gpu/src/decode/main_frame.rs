//! A frame of profile `main`, from symbols to what the next frame's syntax needs of samples.

use super::coded_blocks::CodedBlocks;
use super::extrapolated_blocks::{ExtrapolatedBlocks, KeptFrame};
use super::resources::{DecodeResources, FrameCommands};
use super::syntax_readback::{SyntaxReadback, read_back};
use crate::blocks::BlockTable;
use crate::store::Slots;
use crate::{GpuError, GpuVolume, VolumeStore};
use isv_decode::ReferenceBlocks;
use isv_decode::backend::MainFrame;
use isv_decode::main::activity::Activity;
use isv_decode::main::crossed_cells::beginnings_at_unsettled;
use isv_decode::main::extension::{ExtensionPlan, FrameBlocks, Side};
use isv_decode::main::{CodedBlock, MainBlocks};
use isv_volume::{BlockIndex, BlockOrigin, BlockSet};
use std::sync::Arc;

/// A decoded frame of profile `main` on a GPU.
#[derive(Debug)]
pub struct GpuMainFrame {
    pub(super) volume: GpuVolume,
    index: BlockIndex,
    sets: FrameBlocks,
    coded: Vec<Option<CodedBlock>>,
    skipped: BlockSet,
    pub(super) readback: SyntaxReadback,
}

impl GpuMainFrame {
    /// Blocks of the frame.
    pub(super) fn blocks(&self) -> MainBlocks<'_> {
        let Self { index, sets, coded, skipped, volume, .. } = self;
        let GpuVolume { coords, unobserved, .. } = volume;
        MainBlocks { blocks: ReferenceBlocks { coords, index, unobserved }, sets, coded, skipped }
    }

    /// The activity that is expected where the blocks `skipped` stay as they are.
    pub(super) fn expected_activity(&self, skipped: &BlockSet) -> Vec<Activity> {
        let marks = skipped.marks_in(&self.sets.all);
        let blocks = self.readback.activity.iter().zip(marks).zip(&self.coded);
        let activity = |((word, is_still), coded): ((&u32, bool), &Option<CodedBlock>)| match is_still {
            true => Activity::of_still(coded.is_some()),
            false => Activity::new(*word as u16, (word >> 16) as u16),
        };
        blocks.map(activity).collect()
    }
}

impl DecodeResources {
    /// A frame from its symbols.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn main_frame(
        &mut self,
        frame: MainFrame,
        before: Option<&GpuMainFrame>,
    ) -> Result<GpuMainFrame, GpuError> {
        let Self { store, kernels, coded_buffers, extrapolated_buffers, readback_buffers, .. } = self;
        let MainFrame { parameters, header, symbols, causal, plan, predicts } = frame;
        let gpu = store.gpu();
        let (slots, coded_slots) = take_slots(store, &plan, before)?;
        let mut work = FrameCommands::new(store, kernels);
        let table = BlockTable::new(gpu, store.insert(), plan.coords(), slots.get(), &mut work.commands)?;
        let coded_table =
            BlockTable::new(gpu, store.insert(), &symbols.coords, &coded_slots, &mut work.commands)?;

        let coded =
            CodedBlocks::upload(gpu, parameters, header, &symbols, causal, &coded_table, coded_buffers)?;
        let source = before.filter(|_| predicts).map(|before| &*before.volume.table);
        coded.reconstruct(&mut work, header, source)?;
        coded.filter(&mut work, header)?;

        let kept = before
            .map(|before| KeptFrame { blocks: before.blocks().blocks, insides: &before.readback.insides });
        let extrapolated = ExtrapolatedBlocks::upload(gpu, &plan, kept, &table, extrapolated_buffers)?;
        extrapolated.extrapolate(&mut work, parameters.grid.truncation)?;

        let how = CodedBlock::of_frame(plan.blocks(), &symbols);
        let beginnings = beginnings_at_unsettled(&plan);
        let readback = read_back(work, &table, &extrapolated, &how, &beginnings, readback_buffers)?;

        let side = |block: u32| match (plan.coded()[block as usize], readback.insides[block as usize]) {
            (true, _) => Side::Coded,
            (false, 0) => Side::Outside,
            (false, _) => Side::Inside,
        };
        let unobserved = Arc::new(plan.masks(side, kept.map(|kept| kept.blocks)));
        let (sets, coords, index) = plan.into_blocks();
        let (store, table) = (store.clone(), Arc::new(table));
        let volume =
            GpuVolume { store, grid: parameters.grid, coords: Arc::new(coords), slots, table, unobserved };
        Ok(GpuMainFrame { volume, index, sets, coded: how, skipped: symbols.skipped, readback })
    }
}

/// The slots of all blocks of a frame, some of them shared with the frame before, and those of the blocks coded in it.
fn take_slots(
    store: &VolumeStore,
    plan: &ExtensionPlan,
    before: Option<&GpuMainFrame>,
) -> Result<(Arc<Slots>, Vec<u32>), GpuError> {
    let mut pool = store.pool();
    let fresh = pool.take(plan.blocks().fresh.count())?;
    let mut kept = Vec::new();
    let slots = plan.origins().iter().map(|origin| match *origin {
        BlockOrigin::Fresh(block) => fresh[block as usize],
        BlockOrigin::Kept(block) => {
            let before = before.expect("blocks are kept of a frame before");
            kept.push(before.volume.slots.get()[block as usize]);
            kept[kept.len() - 1]
        }
    });
    let slots: Vec<u32> = slots.collect();
    pool.share(&kept);
    drop(pool);
    let coded = plan.places().iter().map(|place| fresh[*place as usize]).collect();
    Ok((Arc::new(Slots::new(store, slots)), coded))
}
