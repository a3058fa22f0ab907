//! What levels cost in bits, by what was coded lately. The pursuit asks thousands of times a block, so this is a table and
//! not the models themselves, whose contexts it averages.

use super::target::Field;
use isv_decode::main::{COEFFICIENTS, Level};

/// Magnitudes from here on cost the same.
const MAGNITUDES: usize = 32;
/// Counts from here on cost the same.
pub(crate) const COUNTS: usize = 70;
/// Blocks after which the table is made anew.
const REFRESH: u32 = 32;
/// What is left of the statistics of a frame in the next.
const DECAY: f32 = 0.5;
/// Bits of a place at least.
const LEAST_PLACE_BITS: f32 = 0.3;
/// Bits of a sign.
const SIGN_BITS: f32 = 1.0;
/// Bits saved on each place because places come in order and not as a list.
const ORDER_BITS: f32 = 1.0;

/// Statistics of coded levels and the costs that follow.
#[derive(Clone, Debug)]
pub(crate) struct LevelCosts {
    seen_places: [f32; COEFFICIENTS],
    seen_magnitudes: [f32; MAGNITUDES],
    seen_counts: [f32; COUNTS],
    /// Blocks and levels of this frame.
    blocks: usize,
    levels: usize,
    since_refresh: u32,
    /// Position in the block of each place.
    scan: [u16; COEFFICIENTS],
    /// Bits of a level at a place, its sign included and its magnitude not.
    place: [f32; COEFFICIENTS],
    /// What a level takes at least by position in the block; infinite where nothing is coded.
    least_at: Field,
    /// Bits of a magnitude, from 1.
    magnitude: [f32; MAGNITUDES],
    /// Bits of the number of levels in a block.
    count: [f32; COUNTS],
    /// The fewest bits of each.
    least_place: f32,
    least_magnitude: f32,
    pub least_count: f32,
}

impl LevelCosts {
    /// Costs before anything was coded: low frequencies, small levels and few of them are likely.
    pub(crate) fn new(scan: &[u16]) -> Self {
        let mut costs = Self {
            seen_places: std::array::from_fn(|k| 20.0 * (-(k as f32) / 25.0).exp() + 0.05),
            seen_magnitudes: std::array::from_fn(|m| 20.0 * 0.3f32.powi(m as i32) + 0.01),
            seen_counts: std::array::from_fn(|n| 10.0 * 0.8f32.powi(n as i32) + 0.01),
            blocks: 0,
            levels: 0,
            since_refresh: 0,
            scan: scan.try_into().expect("a position for each place"),
            least_at: [f32::INFINITY; 512],
            place: [0.0; COEFFICIENTS],
            magnitude: [0.0; MAGNITUDES],
            count: [0.0; COUNTS],
            least_place: 0.0,
            least_magnitude: 0.0,
            least_count: 0.0,
        };
        costs.refresh();
        costs
    }

    /// Replaces the bits of a block's number of levels.
    pub(crate) fn with_counts(mut self, count: [f32; COUNTS]) -> Self {
        self.count = count;
        self.summarize();
        self
    }

    /// Replaces the bits that a level at each place takes more than none, its sign and magnitude left out.
    pub(crate) fn with_places(mut self, bits: [f32; COEFFICIENTS]) -> Self {
        self.place = bits.map(|bits| bits.max(LEAST_PLACE_BITS) + SIGN_BITS);
        self.summarize();
        self
    }

    /// Bits of a level at a place in scan order; nothing for zero.
    #[inline(always)]
    pub(crate) fn level(&self, k: usize, level: i32) -> f32 {
        match level.unsigned_abs() as usize {
            0 => 0.0,
            magnitude => self.place[k] + self.magnitude[magnitude.min(MAGNITUDES) - 1],
        }
    }

    /// Bits that a level takes at least, by position in the block; infinite where nothing is coded.
    #[inline(always)]
    pub(crate) fn least_at(&self) -> &Field {
        &self.least_at
    }

    /// Bits of how many levels a block has.
    #[inline(always)]
    pub(crate) fn count(&self, count: usize) -> f32 {
        self.count[count.min(COUNTS - 1)]
    }

    /// Bits that the first level of a block takes at least.
    #[inline(always)]
    pub(crate) fn least_first(&self) -> f32 {
        self.least_place + self.least_magnitude + self.count[1] - self.count[0]
    }

    /// Learns from a coded block.
    pub(crate) fn learn(&mut self, levels: &[Level]) {
        for level in levels {
            self.seen_places[usize::from(level.place)] += 1.0;
            self.seen_magnitudes[(level.value.unsigned_abs() as usize).min(MAGNITUDES) - 1] += 1.0;
        }
        self.seen_counts[levels.len().min(COUNTS - 1)] += 1.0;
        self.blocks += 1;
        self.levels += levels.len();
        self.since_refresh += 1;
        if self.since_refresh == REFRESH {
            self.refresh();
        }
    }

    /// Gives the next frame's statistics more weight than this one's. What a frame says nothing of stays as it is: a scene may stand
    /// still for minutes.
    pub(crate) fn age(&mut self) {
        if self.levels > 0 {
            self.seen_places.iter_mut().for_each(|seen| *seen = *seen * DECAY + 0.01);
            self.seen_magnitudes.iter_mut().for_each(|seen| *seen *= DECAY);
        }
        if self.blocks > 0 {
            self.seen_counts.iter_mut().for_each(|seen| *seen *= DECAY);
        }
        (self.blocks, self.levels) = (0, 0);
        self.refresh();
    }

    fn refresh(&mut self) {
        self.since_refresh = 0;
        self.place =
            bits(&self.seen_places, 0.0).map(|bits| (bits - ORDER_BITS).max(LEAST_PLACE_BITS) + SIGN_BITS);
        self.magnitude = bits(&self.seen_magnitudes, 1e-3);
        self.count = bits(&self.seen_counts, 0.02);
        self.summarize();
    }

    /// Brings up to date what follows from the costs.
    fn summarize(&mut self) {
        let least = |bits: &[f32]| bits.iter().copied().fold(f32::INFINITY, f32::min);
        self.least_place = least(&self.place);
        self.least_magnitude = least(&self.magnitude);
        self.least_count = least(&self.count);
        for (position, bits) in self.scan.iter().zip(&self.place) {
            self.least_at[usize::from(*position)] = bits + self.least_magnitude;
        }
    }
}

/// Bits of each of some cases by how often they were seen. `floor`: what each counts more than that. Never below 0: a negative cost
/// would be earned by coding what is not there.
fn bits<const N: usize>(seen: &[f32; N], floor: f32) -> [f32; N] {
    let total: f32 = seen.iter().sum();
    seen.map(|seen| -((seen + floor) / total).log2().min(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_stay_what_they_are_while_nothing_is_coded() {
        let mut costs = LevelCosts::new(&std::array::from_fn::<u16, COEFFICIENTS, _>(|place| place as u16));
        for _ in 0..40 {
            costs.learn(&[Level { place: 3, value: -2 }]);
        }
        costs.age();
        let (place, magnitude, count) = (costs.place, costs.magnitude, costs.count);
        // Frames without a block, and frames whose blocks have no levels.
        (0..100).for_each(|_| costs.age());
        assert!(costs.place == place && costs.magnitude == magnitude && costs.count == count);
        for _ in 0..100 {
            costs.learn(&[]);
            costs.age();
        }
        assert!(costs.place == place && costs.magnitude == magnitude);
        assert!(costs.count.iter().all(|bits| *bits >= 0.0) && costs.count[0] < 1.0);
        assert!(costs.least_first() > 0.0, "{}", costs.least_first());
    }
}
