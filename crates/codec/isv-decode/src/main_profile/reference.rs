//! The frame before, as the next one sees it.

use super::{CodedBlock, FrameSymbols, MainBlocks};
use crate::Reference;
use crate::extension::Extended;
use isv_volume::{BlockSet, NeighbourFinder, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// A decoded frame: its volume with the extension, and what its blocks were coded as.
#[derive(Clone, Debug)]
pub struct MainReference {
    extended: Extended,
    /// For each block of the volume, how it was coded; `None` if the decoder made it up.
    coded: Vec<Option<CodedBlock>>,
    skipped: BlockSet,
}

impl MainReference {
    /// Of the extended volume of a frame, the frame's symbols, whose blocks are those coded in it in the same order, and its
    /// masks, by index in the volume.
    #[must_use]
    pub fn new(extended: Extended, symbols: FrameSymbols, masks: BTreeMap<u32, VoxelMask>) -> Self {
        let coded = CodedBlock::of_frame(&extended.blocks, &symbols);
        let mut reference = Self { extended, coded, skipped: symbols.skipped };
        reference.add_unobserved(masks);
        reference
    }

    /// Adds unobserved voxels, by index in the volume.
    pub(crate) fn add_unobserved(&mut self, masks: BTreeMap<u32, VoxelMask>) {
        self.extended.add_unobserved(masks);
    }

    /// Its blocks, without their samples.
    #[must_use]
    pub fn blocks(&self) -> MainBlocks<'_> {
        MainBlocks {
            blocks: self.extended.reference.blocks(),
            sets: &self.extended.blocks,
            coded: &self.coded,
            skipped: &self.skipped,
        }
    }

    /// The frame with all its blocks.
    #[must_use]
    pub fn extended(&self) -> &Extended {
        &self.extended
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
    pub fn into_spare_buffer(self) -> Vec<i16> {
        self.extended.reference.into_volume().into_spare_buffer()
    }

    /// A finder of the blocks of the volume around others.
    #[must_use]
    pub fn finder(&self) -> NeighbourFinder<'_> {
        NeighbourFinder::new(self.extended.index())
    }
}
