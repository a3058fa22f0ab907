//! The adaptive probability of one binary decision.

/// Fractional bits of an estimate, enough for the slow average to get within `2^-15` of certainty.
const ESTIMATE_BITS: u32 = 26;
/// Fractional bits of the probability that the range coder uses.
pub(crate) const PROBABILITY_BITS: u32 = 16;
/// Adaptation shifts of the two averages once warmed up: one follows changes, one is precise.
const FAST_SHIFT: u32 = 6;
const SLOW_SHIFT: u32 = 9;

/// Estimate of the probability that a bit is 1: the mean of a fast and a slow exponential average. Both start as plain averages,
/// so that the first few symbols already count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitModel {
    fast: u32,
    slow: u32,
    seen: u32,
}

impl Default for BitModel {
    /// One half, nothing seen.
    fn default() -> Self {
        Self { fast: 1 << (ESTIMATE_BITS - 1), slow: 1 << (ESTIMATE_BITS - 1), seen: 0 }
    }
}

impl BitModel {
    /// Probability of a 1 in `2^-16`, never 0 or 1: 4 to 65532.
    #[inline]
    pub(crate) fn probability_of_one(&self) -> u32 {
        let mean = (self.fast + self.slow) >> (ESTIMATE_BITS - PROBABILITY_BITS + 1);
        mean.clamp(4, (1 << PROBABILITY_BITS) - 4)
    }

    /// Learns from one coded bit.
    ///
    /// While `seen` counts up, the shift grows with its logarithm: the n-th symbol moves the estimate by about `1/n`.
    #[inline]
    pub(crate) fn update(&mut self, bit: bool) {
        let warm_up = 1 + (self.seen + 1).ilog2();
        self.fast = approach(self.fast, bit, warm_up.min(FAST_SHIFT));
        self.slow = approach(self.slow, bit, warm_up.min(SLOW_SHIFT));
        self.seen = (self.seen + 1).min(1 << SLOW_SHIFT);
    }
}

/// Moves an estimate towards 1 or 0 by `2^-shift` of the way.
#[inline]
fn approach(estimate: u32, bit: bool, shift: u32) -> u32 {
    if bit { estimate + (((1 << ESTIMATE_BITS) - estimate) >> shift) } else { estimate - (estimate >> shift) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimate_converges_to_the_frequency() {
        let mut model = BitModel::default();
        let mut mean = 0.0;
        for i in 0..20_000u32 {
            model.update(i.wrapping_mul(2_654_435_761) >> 16 & 255 < 26);
            if i >= 10_000 {
                mean += f64::from(model.probability_of_one()) / 65536.0 / 10_000.0;
            }
        }
        assert!((mean - 26.0 / 256.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn certainty_is_never_reached() {
        for bit in [false, true] {
            let mut model = BitModel::default();
            (0..100_000).for_each(|_| model.update(bit));
            assert!((4..=65532).contains(&model.probability_of_one()));
        }
    }
}
