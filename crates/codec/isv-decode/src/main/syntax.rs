//! Entropy-coded syntax of profile `main`: the models of each kind of symbol and the reading side. `isv-encode` has the writing
//! side of each file under the same name.
//!
//! Contexts are few and small. A decision that depends on several things is coded under the mean of several models' estimates.
//! Each model has one or two of those things as its context.

pub mod block_set;
pub mod cells;
pub mod coefficients;
pub mod masks;
pub mod modes;
pub mod skip_cells;

use block_set::BlockSetModels;
use cells::CellModels;
use coefficients::CoefficientModels;
use masks::MaskModels;
use modes::ModeModels;

/// All adaptive models of a stream. Fresh at every keyframe, kept from frame to frame within a GOP.
#[derive(Clone, Debug, Default)]
pub struct EntropyState {
    /// Models of the set of coded blocks.
    pub block_set: BlockSetModels,
    /// Models of unobserved voxels.
    pub masks: MaskModels,
    /// Models of the cells that are not drawn, of streams that code these.
    pub cells: CellModels,
    slices: Vec<SliceModels>,
}

/// Models of one slice.
#[derive(Clone, Debug, Default)]
pub struct SliceModels {
    /// Models of modes and vectors.
    pub modes: ModeModels,
    /// Models of quantized coefficients.
    pub coefficients: CoefficientModels,
}

impl EntropyState {
    /// Models of the block set and of the first `count` slices, which can be coded at the same time.
    pub fn block_set_and_slices(&mut self, count: usize) -> (&mut BlockSetModels, &mut [SliceModels]) {
        self.slices(count);
        (&mut self.block_set, &mut self.slices[..count])
    }

    /// Models of the first `count` slices; a slice that earlier frames of the GOP did not have begins afresh.
    pub fn slices(&mut self, count: usize) -> &mut [SliceModels] {
        while self.slices.len() < count {
            self.slices.push(SliceModels::default());
        }
        &mut self.slices[..count]
    }
}
