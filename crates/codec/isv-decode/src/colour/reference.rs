//! A decoded frame as the next one is predicted from it.

use super::cells::ColourCells;
use super::decoder::{ColourError, check_samples};
use super::frame::{ColourFrame, ColourShape};
use super::reconstruct::{ColourSteps, reconstruct};
use super::symbols::ColourSymbols;
use super::syntax::modes::BlockBefore;
use crate::main::{BlockMode, Vector};
use isv_format::ColourKind;
use isv_volume::{BlockCoord, SparseVolume};
use rayon::prelude::*;
use std::sync::Arc;

/// The mode of all blocks of a frame that is carried over.
pub(super) const CARRIED_OVER: BlockMode = BlockMode::Merged { candidate: 0, vector: Vector::ZERO };

/// A decoded frame, and how its blocks were coded.
#[derive(Clone, Debug, Default)]
pub struct ColourReference {
    /// The frame.
    pub frame: Arc<ColourFrame>,
    blocks: Vec<BlockBefore>,
}

impl ColourReference {
    /// Creates the reference that a frame with these symbols leaves.
    #[must_use]
    pub fn new(frame: Arc<ColourFrame>, symbols: &ColourSymbols) -> Self {
        let of_block = |block: usize| BlockBefore {
            vector: symbols.modes[block].vector(),
            depth: symbols.depths[block],
            coded: [0, 1, 2].map(|layer| !symbols.layers[layer].of_block(block).is_empty()),
        };
        let blocks = (0..symbols.modes.len()).map(of_block).collect();
        Self { frame, blocks }
    }

    /// Carries the frame over to the next one, which has no colour part: each block keeps its depth and what lies on its surface.
    ///
    /// # Errors
    /// More samples than a frame may have.
    pub fn carried_over(&self, volume: &SparseVolume) -> Result<Self, ColourError> {
        let cells = ColourCells::new(volume);
        let before = self.blocks_at(cells.coords());
        let symbols = ColourSymbols {
            modes: vec![CARRIED_OVER; before.len()],
            depths: before.iter().map(|block| block.map_or(0, |block| block.depth)).collect(),
            layers: Default::default(),
        };
        check_samples(&cells, &symbols.depths)?;
        let shape = ColourShape::new(cells, symbols.depths.clone(), volume);
        let kind = ColourKind::Predicted;
        let frame = reconstruct(kind, shape, &symbols, &ColourSteps::FINEST, &self.frame);
        Ok(Self::new(Arc::new(frame), &symbols))
    }

    /// How the blocks at these coordinates were coded.
    #[must_use]
    pub fn blocks_at(&self, coords: &[BlockCoord]) -> Vec<Option<BlockBefore>> {
        let index = self.frame.shape.cells().index();
        coords.par_iter().map(|coord| Some(self.blocks[index.get(*coord)? as usize])).collect()
    }
}
