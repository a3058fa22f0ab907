//! Random numbers that can be had again.

use glam::DVec3;
use isv_volume::SplitMix64;

/// A small seeded generator, so that a failing case can be run again.
#[derive(Clone, Debug)]
pub struct Random(SplitMix64);

impl Random {
    /// A generator that always gives the same numbers for a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Uniform in -1..1.
    pub fn signed(&mut self) -> f64 {
        2.0 * self.0.next_f64() - 1.0
    }

    /// Uniform in the cube -1..1.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }
}
