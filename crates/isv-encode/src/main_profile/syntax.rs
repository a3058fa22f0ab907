//! The writing side of the syntax of profile `main`: each file mirrors the one of the same name in `isv-decode`.

pub(crate) mod block_set;
pub(crate) mod coefficients;
pub(crate) mod masks;
pub(crate) mod modes;
pub(crate) mod still_cells;

use isv_entropy::{BitModel, IntegerModel, RangeEncoder, mixed_cost};

/// What takes decisions: the range coder, or a count of what they would cost.
pub(crate) trait DecisionSink {
    fn mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool);
    fn integer(&mut self, model: &mut IntegerModel, value: i32);
    /// The lowest `count` bits of `value`, highest first, each worth one bit.
    fn raw(&mut self, value: u32, count: u32);
}

impl DecisionSink for RangeEncoder {
    fn mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        self.encode_mixed(models, bit);
    }

    fn integer(&mut self, model: &mut IntegerModel, value: i32) {
        model.encode(self, value);
    }

    fn raw(&mut self, value: u32, count: u32) {
        self.encode_raw(value, count);
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

    fn raw(&mut self, _: u32, count: u32) {
        self.0 += count as f32;
    }
}
