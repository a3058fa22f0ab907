//! How the colour of blocks is predicted, and how deep its samples are.

use crate::main::syntax::modes::{ModeContext, ModeModels};
use crate::main::{BlockMode, CausalBlocks, CodedBlock};
use crate::shared::syntax::SyntaxError;
use isv_entropy::{BitModel, RangeDecoder};
use std::ops::Range;

/// Models of modes and depths.
#[derive(Clone, Debug, Default)]
pub struct ColourModeModels {
    /// Models of modes and vectors, which are those of geometry in kind.
    pub modes: ModeModels,
    depth_by_neighbours: [[BitModel; 10]; 2],
    depth_by_before: [[BitModel; 4]; 2],
}

/// A block in the frame before, as the syntax sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockBefore {
    /// Vector, if the block had one.
    pub vector: Option<crate::main::Vector>,
    /// Depth of its samples.
    pub depth: u8,
    /// Which of its layers had coefficients.
    pub coded: [bool; 3],
}

impl BlockBefore {
    /// Converts the block for the contexts of modes.
    #[must_use]
    pub fn for_modes(&self) -> CodedBlock {
        let count = self.coded.iter().map(|coded| 2 * u8::from(*coded)).sum();
        CodedBlock { vector: self.vector, count }
    }
}

/// The blocks of a slice as the syntax of modes sees them.
#[derive(Clone, Debug)]
pub struct ModeBlocks<'a> {
    /// The slice's blocks.
    pub range: Range<usize>,
    /// Which of the blocks around a block precede it in its slice.
    pub causal: &'a CausalBlocks,
    /// All blocks of the frame as they were in the frame before.
    pub before: &'a [Option<BlockBefore>],
    /// Whether blocks may be predicted from the frame before.
    pub predicts: bool,
    /// Deepest depth of the stream.
    pub max_depth: u8,
}

/// Context of a block's depth.
#[derive(Clone, Copy, Debug)]
pub struct DepthContext {
    around: usize,
    before: usize,
}

impl DepthContext {
    /// The context of a block. `depth`: of the blocks before it.
    #[must_use]
    pub fn new(block: usize, blocks: &ModeBlocks, depth: impl Fn(usize) -> u8) -> Self {
        let neighbours = blocks.causal.merge_neighbours(block).take(3);
        let (known, sum) =
            neighbours.fold((0, 0), |(known, sum), n| (known + 1, sum + usize::from(depth(n))));
        let around = if known == 0 { 9 } else { (2 * sum * 2 + known) / (2 * known) };
        Self {
            around: around.min(9),
            before: blocks.before[block].map_or(3, |before| usize::from(before.depth)),
        }
    }
}

impl ColourModeModels {
    /// Models of whether a block is deeper than `depth`, given that it is as deep.
    pub fn deeper(&mut self, context: &DepthContext, depth: u8) -> [&mut BitModel; 2] {
        let depth = usize::from(depth);
        [
            &mut self.depth_by_neighbours[depth][context.around],
            &mut self.depth_by_before[depth][context.before],
        ]
    }

    /// Reads the modes and depths of a slice's blocks.
    ///
    /// # Errors
    /// Vectors out of range, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        blocks: &ModeBlocks,
    ) -> Result<(Vec<BlockMode>, Vec<u8>), SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        let (mut modes, mut depths) = (Vec::new(), Vec::<u8>::new());
        let start = blocks.range.start;
        for block in blocks.range.clone() {
            let mode = if blocks.predicts {
                let before = blocks.before[block].map(|before| before.for_modes());
                let context = ModeContext::new(block, blocks.causal, |n| modes[n - start], before);
                self.modes.read_mode(&mut decoder, &context, 1)?
            } else {
                BlockMode::Spatial
            };
            modes.push(mode);
            let context = DepthContext::new(block, blocks, |n| depths[n - start]);
            let depth =
                (0..blocks.max_depth).take_while(|depth| decoder.decode_mixed(self.deeper(&context, *depth)));
            let depth = depth.count() as u8;
            depths.push(depth);
            if decoder.overran() {
                return Err(SyntaxError("the colour modes end too early"));
            }
        }
        Ok((modes, depths))
    }
}
