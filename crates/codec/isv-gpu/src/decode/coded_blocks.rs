//! The blocks coded in a frame of profile `main`: prediction, residual, in-loop filter.

use super::resources::FrameCommands;
use super::scale::{pack_level, scale};
use crate::blocks::BlockTable;
use crate::storage::GrowingBuffer;
use crate::{Gpu, GpuError, Storage};
use bytemuck::{Pod, Zeroable};
use isv_decode::main::reconstruct::spatial_waves;
use isv_decode::main::{BlockMode, CausalBlocks, FrameSymbols, MainParameters, Vector};
use isv_format::MainFrameHeader;

/// Memory for the coded blocks of a frame.
#[derive(Debug)]
pub(super) struct CodedBuffers {
    pub(super) modes: GrowingBuffer,
    pub(super) levels: GrowingBuffer,
    list: GrowingBuffer,
}

impl Default for CodedBuffers {
    fn default() -> Self {
        Self {
            modes: GrowingBuffer::new("modes"),
            levels: GrowingBuffer::new("levels"),
            list: GrowingBuffer::new("list of coded blocks"),
        }
    }
}

/// `CodedBlock` of `coded.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct CodedMode {
    mode: u32,
    levels: u32,
    level_count: u32,
    slice: u32,
}

/// A vector, or none, as `vectors.wgsl` has it.
pub(crate) fn pack_vector(vector: Option<Vector>) -> u32 {
    let pack = |Vector(vector): Vector| {
        let [x, y, z] = vector.map(|component| u32::from((component + Vector::LIMIT).unsigned_abs()));
        x | y << 9 | z << 18 | 1 << 27
    };
    vector.map_or(0, pack)
}

/// The coded blocks of a frame, uploaded.
pub(super) struct CodedBlocks<'a> {
    table: &'a BlockTable,
    modes: &'a Storage,
    levels: &'a Storage,
    /// Blocks in the order in which they are predicted.
    list: &'a Storage,
    count: u32,
    /// How many are predicted from the frame before.
    temporal: u32,
    /// Beginnings and lengths of the waves of the others. None of these depends on a later one.
    waves: Vec<(u32, u32)>,
    /// `scale` of `residual.wgsl`, and the truncation.
    words: Vec<u32>,
    truncation: u32,
}

impl<'a> CodedBlocks<'a> {
    /// Uploads modes and levels. `table`: of the coded blocks.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn upload(
        gpu: &Gpu,
        parameters: &MainParameters,
        header: &MainFrameHeader,
        symbols: &FrameSymbols,
        causal: &CausalBlocks,
        table: &'a BlockTable,
        scratch: &'a mut CodedBuffers,
    ) -> Result<Self, GpuError> {
        let mut levels = Vec::new();
        let modes = symbols.modes.iter().enumerate().map(|(block, mode)| {
            let start = levels.len() as u32;
            let of_block = symbols.levels.of(block).iter();
            levels.extend(of_block.map(|l| pack_level(parameters.scan[usize::from(l.place)], l.value)));
            let (mode, level_count) = (pack_vector(mode.vector()), levels.len() as u32 - start);
            CodedMode { mode, levels: start, level_count, slice: causal.slice_start(block) }
        });
        let modes: Vec<CodedMode> = modes.collect();
        let temporal = (0..).zip(&symbols.modes).filter(|(_, mode)| **mode != BlockMode::Spatial);
        let mut list: Vec<u32> = temporal.map(|(block, _)| block).collect();
        let temporal = list.len() as u32;
        let mut waves = Vec::new();
        for wave in spatial_waves(symbols, causal) {
            waves.push((list.len() as u32, wave.len() as u32));
            list.extend(wave);
        }
        let quantizer = parameters.quantizer(header.step);
        let truncation = u32::from(parameters.grid.truncation.codes().unsigned_abs());
        Ok(Self {
            table,
            modes: scratch.modes.holding(gpu, &modes)?,
            levels: scratch.levels.holding(gpu, &levels)?,
            list: scratch.list.holding(gpu, &list)?,
            count: symbols.coords.len() as u32,
            temporal,
            waves,
            words: scale(&parameters.transform, &quantizer, &quantizer).to_vec(),
            truncation,
        })
    }

    /// Predicts all blocks and adds their residuals. `before`: the blocks of the frame before, if they are predicted from it.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn reconstruct(
        &self,
        frame: &mut FrameCommands,
        header: &MainFrameHeader,
        before: Option<&BlockTable>,
    ) -> Result<(), GpuError> {
        let Self { table, modes, levels, list, .. } = *self;
        let words = |first: u32, count: u32| {
            let spatial = u32::from(!header.no_spatial_prediction);
            [&self.words[..], &[self.truncation, first, count, spatial]].concat()
        };
        if let Some(before) = before {
            let buffers = [&before.blocks, &before.table, &table.blocks, modes, levels, list];
            frame.run(&frame.kernels.temporal, &words(0, self.temporal), &buffers, self.temporal)?;
        }
        for (first, count) in &self.waves {
            let buffers = [&table.blocks, &table.table, modes, levels, list];
            frame.run(&frame.kernels.spatial, &words(*first, *count), &buffers, *count)?;
        }
        Ok(())
    }

    /// The in-loop filter: faces along x, then y, then z.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn filter(&self, frame: &mut FrameCommands, header: &MainFrameHeader) -> Result<(), GpuError> {
        if header.filter == 0 {
            return Ok(());
        }
        for axis in 0..3 {
            let (strength, limit) = (header.filter.into(), header.filter_limit.into());
            let words = [axis, strength, limit, self.truncation, self.count, 0, 0, 0];
            let buffers = [&self.table.blocks, &self.table.table, self.modes];
            frame.run(&frame.kernels.face_filter, &words, &buffers, self.count)?;
        }
        Ok(())
    }
}
