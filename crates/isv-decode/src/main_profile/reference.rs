//! The frame before, as the next one sees it.

use super::{FrameSymbols, Vector};
use crate::Reference;
use crate::extension::{Extended, FrameBlocks};
use isv_volume::{BlockCoord, BlockSet, NeighbourFinder, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// A decoded frame: its volume with the extension, and what its blocks were coded as.
#[derive(Clone, Debug)]
pub struct MainReference {
    extended: Extended,
    /// For each block of the volume, how it was coded; `None` if the decoder made it up.
    coded: Vec<Option<CodedBlock>>,
    still: BlockSet,
}

/// What the next frame's contexts and vectors want to know of a coded block.
#[derive(Clone, Copy, Debug)]
pub struct CodedBlock {
    /// Its vector, if it had one.
    pub vector: Option<Vector>,
    /// How many of its levels were not zero.
    pub count: u8,
}

impl CodedBlock {
    /// What is kept stands still and has no levels.
    const KEPT: Self = Self { vector: Some(Vector::ZERO), count: 0 };
}

impl MainReference {
    /// Of the extended volume of a frame, the frame's symbols, whose blocks are those coded in it in the same order, and its
    /// masks, by index in the volume.
    #[must_use]
    pub fn new(extended: Extended, symbols: FrameSymbols, masks: BTreeMap<u32, VoxelMask>) -> Self {
        let FrameBlocks { all, coded, fresh, .. } = &extended.blocks;
        let mut blocks = symbols.modes.iter().enumerate();
        let coded = coded.marks_in(all).into_iter().zip(fresh.marks_in(all)).map(|marks| match marks {
            (false, _) => None,
            (true, false) => Some(CodedBlock::KEPT),
            (true, true) => {
                let (block, mode) = blocks.next()?;
                Some(CodedBlock { vector: mode.vector(), count: symbols.levels.count(block) })
            }
        });
        let coded = coded.collect();
        Self { extended: extended.with_unobserved(masks), coded, still: symbols.still }
    }

    /// The frame with all its blocks.
    #[must_use]
    pub fn extended(&self) -> &Extended {
        &self.extended
    }

    /// The blocks of the frame before it that were in cells that stayed as they were.
    #[must_use]
    pub fn still(&self) -> &BlockSet {
        &self.still
    }

    /// The volume: coded blocks and those around them.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        self.extended.volume()
    }

    /// The volume with its look-up.
    #[must_use]
    pub fn reference(&self) -> &Reference {
        &self.extended.reference
    }

    /// The samples of the volume, for their memory to serve another frame.
    #[must_use]
    pub fn into_samples(self) -> Vec<i16> {
        self.extended.reference.into_volume().into_samples()
    }

    /// A finder of the blocks of the volume around others.
    #[must_use]
    pub fn finder(&self) -> NeighbourFinder<'_> {
        NeighbourFinder::new(self.extended.index())
    }

    /// How the block at a coordinate was coded, if it was.
    #[must_use]
    pub fn coded(&self, coord: BlockCoord) -> Option<CodedBlock> {
        self.extended.index().get(coord).and_then(|block| self.coded[block as usize])
    }

    /// How a block of the volume was coded, if it was.
    #[must_use]
    pub fn coded_at(&self, block: usize) -> Option<CodedBlock> {
        self.coded[block]
    }
}
