//! Entropy-coded syntax of profile `paper`: the models of each kind of symbol and the reading side. `isv-encode` has the writing side
//! of each file under the same name.

pub mod coefficients;
pub mod motion;

pub use motion::CausalNeighbours;

use crate::shared::syntax::block_set::BlockSetModels;
use crate::shared::syntax::masks::MaskModels;
use coefficients::CoefficientModels;
use isv_format::FrameHeader;
use motion::MotionModels;

/// Most slices for K coefficients. Each slice has models of its own, so this bounds what a frame header can make the
/// decoder allocate: 65,536 coefficient models of a kilobyte.
#[must_use]
pub fn most_slices(coefficients: usize) -> usize {
    ((1 << 16) / coefficients).clamp(1, usize::from(FrameHeader::MAX_SLICES))
}

/// All adaptive models of a stream. Fresh at every keyframe, kept from frame to frame within a GOP.
#[derive(Clone, Debug)]
pub struct EntropyState {
    coefficients: usize,
    /// Models of the set of blocks.
    pub block_set: BlockSetModels,
    /// Models of unobserved voxels.
    pub masks: MaskModels,
    slices: Vec<SliceModels>,
}

/// Models of one slice.
#[derive(Clone, Debug)]
pub struct SliceModels {
    /// Models of motion vectors.
    pub motion: MotionModels,
    /// Models of quantized coefficients.
    pub coefficients: CoefficientModels,
}

impl EntropyState {
    /// Fresh models for K coefficients a block.
    #[must_use]
    pub fn new(coefficients: usize) -> Self {
        Self {
            coefficients,
            block_set: BlockSetModels::default(),
            masks: MaskModels::default(),
            slices: Vec::new(),
        }
    }

    /// Models of the first `count` slices; a slice that earlier frames of the GOP did not have begins afresh.
    pub fn slices(&mut self, count: usize) -> &mut [SliceModels] {
        while self.slices.len() < count {
            self.slices.push(SliceModels {
                motion: MotionModels::default(),
                coefficients: CoefficientModels::new(self.coefficients),
            });
        }
        &mut self.slices[..count]
    }
}
