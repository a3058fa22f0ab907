//! Decoded symbols of a colour part.

use crate::main::BlockMode;

/// A coefficient that is not zero in every channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficient {
    /// Place among all coefficients of the block's layer: the root's mean, then differences level by level, node by node.
    pub place: u32,
    /// Levels of luma and of both colour differences.
    pub levels: [i16; 3],
}

/// The coefficients of one layer, block after block.
#[derive(Clone, Debug, Default)]
pub struct LayerCoefficients {
    /// End of each block's coefficients.
    pub ends: Vec<u32>,
    /// Coefficients of all blocks.
    pub coefficients: Vec<Coefficient>,
}

impl LayerCoefficients {
    /// Coefficients of a block; none if the layer was not read.
    #[must_use]
    pub fn of_block(&self, block: usize) -> &[Coefficient] {
        let Some(end) = self.ends.get(block) else { return &[] };
        let start = if block == 0 { 0 } else { self.ends[block - 1] };
        &self.coefficients[start as usize..*end as usize]
    }

    /// Adds the coefficients of the next block.
    pub fn push_block(&mut self, coefficients: impl IntoIterator<Item = Coefficient>) {
        self.coefficients.extend(coefficients);
        self.ends.push(self.coefficients.len() as u32);
    }

    /// Adds the blocks of another slice.
    pub fn append(&mut self, other: &Self) {
        let before = self.coefficients.len() as u32;
        self.coefficients.extend(&other.coefficients);
        self.ends.extend(other.ends.iter().map(|end| end + before));
    }
}

/// The symbols of a frame's colour.
#[derive(Clone, Debug, Default)]
pub struct ColourSymbols {
    /// Prediction of each block: spatial ones from blocks of the same frame, others from the frame before. Vectors count eighths of a
    /// voxel: the colour at a point comes from that point less the vector.
    pub modes: Vec<BlockMode>,
    /// Depth of each block's samples.
    pub depths: Vec<u8>,
    /// Coefficients of each layer.
    pub layers: [LayerCoefficients; 3],
}
