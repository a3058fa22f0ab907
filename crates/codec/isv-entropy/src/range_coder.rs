//! Binary range coder, encoder and decoder side by side.

use crate::BitModel;
use crate::model::PROBABILITY_BITS;

/// Below this the range is scaled up by a byte.
const RENORMALIZE_BELOW: u32 = 1 << 24;

/// Writes bits into bytes.
#[derive(Clone, Debug)]
pub struct RangeEncoder {
    /// Low end of the interval: 32 bits and a carry.
    low: u64,
    range: u32,
    /// The last byte that a carry may still change, and how many 0xff bytes follow it.
    pending: Option<u8>,
    pending_ff: u64,
    bytes: Vec<u8>,
}

impl Default for RangeEncoder {
    fn default() -> Self {
        Self::new()
    }
}

impl RangeEncoder {
    /// An encoder that has written nothing.
    #[must_use]
    pub fn new() -> Self {
        Self { low: 0, range: u32::MAX, pending: None, pending_ff: 0, bytes: Vec::new() }
    }

    /// Codes a bit under an adaptive model, which learns from it.
    pub fn encode(&mut self, model: &mut BitModel, bit: bool) {
        self.encode_mixed([model], bit);
    }

    /// Codes a bit under the mean of several models' estimates, all of which learn from it. Each model sees the decision in
    /// another context, and their mean is better than any of them.
    pub fn encode_mixed<const N: usize>(&mut self, models: [&mut BitModel; N], bit: bool) {
        let bound = (self.range >> PROBABILITY_BITS) * mean_probability(&models);
        if bit {
            self.range = bound;
        } else {
            self.low += u64::from(bound);
            self.range -= bound;
        }
        models.into_iter().for_each(|model| model.update(bit));
        self.renormalize();
    }

    /// Codes the lowest `count` bits of `value`, highest first, each at a cost of one bit.
    pub fn encode_raw(&mut self, value: u32, count: u32) {
        for bit in (0..count).rev() {
            self.range >>= 1;
            if value >> bit & 1 != 0 {
                self.low += u64::from(self.range);
            }
            self.renormalize();
        }
    }

    /// Bits written so far, fractions included: differences of it are what each symbol cost.
    #[must_use]
    pub fn bits(&self) -> f64 {
        let shifted_out = self.bytes.len() as u64 + u64::from(self.pending.is_some()) + self.pending_ff;
        (8 * shifted_out) as f64 + 32.0 - f64::from(self.range).log2()
    }

    /// The coded bytes. The decoder reads zeros past the end, so up to four zero bytes there are left off.
    #[must_use]
    pub fn finish(mut self) -> Vec<u8> {
        // Any number in low .. low + range will do: take the one with the most trailing zero bits.
        let high = self.low + u64::from(self.range) - 1;
        let keep = (0..=32).rev().find(|zeros| high >> zeros << zeros >= self.low).unwrap_or(0);
        self.low = high >> keep << keep;
        for _ in 0..5 {
            self.shift_low();
        }
        for _ in 0..4 {
            self.bytes.pop_if(|last| *last == 0);
        }
        self.bytes
    }

    fn renormalize(&mut self) {
        while self.range < RENORMALIZE_BELOW {
            self.range <<= 8;
            self.shift_low();
        }
    }

    /// Moves the top byte of `low` out; a carry ripples through the bytes held back for it.
    fn shift_low(&mut self) {
        let byte = (self.low >> 24) as u8;
        let carry = (self.low >> 32) as u8;
        if byte == 0xff && carry == 0 {
            self.pending_ff += 1;
        } else {
            if let Some(held) = self.pending {
                self.bytes.push(held.wrapping_add(carry));
            }
            for _ in 0..self.pending_ff {
                self.bytes.push(0xff_u8.wrapping_add(carry));
            }
            self.pending_ff = 0;
            self.pending = Some(byte);
        }
        self.low = self.low << 8 & 0xffff_ffff;
    }
}

/// Mean of the models' probabilities of a 1, rounded down.
pub(crate) fn mean_probability<const N: usize>(models: &[&mut BitModel; N]) -> u32 {
    models.iter().map(|model| model.probability_of_one()).sum::<u32>() / N as u32
}

/// Reads what [`RangeEncoder`] wrote. Any bytes decode to something; [`RangeDecoder::overran`] tells when that something
/// was made up.
#[derive(Clone, Debug)]
pub struct RangeDecoder<'a> {
    bytes: &'a [u8],
    position: usize,
    range: u32,
    /// Distance of the coded number from the low end of the interval.
    code: u32,
}

impl<'a> RangeDecoder<'a> {
    /// Starts on the bytes of one [`RangeEncoder::finish`].
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { bytes, position: 0, range: u32::MAX, code: 0 };
        for _ in 0..4 {
            decoder.code = decoder.code << 8 | decoder.next_byte();
        }
        decoder
    }

    /// Decodes a bit under an adaptive model, which learns from it.
    #[inline]
    pub fn decode(&mut self, model: &mut BitModel) -> bool {
        self.decode_mixed([model])
    }

    /// Decodes a bit under the mean of several models' estimates, all of which learn from it.
    #[inline]
    pub fn decode_mixed<const N: usize>(&mut self, models: [&mut BitModel; N]) -> bool {
        let bound = (self.range >> PROBABILITY_BITS) * mean_probability(&models);
        let bit = self.code < bound;
        if bit {
            self.range = bound;
        } else {
            self.code -= bound;
            self.range -= bound;
        }
        models.into_iter().for_each(|model| model.update(bit));
        self.renormalize();
        bit
    }

    /// Decodes `count` equally likely bits, highest first.
    pub fn decode_raw(&mut self, count: u32) -> u32 {
        let mut value = 0;
        for _ in 0..count {
            self.range >>= 1;
            let bit = u32::from(self.code >= self.range);
            self.code -= self.range * bit;
            value = value << 1 | bit;
            self.renormalize();
        }
        value
    }

    /// Bits read so far, fractions included: differences of it are what each symbol cost, as with [`RangeEncoder::bits`].
    #[must_use]
    pub fn bits(&self) -> f64 {
        // Four bytes were read before the first symbol, which are the 32 bits that the encoder starts from.
        (8 * self.position) as f64 - f64::from(self.range).log2()
    }

    /// Whether more was decoded than the bytes can hold: past the end by more than the four
    /// zeros that an encoder may leave off.
    #[must_use]
    pub fn overran(&self) -> bool {
        self.position > self.bytes.len() + 4
    }

    #[inline]
    fn renormalize(&mut self) {
        while self.range < RENORMALIZE_BELOW {
            self.range <<= 8;
            self.code = self.code << 8 | self.next_byte();
        }
    }

    #[inline]
    fn next_byte(&mut self) -> u32 {
        let byte = self.bytes.get(self.position).copied().unwrap_or(0);
        self.position += 1;
        u32::from(byte)
    }
}
