//! Entropy-coded syntax of colour: the models of each kind of symbol and the reading side. `isv-encode` has the writing side of each
//! file under the same name.

pub mod coefficients;
pub mod modes;

use coefficients::CoefficientModels;
use modes::ColourModeModels;

/// All adaptive models of a stream's colour, by slice. Fresh at every keyframe, kept from frame to frame within a GOP.
#[derive(Clone, Debug, Default)]
pub struct ColourSlices(Vec<ColourModels>);

/// Models of one slice.
#[derive(Clone, Debug, Default)]
pub struct ColourModels {
    /// Models of modes, depths and vectors.
    pub modes: ColourModeModels,
    /// Models of coefficients.
    pub coefficients: CoefficientModels,
}

impl ColourSlices {
    /// Models of the first `count` slices; a slice that earlier frames of the GOP did not have begins afresh.
    pub fn slices(&mut self, count: usize) -> &mut [ColourModels] {
        while self.0.len() < count {
            self.0.push(ColourModels::default());
        }
        &mut self.0[..count]
    }
}
