//! A decoded frame as the next one is predicted from it.

use super::frame::ColourFrame;
use super::symbols::ColourSymbols;
use super::syntax::modes::BlockBefore;
use isv_volume::BlockCoord;
use rayon::prelude::*;
use std::sync::Arc;

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

    /// How the blocks at these coordinates were coded.
    #[must_use]
    pub fn blocks_at(&self, coords: &[BlockCoord]) -> Vec<Option<BlockBefore>> {
        let index = self.frame.shape.cells().index();
        coords.par_iter().map(|coord| Some(self.blocks[index.get(*coord)? as usize])).collect()
    }
}
