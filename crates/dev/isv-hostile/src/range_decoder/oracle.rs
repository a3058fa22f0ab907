//! The definition, line by line. Numbers are wide and reduced only where it says so.

use std::fmt;

/// Section 7.2.
pub(super) struct Decoder<'a> {
    segment: &'a [u8],
    position: usize,
    range: i128,
    code: i128,
}

impl<'a> Decoder<'a> {
    pub(super) fn new(segment: &'a [u8]) -> Self {
        let mut decoder = Self { segment, position: 0, range: (1 << 32) - 1, code: 0 };
        for _ in 0..4 {
            decoder.code = decoder.code << 8 | decoder.next_byte();
        }
        decoder
    }

    fn next_byte(&mut self) -> i128 {
        let byte = if self.position < self.segment.len() { self.segment[self.position] } else { 0 };
        self.position += 1;
        i128::from(byte)
    }

    fn renormalize(&mut self) {
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.code = (self.code << 8 | self.next_byte()) % (1 << 32);
        }
    }

    fn decode(&mut self, model: &mut Model) -> i64 {
        self.decode_mixed(std::slice::from_mut(model), &[0])
    }

    /// `chosen`: which of the models.
    pub(super) fn decode_mixed(&mut self, models: &mut [Model], chosen: &[usize]) -> i64 {
        let sum: i128 = chosen.iter().map(|model| models[*model].probability()).sum();
        let bound = (self.range >> 16) * (sum / chosen.len() as i128);
        let bit = if self.code < bound {
            self.range = bound;
            1
        } else {
            self.code -= bound;
            self.range -= bound;
            0
        };
        for model in chosen {
            models[*model].update(bit);
        }
        self.renormalize();
        bit
    }

    pub(super) fn decode_raw(&mut self, count: u32) -> i64 {
        let mut value = 0;
        for _ in 0..count {
            self.range >>= 1;
            let bit = if self.code >= self.range {
                self.code -= self.range;
                1
            } else {
                0
            };
            value = value << 1 | bit;
            self.renormalize();
        }
        value
    }

    /// Whether the segment is malformed for what was read of it.
    pub(super) fn overran(&self) -> bool {
        self.position > self.segment.len() + 4
    }

    /// Range and position in one number: the bits that were read.
    pub(super) fn bits(&self) -> f64 {
        (8 * self.position) as f64 - (self.range as f64).log2()
    }
}

/// Section 7.3, a bit model.
#[derive(Clone, Copy)]
pub(super) struct Model {
    fast: i128,
    slow: i128,
    seen: i128,
}

/// Prints what the crate's prints.
impl fmt::Debug for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fast, slow, seen } = self;
        f.debug_struct("BitModel").field("fast", fast).field("slow", slow).field("seen", seen).finish()
    }
}

impl Default for Model {
    fn default() -> Self {
        Self { fast: 1 << 25, slow: 1 << 25, seen: 0 }
    }
}

impl Model {
    fn probability(&self) -> i128 {
        ((self.fast + self.slow) >> 11).clamp(4, 65532)
    }

    fn update(&mut self, bit: i64) {
        let w = 1 + (self.seen + 1).ilog2();
        self.fast = approach(self.fast, bit, w.min(6));
        self.slow = approach(self.slow, bit, w.min(9));
        self.seen = (self.seen + 1).min(512);
    }
}

fn approach(e: i128, bit: i64, shift: u32) -> i128 {
    if bit == 1 { e + (((1 << 26) - e) >> shift) } else { e - (e >> shift) }
}

/// Section 7.3, an integer model.
#[derive(Clone, Copy, Default)]
pub(super) struct Integer {
    zero: Model,
    negative: Model,
    exponent: [Model; 20],
    mantissa: [[Model; 4]; 21],
}

/// Prints what the crate's prints.
impl fmt::Debug for Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IntegerModel")
            .field("zero", &self.zero)
            .field("negative", &self.negative)
            .field("exponent", &self.exponent)
            .field("mantissa", &self.mantissa)
            .finish()
    }
}

impl Integer {
    pub(super) fn decode(&mut self, decoder: &mut Decoder) -> i64 {
        if decoder.decode(&mut self.zero) == 1 {
            return 0;
        }
        let n = decoder.decode(&mut self.negative);
        let mut e = 0;
        while e < 20 && decoder.decode(&mut self.exponent[e]) == 1 {
            e += 1;
        }
        let mut node = 1;
        let m = e.min(2);
        for _ in 0..m {
            node = node << 1 | decoder.decode(&mut self.mantissa[e][node as usize]);
        }
        let magnitude = node << (e - m) | decoder.decode_raw((e - m) as u32);
        let magnitude = magnitude.min(1 << 20);
        if n == 1 { -magnitude } else { magnitude }
    }
}
