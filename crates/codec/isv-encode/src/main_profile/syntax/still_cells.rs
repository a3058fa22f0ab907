//! Which cells of 4x4x4 blocks stay as they were in the frame before.

use isv_decode::main_profile::MainBlocks;
use isv_decode::main_profile::syntax::still_cells::{StillCellContext, StillCellModels};
use isv_entropy::RangeEncoder;
use isv_volume::BlockSet;

/// Writes which of the reference's blocks are in cells that stay as they are; `still` holds all of a cell or none.
pub(crate) fn write(
    models: &mut StillCellModels,
    encoder: &mut RangeEncoder,
    still: &BlockSet,
    reference: MainBlocks,
) {
    let mut context = StillCellContext::new(reference);
    let mut next = still.cells().iter().peekable();
    for cell in reference.sets.all.cells() {
        let still = next.next_if_eq(&cell).is_some();
        encoder.encode(&mut models.cell[context.model(*cell)], still);
        context.note(*cell, still);
    }
}
