//! Which of the cells that the surface crosses are drawn, after the samples.

use isv_decode::ReferenceBlocks;
use isv_decode::main::cell_corners::{Bits, bits};
use isv_decode::main::syntax::cells::{CellContexts, CellModels, set_bits};
use isv_entropy::RangeEncoder;
use isv_volume::VoxelMask;
use std::collections::BTreeMap;

/// Writes which cells of a frame are not drawn: by block, none of them empty. `cells`: those of
/// [`cells_at_unsettled`](isv_decode::main::crossed_cells::cells_at_unsettled); asked for only if some are not drawn.
/// `reference`: the frame before.
pub(crate) fn write<'a>(
    models: &mut CellModels,
    frame: ReferenceBlocks,
    reference: Option<ReferenceBlocks>,
    undrawn: &BTreeMap<u32, Bits>,
    cells: impl FnOnce() -> &'a [(u32, VoxelMask)],
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut models.any, !undrawn.is_empty());
    if undrawn.is_empty() {
        return encoder.finish();
    }
    let mut contexts = CellContexts::new(frame, reference);
    for (block, cells) in cells() {
        let cells = bits(cells);
        let undrawn = undrawn.get(block);
        encoder.encode(&mut models.block[contexts.turn_to(*block)], undrawn.is_some());
        if let Some(undrawn) = undrawn {
            for cell in set_bits(&cells) {
                let [behind, count] = contexts.cell(cell);
                let models = [&mut models.by_behind[behind], &mut models.by_count[count]];
                let is_undrawn = undrawn[cell / 64] >> (cell % 64) & 1 != 0;
                encoder.encode_mixed(models, is_undrawn);
                contexts.set(cell, is_undrawn);
            }
        }
        contexts.leave(&cells, undrawn.unwrap_or(&[0; 8]));
    }
    encoder.finish()
}
