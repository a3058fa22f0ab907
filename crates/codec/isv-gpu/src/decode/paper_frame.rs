//! A frame of profile `paper`: every block is moved rigidly from the frame before, or predicted by zero (Sec. 3.4, 3.5).

use super::resources::DecodeResources;
use super::scale::{pack_level, scale};
use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::store::Slots;
use crate::{GpuError, GpuVolume};
use bytemuck::{Pod, Zeroable};
use isv_decode::ReferenceBlocks;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_kernels::warp::MotionVector;
use isv_volume::BlockIndex;
use std::ops::Range;
use std::sync::Arc;

/// A decoded frame of profile `paper` on a GPU.
#[derive(Debug)]
pub struct GpuPaperFrame {
    pub(crate) volume: GpuVolume,
    index: BlockIndex,
}

/// `MovedBlock` of `moved_block.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MovedBlock {
    slot: u32,
    is_predicted: u32,
    levels: u32,
    level_count: u32,
    motion: [i32; 12],
}

impl MovedBlock {
    /// A block to be made in a slot from one that is moved, or from zero, and from a range of the frame's levels.
    pub(crate) fn new(slot: u32, is_predicted: bool, motion: &MotionVector, levels: Range<u32>) -> Self {
        let [x, y, z] = motion.rotation_matrix();
        let [a, b, c] = motion.translation.map(i32::from);
        Self {
            slot,
            is_predicted: is_predicted.into(),
            levels: levels.start,
            level_count: levels.end - levels.start,
            motion: [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2], a, b, c],
        }
    }
}

impl GpuPaperFrame {
    /// A frame of this volume.
    pub(crate) fn new(volume: GpuVolume) -> Self {
        let index = BlockIndex::new(&volume.coords);
        Self { volume, index }
    }

    /// Blocks of the frame.
    pub(super) fn blocks(&self) -> ReferenceBlocks<'_> {
        let GpuVolume { coords, unobserved, .. } = &self.volume;
        ReferenceBlocks { coords, index: &self.index, unobserved }
    }
}

impl DecodeResources {
    /// A frame from its symbols.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn paper_frame(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&GpuPaperFrame>,
    ) -> Result<GpuPaperFrame, GpuError> {
        let Self { store, kernels, coded_buffers, .. } = self;
        let (store, gpu) = (store.clone(), store.gpu().clone());
        let count = symbols.coords.len();
        let slots = store.pool().take(count)?;
        let slots = Arc::new(Slots::new(&store, slots));
        let mut levels = Vec::new();
        let of_blocks = symbols.levels.chunks_exact(parameters.coefficients());
        let blocks = slots.get().iter().zip(&symbols.references).zip(&symbols.motion).zip(of_blocks);
        let moved = blocks.map(|(((slot, source), motion), of_block)| {
            let start = levels.len() as u32;
            let coded = of_block.iter().zip(&parameters.scan).filter(|(value, _)| **value != 0);
            levels.extend(coded.map(|(value, position)| pack_level(*position, *value)));
            let is_predicted = source.is_some() && before.is_some();
            MovedBlock::new(*slot, is_predicted, motion, start..levels.len() as u32)
        });
        let moved: Vec<_> = moved.collect();
        let mut commands = Commands::new(&gpu);
        let table = BlockTable::new(&gpu, store.insert(), &symbols.coords, slots.get(), &mut commands)?;
        // A keyframe has no frame before it; nothing is looked up then.
        let source = before.map_or(&table, |before| &before.volume.table);
        let mut words = scale(&parameters.transform, &parameters.dc, &parameters.ac).to_vec();
        let truncation = parameters.grid.truncation.codes();
        words.extend([u32::from(truncation.unsigned_abs()), count as u32, 0, 0]);
        let moved = coded_buffers.modes.holding(&gpu, &moved)?;
        let levels = coded_buffers.levels.holding(&gpu, &levels)?;
        let buffers = [&source.blocks, &source.table, &table.blocks, moved, levels];
        let pool = store.pool();
        commands.run(&kernels.warp, Some(&pool), &words, &buffers, count as u32)?;
        commands.submit()?;
        drop(pool);
        let (coords, unobserved) = (Arc::new(symbols.coords), Arc::new(symbols.unobserved));
        let (grid, table) = (parameters.grid, Arc::new(table));
        Ok(GpuPaperFrame::new(GpuVolume { store, grid, coords, slots, table, unobserved }))
    }
}
