//! The writing side of the syntax of profile `main`: each file mirrors the one of the same name in `isv-decode`.

pub(crate) mod block_set;
pub(crate) mod coefficients;
pub(crate) mod masks;
pub(crate) mod modes;

use isv_entropy::{BitModel, IntegerModel, RangeEncoder, mixed_cost};

/// What takes decisions: the range coder, or a count of what they would cost.
pub(crate) trait DecisionSink {
    fn mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool);
    fn integer(&mut self, model: &mut IntegerModel, value: i32);
}

impl DecisionSink for RangeEncoder {
    fn mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        self.encode_mixed(models, bit);
    }

    fn integer(&mut self, model: &mut IntegerModel, value: i32) {
        model.encode(self, value);
    }
}

/// Bits that decisions would take under the models as they are; nothing learns from it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BitCount(pub f32);

impl DecisionSink for BitCount {
    fn mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        self.0 += mixed_cost(models, bit);
    }

    fn integer(&mut self, model: &mut IntegerModel, value: i32) {
        self.0 += model.cost(value);
    }
}
