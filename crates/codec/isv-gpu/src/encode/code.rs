//! Levels of every block, and the frame that they give (Sec. 3.3, 3.4, Eq. 10 and 11).

use super::tools::EncodeTools;
use crate::blocks::BlockTable;
use crate::commands::Commands;
use crate::decode::paper_frame::MovedBlock;
use crate::decode::resources::DecodeResources;
use crate::decode::scale::scale;
use crate::store::Slots;
use crate::{GpuError, GpuPaperFrame, GpuVolume};
use isv_decode::paper::{CodingParameters, FrameSymbols};
use std::sync::Arc;

/// Samples of a block.
const BLOCK_SAMPLES: usize = 512;

impl DecodeResources {
    /// The levels of a frame under the motion of its symbols, and the frame.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub(super) fn code_paper(
        &mut self,
        parameters: &CodingParameters,
        source: &GpuVolume,
        symbols: &FrameSymbols,
        before: Option<&GpuPaperFrame>,
    ) -> Result<(Vec<i32>, GpuPaperFrame), GpuError> {
        let (store, gpu) = (self.store.clone(), self.store.gpu());
        let tools = EncodeTools::of(&mut self.encoding, gpu)?;
        let count = symbols.coords.len();
        let slots = store.pool().take(count)?;
        let slots = Arc::new(Slots::new(&store, slots));
        let blocks = slots.get().iter().zip(&symbols.references).zip(&symbols.motion);
        let moved = blocks.map(|((slot, reference), motion)| {
            MovedBlock::new(*slot, reference.is_some() && before.is_some(), motion, 0..0)
        });
        let moved: Vec<_> = moved.collect();
        let moved = tools.moved.holding(gpu, &moved)?;
        let places = tools.places.holding(gpu, &scan_places(&parameters.scan))?;

        let mut commands = Commands::new(gpu);
        let table = BlockTable::new(gpu, store.insert(), &symbols.coords, slots.get(), &mut commands)?;
        commands.submit()?;
        // A keyframe has no frame before it; nothing is looked up then.
        let from = before.map_or(&table, |before| &before.volume.table);
        let mut words = scale(&parameters.transform, &parameters.dc, &parameters.ac).to_vec();
        words.extend(parameters.transform.forward_shifts());
        let truncation = u32::from(parameters.grid.truncation.codes().unsigned_abs());
        words.extend([parameters.coefficients() as u32, truncation]);

        // As many blocks at a time as a kernel may write the levels of.
        let block_bytes = 4 * parameters.coefficients() as u64;
        let at_once = (gpu.binding_bytes() / block_bytes).max(1) as usize;
        let mut all_levels: Vec<i32> = Vec::with_capacity(count * parameters.coefficients());
        for first in (0..count).step_by(at_once) {
            let part = at_once.min(count - first) as u32;
            let bytes = block_bytes * u64::from(part);
            let levels = tools.levels.of(gpu, bytes)?;
            let reading = tools.reading.of(gpu, bytes)?;
            let words = [&words[..], &[first as u32, part, 0]].concat();
            let buffers = [&from.blocks, &from.table, &source.table.blocks, moved, places, levels];
            let mut commands = Commands::new(gpu);
            let pool = store.pool();
            commands.run(&tools.code, Some(&pool), &words, &buffers, part)?;
            commands.copy(levels, reading, bytes);
            commands.submit()?;
            drop(pool);
            let bytes = gpu.read(&[(reading, bytes)])?.remove(0);
            all_levels.extend(bytes.as_chunks::<4>().0.iter().map(|word| i32::from_le_bytes(*word)));
        }

        let (coords, unobserved) = (Arc::new(symbols.coords.clone()), Arc::new(symbols.unobserved.clone()));
        let (grid, table) = (parameters.grid, Arc::new(table));
        let frame = GpuPaperFrame::new(GpuVolume { store, grid, coords, slots, table, unobserved });
        Ok((all_levels, frame))
    }
}

/// For each position in a block its place in the scan, or what no place is.
fn scan_places(scan: &[u16]) -> [u32; BLOCK_SAMPLES] {
    let mut places = [u32::MAX; BLOCK_SAMPLES];
    for (place, position) in (0..).zip(scan) {
        places[usize::from(*position)] = place;
    }
    places
}
