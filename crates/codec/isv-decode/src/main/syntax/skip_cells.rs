//! Cells of 4x4x4 blocks that stay as they were in the frame before (skip cells). Their blocks are not coded again, and nothing
//! of what can be found of them changes. Each cell that the frame before has blocks in has a flag.

use crate::main::MainBlocks;
use foldhash::HashSet;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{BlockCell, BlockSet};

/// Models of the flags of cells.
#[derive(Clone, Debug, Default)]
pub struct SkipCellModels {
    /// By [`SkipCellContext::model`].
    pub cell: [BitModel; 32],
}

impl SkipCellModels {
    /// Reads which of the reference's blocks are in cells that stay as they are.
    pub fn read(&mut self, decoder: &mut RangeDecoder, reference: MainBlocks) -> BlockSet {
        let mut context = SkipCellContext::new(reference);
        let cells = reference.sets.all.cells().iter();
        let skipped = cells.copied().filter(|cell| {
            let skipped = decoder.decode(&mut self.cell[context.model(*cell)]);
            context.note(*cell, skipped);
            skipped
        });
        skipped.collect()
    }
}

/// What is known around a cell when its flag is coded.
#[derive(Debug)]
pub struct SkipCellContext {
    /// Cells that are known to stay as they are.
    now: HashSet<u64>,
    /// Cells that stayed as they were in the frame before.
    before: HashSet<u64>,
}

impl SkipCellContext {
    /// Nothing is known of this frame.
    #[must_use]
    pub fn new(reference: MainBlocks) -> Self {
        let before = reference.skipped.cells().iter().map(|cell| cell.code).collect();
        Self { now: HashSet::default(), before }
    }

    /// Notes whether a cell stays as it is.
    pub fn note(&mut self, cell: BlockCell, skipped: bool) {
        if skipped {
            self.now.insert(cell.code);
        }
    }

    /// Model of a cell, by whether it was still in the frame before. It depends too on how many of the three cells behind it are
    /// still, and how many of the three ahead of it were.
    #[must_use]
    pub fn model(&self, cell: BlockCell) -> usize {
        let along = |set: &HashSet<u64>, ahead: bool| {
            let beside = (0..3).filter_map(|axis| cell.beside(axis, ahead));
            beside.filter(|code| set.contains(code)).count()
        };
        let was_still = usize::from(self.before.contains(&cell.code));
        (was_still * 4 + along(&self.now, false)) * 4 + along(&self.before, true)
    }
}
