//! The frame before, as the next one sees it.

use super::{CodedBlock, FrameSymbols, MainBlocks};
use crate::main::extension::DecodedBlocks;
use isv_volume::{BlockIndex, BlockSet, NeighbourFinder, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// A decoded frame: its volume with the extension, and what its blocks were coded as.
#[derive(Clone, Debug)]
pub struct MainReference {
    decoded: DecodedBlocks,
    /// For each block of the volume, how it was coded; `None` if the decoder made it up.
    coded: Vec<Option<CodedBlock>>,
    skipped: BlockSet,
}

impl MainReference {
    /// Makes a reference of the extended volume of a frame, the frame's symbols and its masks, by index in the volume. The blocks
    /// of the symbols are those coded in the frame, in the same order.
    #[must_use]
    pub fn new(decoded: DecodedBlocks, symbols: FrameSymbols, masks: BTreeMap<u32, VoxelMask>) -> Self {
        let coded = CodedBlock::of_frame(decoded.sets(), &symbols);
        let mut reference = Self { decoded, coded, skipped: symbols.skipped };
        reference.add_unobserved(masks);
        reference
    }

    /// Adds unobserved voxels, by index in the volume.
    pub(crate) fn add_unobserved(&mut self, masks: BTreeMap<u32, VoxelMask>) {
        self.decoded.add_unobserved(masks);
    }

    /// The frame's blocks, without their samples.
    #[must_use]
    pub fn blocks(&self) -> MainBlocks<'_> {
        MainBlocks {
            blocks: self.decoded.blocks(),
            sets: self.decoded.sets(),
            coded: &self.coded,
            skipped: &self.skipped,
        }
    }

    /// The frame with all its blocks.
    #[must_use]
    pub fn decoded(&self) -> &DecodedBlocks {
        &self.decoded
    }

    /// The volume: coded blocks and those around them.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        self.decoded.volume()
    }

    /// Look-up of the volume's blocks.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        self.decoded.index()
    }

    /// The samples of the volume, for their memory to serve another frame.
    #[must_use]
    pub fn into_spare_buffer(self) -> Vec<i16> {
        self.decoded.into_volume().into_spare_buffer()
    }

    /// A finder of the blocks of the volume around others.
    #[must_use]
    pub fn finder(&self) -> NeighbourFinder<'_> {
        NeighbourFinder::new(self.decoded.index())
    }
}
