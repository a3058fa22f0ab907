//! A decoded frame without its samples: what the syntax of the next frame needs of it.

use super::{FrameSymbols, Vector};
use crate::ReferenceBlocks;
use crate::main::extension::FrameBlocks;
use isv_volume::{BlockCoord, BlockSet};

/// The blocks of a decoded frame of profile `main`, as the syntax of the next frame sees them.
#[derive(Clone, Copy, Debug)]
pub struct MainBlocks<'a> {
    /// All blocks of its volume, with their look-up and masks.
    pub blocks: ReferenceBlocks<'a>,
    /// What they are.
    pub sets: &'a FrameBlocks,
    /// For each block of the volume, how it was coded; `None` if the decoder made it up. See [`CodedBlock::of_frame`].
    pub coded: &'a [Option<CodedBlock>],
    /// The blocks of the frame before it that were in cells that stayed as they were.
    pub skipped: &'a BlockSet,
}

impl MainBlocks<'_> {
    /// How the block at a coordinate was coded, if it was.
    #[must_use]
    pub fn coded(&self, coord: BlockCoord) -> Option<CodedBlock> {
        self.blocks.index.get(coord).and_then(|block| self.coded_at(block as usize))
    }

    /// How a block of the volume was coded, if it was.
    #[must_use]
    pub fn coded_at(&self, block: usize) -> Option<CodedBlock> {
        self.coded[block]
    }
}

/// What the next frame's contexts and vectors want to know of a coded block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CodedBlock {
    /// Vector of the block, if it had one.
    pub vector: Option<Vector>,
    /// How many of its levels were not zero.
    pub count: u8,
}

impl CodedBlock {
    /// What is kept stands still and has no levels.
    const KEPT: Self = Self { vector: Some(Vector::ZERO), count: 0 };

    /// For each block of a frame, those of [`FrameBlocks::all`] in Morton order, how it was coded; `None` if it was not. `symbols`:
    /// of the blocks coded in the frame itself.
    #[must_use]
    pub fn of_frame(sets: &FrameBlocks, symbols: &FrameSymbols) -> Vec<Option<Self>> {
        let FrameBlocks { all, coded, fresh, .. } = sets;
        let mut blocks = symbols.modes.iter().enumerate();
        let coded = coded.marks_in(all).into_iter().zip(fresh.marks_in(all)).map(|marks| match marks {
            (false, _) => None,
            (true, false) => Some(Self::KEPT),
            (true, true) => {
                let (block, mode) = blocks.next()?;
                Some(Self { vector: mode.vector(), count: symbols.levels.count(block) })
            }
        });
        coded.collect()
    }
}
