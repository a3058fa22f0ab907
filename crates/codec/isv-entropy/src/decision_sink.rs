//! Destinations of binary decisions: a stream, or a count of the bits that they would take.

use crate::model::PROBABILITY_BITS;
use crate::range_coder::mean_probability;
use crate::{BitModel, RangeEncoder};

/// Takes decisions in the order that they are coded in.
pub trait DecisionSink {
    /// A decision under a model.
    fn put(&mut self, model: &mut BitModel, bit: bool);

    /// A decision under the mean of several models.
    fn put_mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool);

    /// The lowest `count` bits of `value`, highest first, each worth one bit.
    fn put_raw(&mut self, value: u32, count: u32);
}

impl DecisionSink for RangeEncoder {
    fn put(&mut self, model: &mut BitModel, bit: bool) {
        self.encode(model, bit);
    }

    fn put_mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        self.encode_mixed(models, bit);
    }

    fn put_raw(&mut self, value: u32, count: u32) {
        self.encode_raw(value, count);
    }
}

/// Bits that decisions would take under the models as they are; nothing learns from it.
#[derive(Clone, Copy, Debug, Default)]
pub struct BitCount(pub f32);

impl DecisionSink for BitCount {
    fn put(&mut self, model: &mut BitModel, bit: bool) {
        self.0 += bits(model.probability_of_one(), bit);
    }

    fn put_mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        self.0 += bits(mean_probability(&models), bit);
    }

    fn put_raw(&mut self, _: u32, count: u32) {
        self.0 += count as f32;
    }
}

/// What a decision takes if a 1 is as probable as `one`, in `2^-PROBABILITY_BITS`.
fn bits(one: u32, bit: bool) -> f32 {
    PROBABILITY_BITS as f32 - ((if bit { one } else { (1 << PROBABILITY_BITS) - one }) as f32).log2()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IntegerModel;

    #[test]
    fn the_count_is_what_the_encoder_takes() {
        let mut encoder = RangeEncoder::new();
        let (mut integers, mut models) = (IntegerModel::default(), [BitModel::default(); 2]);
        let (mut counted, values) = (0.0, [0, 0, 1, -1, 3, 0, -700, 0, 2, 1 << 20, 0, 5]);
        for _ in 0..200 {
            for value in values {
                let mut bits = BitCount::default();
                integers.encode(&mut bits, value);
                let [one, other] = &mut models;
                bits.put_mixed([one, other], value > 1);
                counted += f64::from(bits.0);
                integers.encode(&mut encoder, value);
                let [one, other] = &mut models;
                encoder.put_mixed([one, other], value > 1);
            }
        }
        // The range is 32 bits, of which the coder loses a little; a count learns nothing.
        assert!((counted / encoder.bits() - 1.0).abs() < 1e-3, "{counted} {}", encoder.bits());
    }
}
