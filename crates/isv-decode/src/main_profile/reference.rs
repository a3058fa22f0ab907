//! The frame before, as the next one sees it.

use super::{FrameSymbols, Vector};
use crate::Reference;
use crate::extension::Extended;
use isv_volume::{BlockCoord, NeighbourFinder, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// A decoded frame: its volume with the extension, and what its blocks were coded as.
#[derive(Clone, Debug)]
pub struct MainReference {
    reference: Reference,
    /// For each block of the volume, how it was coded; `None` if the decoder made it up.
    coded: Vec<Option<CodedBlock>>,
}

/// What the next frame's contexts and vectors want to know of a coded block.
#[derive(Clone, Copy, Debug)]
pub struct CodedBlock {
    /// Its vector, if it had one.
    pub vector: Option<Vector>,
    /// How many of its levels were not zero.
    pub count: u8,
}

impl MainReference {
    /// Of the extended volume of a frame, the frame's symbols, whose blocks are the coded ones in the same order, and its masks,
    /// by index in the volume.
    #[must_use]
    pub fn new(extended: Extended, symbols: &FrameSymbols, masks: BTreeMap<u32, VoxelMask>) -> Self {
        let volume = extended.volume.with_unobserved(masks);
        let mut blocks = symbols.modes.iter().enumerate();
        let mut next = || {
            let (block, mode) = blocks.next()?;
            Some(CodedBlock { vector: mode.vector(), count: symbols.levels.count(block) })
        };
        let coded = extended.coded.iter().map(|coded| if *coded { next() } else { None }).collect();
        Self { reference: Reference::with_index(volume, extended.index), coded }
    }

    /// The volume: coded blocks and those around them.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        self.reference.volume()
    }

    /// The volume with its look-up.
    #[must_use]
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The samples of the volume, for their memory to serve another frame.
    #[must_use]
    pub fn into_samples(self) -> Vec<i16> {
        self.reference.into_volume().into_samples()
    }

    /// A finder of the blocks of the volume around others.
    #[must_use]
    pub fn finder(&self) -> NeighbourFinder<'_> {
        NeighbourFinder::new(self.reference.index())
    }

    /// How the block at a coordinate was coded, if it was.
    #[must_use]
    pub fn coded(&self, coord: BlockCoord) -> Option<CodedBlock> {
        self.reference.index().get(coord).and_then(|block| self.coded[block as usize])
    }

    /// How a block of the volume was coded, if it was.
    #[must_use]
    pub fn coded_at(&self, block: usize) -> Option<CodedBlock> {
        self.coded[block]
    }
}
