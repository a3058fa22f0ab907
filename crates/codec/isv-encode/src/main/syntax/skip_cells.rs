//! Which cells of 4x4x4 blocks stay as they were in the frame before.

use isv_decode::main::MainBlocks;
use isv_decode::main::syntax::skip_cells::{SkipCellContext, SkipCellModels};
use isv_entropy::RangeEncoder;
use isv_volume::BlockSet;

/// Writes which of the reference's blocks are in cells that stay as they are; `skipped` holds all of a cell or none.
pub(crate) fn write(
    models: &mut SkipCellModels,
    encoder: &mut RangeEncoder,
    skipped: &BlockSet,
    reference: MainBlocks,
) {
    let mut context = SkipCellContext::new(reference);
    let mut next = skipped.cells().iter().peekable();
    for cell in reference.sets.all.cells() {
        let skipped = next.next_if_eq(&cell).is_some();
        encoder.encode(&mut models.cell[context.model(*cell)], skipped);
        context.note(*cell, skipped);
    }
}
