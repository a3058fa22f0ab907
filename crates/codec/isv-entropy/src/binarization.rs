//! Integers as sequences of binary decisions.

use crate::{BitModel, DecisionSink, RangeDecoder};

/// Largest magnitude that an [`IntegerModel`] codes: `2^20`.
pub const MAGNITUDE_LIMIT: u32 = 1 << 20;

/// Exponents `ilog2(magnitude)` are 0 ..= 20, coded in unary.
const EXPONENTS: usize = MAGNITUDE_LIMIT.ilog2() as usize + 1;
/// How many mantissa bits below the leading one have models; the rest are nearly uniform and are sent raw.
const MODELLED_MANTISSA_BITS: u32 = 2;

/// Adaptive model of a signed integer, zero most likely.
///
/// An integer is coded as zero or not, sign, exponent `e = ilog2(magnitude)` in unary, then the `e` bits below the leading one.
/// The first two of these bits have models of their own.
///
/// The model learns what a table of frequencies would learn about small values, and about large ones the shape only. So a DC
/// coefficient of a thousand levels needs no thousand-symbol alphabet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegerModel {
    zero: BitModel,
    negative: BitModel,
    exponent: [BitModel; EXPONENTS - 1],
    /// Per exponent, a binary tree over the modelled bits: node 1 for the first, 2 or 3 for the second.
    mantissa: [[BitModel; 1 << MODELLED_MANTISSA_BITS]; EXPONENTS],
}

impl Default for IntegerModel {
    /// Creates a model that has learned nothing. Sets of models call it at many places: inlined, it is 2 % of a decoder in WebAssembly.
    #[inline(never)]
    fn default() -> Self {
        Self {
            zero: BitModel::default(),
            negative: BitModel::default(),
            exponent: Default::default(),
            mantissa: Default::default(),
        }
    }
}

impl IntegerModel {
    /// Codes a value of magnitude up to [`MAGNITUDE_LIMIT`].
    pub fn encode(&mut self, sink: &mut impl DecisionSink, value: i32) {
        sink.put(&mut self.zero, value == 0);
        if value != 0 {
            sink.put(&mut self.negative, value < 0);
            self.encode_magnitude(sink, value.unsigned_abs());
        }
    }

    /// Decodes a value of magnitude up to [`MAGNITUDE_LIMIT`], whatever the bytes.
    pub fn decode(&mut self, decoder: &mut RangeDecoder) -> i32 {
        if decoder.decode(&mut self.zero) {
            return 0;
        }
        let negative = decoder.decode(&mut self.negative);
        let magnitude = self.decode_magnitude(decoder) as i32;
        if negative { -magnitude } else { magnitude }
    }

    fn encode_magnitude(&mut self, sink: &mut impl DecisionSink, magnitude: u32) {
        debug_assert!((1..=MAGNITUDE_LIMIT).contains(&magnitude));
        let exponent = magnitude.ilog2();
        for e in 0..EXPONENTS - 1 {
            sink.put(&mut self.exponent[e], exponent > e as u32);
            if exponent == e as u32 {
                break;
            }
        }
        let modelled = exponent.min(MODELLED_MANTISSA_BITS);
        let mut node = 1;
        for position in (exponent - modelled..exponent).rev() {
            let bit = magnitude >> position & 1;
            sink.put(&mut self.mantissa[exponent as usize][node], bit != 0);
            node = node << 1 | bit as usize;
        }
        sink.put_raw(magnitude, exponent - modelled);
    }

    fn decode_magnitude(&mut self, decoder: &mut RangeDecoder) -> u32 {
        let mut exponent = 0;
        while exponent < EXPONENTS - 1 && decoder.decode(&mut self.exponent[exponent]) {
            exponent += 1;
        }
        let modelled = (exponent as u32).min(MODELLED_MANTISSA_BITS);
        let mut node = 1;
        for _ in 0..modelled {
            let bit = decoder.decode(&mut self.mantissa[exponent][node]);
            node = node << 1 | usize::from(bit);
        }
        let raw = exponent as u32 - modelled;
        let magnitude = (node as u32) << raw | decoder.decode_raw(raw);
        magnitude.min(MAGNITUDE_LIMIT)
    }
}
