//! Uniform scalar quantizer with plain rounding (Sec. 3.3).

/// Fractional bits of a step.
pub const STEP_FRACTION_BITS: u32 = 4;

/// A quantizer step: 1/16 codes of the orthonormal transform, so that 16 is one code and 4096 one voxel edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepSize(u32);

impl StepSize {
    /// A sixteenth of a code up to 65536 codes.
    pub const RANGE: std::ops::RangeInclusive<u32> = 1..=1 << 20;

    /// From sixteenths of a code; `None` outside [`Self::RANGE`].
    #[must_use]
    pub fn new(sixteenths: u32) -> Option<Self> {
        Self::RANGE.contains(&sixteenths).then_some(Self(sixteenths))
    }

    /// In sixteenths of a code.
    #[must_use]
    pub fn sixteenths(self) -> u32 {
        self.0
    }
}

/// Quantizer of one coefficient class (DC or AC) under a transform's coefficient scale.
#[derive(Clone, Copy, Debug)]
pub struct Quantizer {
    step: i32,
    /// Sixteenths of an orthonormal code in one coefficient unit, as a power of two.
    unit_shift: u32,
    /// Largest level that has a code and whose product with the step stays inside `i32`.
    level_limit: i32,
}

impl Quantizer {
    /// Largest magnitude of a level that either profile's syntax has a code for.
    pub const LARGEST_LEVEL: i32 = 1 << 20;

    /// A quantizer for coefficients at `2^coefficient_exponent` of the orthonormal scale, -6 to 3.
    #[must_use]
    pub fn new(step: StepSize, coefficient_exponent: i32) -> Self {
        let step = step.0 as i32;
        let unit_shift = (STEP_FRACTION_BITS as i32 - coefficient_exponent) as u32;
        Self { step, unit_shift, level_limit: (((1 << 30) - 1) / step).min(Self::LARGEST_LEVEL) }
    }

    /// The step in sixteenths of a code.
    #[must_use]
    pub fn step(&self) -> i32 {
        self.step
    }

    /// Base-2 logarithm of the sixteenths of an orthonormal code in one coefficient unit: 1 to 10.
    #[must_use]
    pub fn unit_shift(&self) -> u32 {
        self.unit_shift
    }

    /// Largest level: one that has a code, and whose product with the step stays inside 30 bits.
    #[must_use]
    pub fn level_limit(&self) -> i32 {
        self.level_limit
    }

    /// Nearest level of a coefficient, halves away from zero, up to [`Self::level_limit`].
    #[must_use]
    pub fn quantize(&self, coefficient: i16) -> i32 {
        let magnitude = i32::from(coefficient).abs() << self.unit_shift;
        let level = ((magnitude + self.step / 2) / self.step).min(self.level_limit);
        if coefficient < 0 { -level } else { level }
    }

    /// Coefficient of a level: `(level * step + half) >> unit_shift`, saturated to 16 bits; the level is first clamped
    /// so that the product stays below `2^30`.
    #[must_use]
    pub fn dequantize(&self, level: i32) -> i16 {
        let product = level.clamp(-self.level_limit, self.level_limit) * self.step;
        let rounded = (product + (1 << (self.unit_shift - 1))) >> self.unit_shift;
        rounded.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reconstruction_is_within_half_a_step_and_half_a_unit() {
        for step in [1, 16, 819, 8192, 100_000] {
            for exponent in [0, -2, -5] {
                let quantizer = Quantizer::new(StepSize::new(step).unwrap(), exponent);
                let half_step = f64::from(step) / 32.0 * 2f64.powi(exponent);
                for c in (i16::MIN..=i16::MAX).step_by(37) {
                    let level = quantizer.quantize(c);
                    if level.abs() == Quantizer::LARGEST_LEVEL {
                        continue;
                    }
                    let back = quantizer.dequantize(level);
                    let error = (f64::from(c) - f64::from(back)).abs();
                    assert!(error <= half_step + 0.5, "step {step} exponent {exponent}: {c} -> {back}");
                }
            }
        }
    }

    #[test]
    fn every_level_has_a_code() {
        for exponent in -6..=3 {
            let quantizer = Quantizer::new(StepSize::new(1).unwrap(), exponent);
            for c in [i16::MIN, i16::MIN + 1, -1, 0, 1, i16::MAX] {
                let level = quantizer.quantize(c);
                assert!(level.abs() <= Quantizer::LARGEST_LEVEL, "exponent {exponent}: {c} -> {level}");
                assert_eq!(level.signum(), i32::from(c).signum());
            }
        }
    }

    #[test]
    fn hostile_levels_saturate() {
        for step in [1, 1 << 20] {
            let quantizer = Quantizer::new(StepSize::new(step).unwrap(), -2);
            for level in [i32::MIN, i32::MIN + 1, i32::MAX] {
                let c = quantizer.dequantize(level);
                assert_eq!(i32::from(c).signum(), level.signum());
            }
        }
    }
}
