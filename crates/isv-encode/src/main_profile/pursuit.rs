//! Levels by pursuit: from the prediction on, one level at a time is changed, the one that lowers weighted error plus lambda
//! times bits the most, until none does.
//!
//! Under weights that only the surface has, the basis functions are far from orthogonal and many sets of levels give the same
//! surface; rounding the coefficients of a transform would send one of the long ones.
//!
//! Between changes only the slopes of the error are kept, as the inner products that a change needs are at hand
//! ([`WeightSpectrum`]).

use super::field_dct::FieldDct;
use super::level_costs::LevelCosts;
use super::target::{BlockTarget, Field};
use super::weight_spectrum::{CODED_ROWS, WeightSpectrum};
use fearless_simd::{Simd, dispatch};
use isv_decode::main_profile::COEFFICIENTS;
use isv_kernels::simd;

/// Changes of levels at most, and levels at most.
const CHANGES: usize = 400;
const LEVELS: usize = 162;
/// Largest magnitude that is considered.
const LARGEST: i32 = 1 << 15;
/// Levels that rounding would leave at zero by more than this are not considered.
const LEAST: f32 = 0.35;
/// A change has to pay this much.
const LEAST_GAIN: f32 = 1e-6;
/// Basis functions of less weighted energy are left alone.
const LEAST_ENERGY: f32 = 1e-6;
/// Rounds in which voxels of the wrong sign are added to those that matter.
const SIGN_ROUNDS: usize = 5;
/// A voxel of which only the sign matters has to stay this far from zero (or its own distance), in voxels.
pub(super) const SIGN_MARGIN: f32 = 0.5;
/// Where it does not, this distance (or its own) becomes its target, with this weight.
const SIGN_TARGET: f32 = 1.5;
const SIGN_WEIGHT: f32 = 0.3;

/// What a pursuit works with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pursuit<'a> {
    pub dct: &'a FieldDct,
    pub scan: &'a [u16],
    /// Place in scan order of each position, if it is coded.
    pub places: &'a [Option<u8>; 512],
    /// Quantizer step in voxels of the orthonormal transform.
    pub step: f32,
    /// Weighted squared voxels that a bit is worth.
    pub lambda: f32,
    /// Whether coefficients are rounded instead, whatever they cost.
    pub rounding: bool,
}

/// Levels of a block and what they cost.
#[derive(Clone, Debug)]
pub(crate) struct Pursued {
    pub levels: [i32; COEFFICIENTS],
    /// Weighted squared error plus lambda times bits.
    pub cost: f32,
    /// Weighted squared error of the prediction.
    pub predicted_error: f32,
}

/// What follows from weights.
#[derive(Clone, Debug)]
pub(super) struct Metric {
    spectrum: WeightSpectrum,
    /// Weighted energy of each basis function.
    energies: Field,
    /// Whether it is that of the weights as they are.
    is_current: bool,
}

impl Metric {
    const NONE: Self = Self { spectrum: WeightSpectrum::NONE, energies: [0.0; 512], is_current: false };

    /// Follows the weights, if it does not already. In place: it is large.
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, dct: &FieldDct, weights: &Field) {
        if !self.is_current {
            self.spectrum.transform(simd, dct, weights);
            self.spectrum.energies(&mut self.energies);
            self.is_current = true;
        }
    }

    /// The metric under which a position is left alone.
    #[inline(always)]
    pub(super) fn without(&self, position: usize) -> Self {
        let mut metric = self.clone();
        metric.energies[position] = 0.0;
        metric
    }
}

/// The metrics that the pursuits of a block need: that of its weights, which is the same for all predictions, and that of the
/// weights of a state whose signs were guarded.
#[derive(Clone, Debug)]
pub(crate) struct Metrics {
    block: Metric,
    guarded: Metric,
    is_guarded: bool,
}

impl Metrics {
    /// Of no block.
    pub(crate) const NONE: Self = Self { block: Metric::NONE, guarded: Metric::NONE, is_guarded: false };

    /// There is another block now.
    pub(crate) fn forget(&mut self) {
        self.block.is_current = false;
        self.begin();
    }

    /// There is another state now, whose weights are the block's.
    pub(super) fn begin(&mut self) {
        self.is_guarded = false;
    }

    /// The state has other weights now.
    #[inline(always)]
    fn weights_have_changed(&mut self) {
        self.is_guarded = true;
        self.guarded.is_current = false;
    }

    /// The metric of a state's weights.
    #[inline(always)]
    pub(super) fn of<S: Simd>(&mut self, simd: S, dct: &FieldDct, weights: &Field) -> &Metric {
        let metric = if self.is_guarded { &mut self.guarded } else { &mut self.block };
        metric.follow(simd, dct, weights);
        metric
    }
}

impl Pursuit<'_> {
    /// Levels of a block from its prediction, in voxels. `metrics`: of the block.
    pub(crate) fn run(
        &self,
        target: &BlockTarget,
        metrics: &mut Metrics,
        prediction: &Field,
        costs: &LevelCosts,
    ) -> Pursued {
        dispatch!(simd::level(), simd => self.run_vectorized(simd, target, metrics, prediction, costs))
    }

    /// [`Self::run`] where the signs of the prediction hold and no level can pay, by its weighted error.
    pub(crate) fn without_levels(&self, predicted_error: f32, costs: &LevelCosts) -> Option<Pursued> {
        (predicted_error <= self.lambda * costs.least_first()).then(|| Pursued {
            levels: [0; COEFFICIENTS],
            cost: predicted_error + self.lambda * costs.count(0),
            predicted_error,
        })
    }

    #[inline(always)]
    fn run_vectorized<S: Simd>(
        &self,
        simd: S,
        target: &BlockTarget,
        metrics: &mut Metrics,
        prediction: &Field,
        costs: &LevelCosts,
    ) -> Pursued {
        metrics.begin();
        let mut state = State::new(target, prediction);
        let predicted_error = state.weighted_error();
        if self.rounding {
            self.round(simd, &mut state);
        } else {
            self.settle(simd, &mut state, metrics, target, costs);
        }
        let mut bits = costs.count(state.count);
        if state.count > 0 {
            bits += (0..COEFFICIENTS).map(|k| costs.level(k, state.levels[k])).sum::<f32>();
        }
        let cost = state.weighted_error() + self.lambda * bits;
        Pursued { levels: state.levels, cost, predicted_error }
    }

    /// The coefficients of the error, rounded.
    #[inline(always)]
    fn round<S: Simd>(&self, simd: S, state: &mut State) {
        let mut coefficients = [0.0; 512];
        self.dct.forward(simd, &state.error.clone(), &mut coefficients);
        for (k, position) in self.scan.iter().enumerate() {
            let level = (coefficients[usize::from(*position)] / self.step).round() as i32;
            if level != 0 {
                state.levels[k] = level;
                state.count += 1;
                self.dct.add(usize::from(*position), -(level as f32) * self.step, &mut state.error);
            }
        }
    }

    /// Changes levels until no change pays and no sign is in danger.
    #[inline(always)]
    pub(super) fn settle<S: Simd>(
        &self,
        simd: S,
        state: &mut State,
        metrics: &mut Metrics,
        target: &BlockTarget,
        costs: &LevelCosts,
    ) {
        for round in 0..SIGN_ROUNDS {
            if state.guard_signs(target) {
                metrics.weights_have_changed();
            } else if round > 0 {
                break;
            }
            // Even a perfect level would pay no more than all of the error.
            if state.count > 0 || state.weighted_error() > self.lambda * costs.least_first() {
                let metric = metrics.of(simd, self.dct, &state.weights);
                self.descend(simd, state, metric, costs);
            }
        }
    }

    /// Changes levels until no change pays.
    #[inline(always)]
    pub(super) fn descend<S: Simd>(&self, simd: S, state: &mut State, metric: &Metric, costs: &LevelCosts) {
        let (mut weighted, mut slopes) = ([0.0; 512], [0.0; 512]);
        for voxel in 0..512 {
            weighted[voxel] = state.weights[voxel] * state.error[voxel];
        }
        self.dct.forward(simd, &weighted, &mut slopes);
        let mut first = self.first_costs(state, metric, costs);
        for _ in 0..CHANGES {
            let Some((k, level)) = self.best_change(state, metric, &first, &slopes, costs) else { break };
            let position = usize::from(self.scan[k]);
            let change = (level - state.levels[k]) as f32 * self.step;
            metric.spectrum.add_products(position, -change, &mut slopes);
            self.dct.add(position, -change, &mut state.error);
            state.count = state.count + usize::from(level != 0) - usize::from(state.levels[k] != 0);
            state.levels[k] = level;
            first.least[position] =
                if level == 0 { self.lambda * (costs.place(k) + first.magnitude) } else { f32::INFINITY };
            if state.count >= LEVELS {
                break;
            }
        }
    }

    /// Gives a level up.
    #[inline(always)]
    pub(super) fn drop_level(&self, state: &mut State, k: usize) {
        let change = state.levels[k] as f32 * self.step;
        self.dct.add(usize::from(self.scan[k]), change, &mut state.error);
        state.count -= 1;
        state.levels[k] = 0;
    }

    /// What the first level at a position costs at least, whatever it is.
    #[inline(always)]
    fn first_costs(&self, state: &State, metric: &Metric, costs: &LevelCosts) -> FirstCosts {
        let magnitude = costs.least_magnitude;
        let mut first = FirstCosts { magnitude, least: [f32::INFINITY; 512], inverses: [0.0; 512] };
        for row in CODED_ROWS {
            for position in 8 * row..8 * row + 8 {
                let energy = metric.energies[position];
                let there = energy >= LEAST_ENERGY;
                first.inverses[position] = if there { 1.0 / energy } else { 0.0 };
                let least = self.lambda * (costs.place_at()[position] + magnitude);
                first.least[position] = if there { least } else { f32::INFINITY };
            }
        }
        if state.count > 0 {
            for k in (0..COEFFICIENTS).filter(|k| state.levels[*k] != 0) {
                first.least[usize::from(self.scan[k])] = f32::INFINITY;
            }
        }
        first
    }

    /// The change of one level that pays the most.
    #[inline(always)]
    fn best_change(
        &self,
        state: &State,
        metric: &Metric,
        first: &FirstCosts,
        slopes: &Field,
        costs: &LevelCosts,
    ) -> Option<(usize, i32)> {
        let counts = [state.count.saturating_sub(1), state.count, state.count + 1].map(|n| costs.count(n));
        let mut best = (LEAST_GAIN, None);
        let consider = |k: usize, best: &mut (f32, Option<(usize, i32)>)| {
            let position = usize::from(self.scan[k]);
            let (energy, slope, now) = (metric.energies[position], slopes[position], state.levels[k]);
            let ideal = now as f32 + slope * first.inverses[position] / self.step;
            if energy < LEAST_ENERGY || (now == 0 && ideal.abs() < LEAST) {
                return;
            }
            let below = ideal.floor() as i32;
            for level in [below, below + 1, 0] {
                if level == now || level.abs() > LARGEST {
                    continue;
                }
                let change = (level - now) as f32 * self.step;
                let more = 1 + usize::from(level != 0) - usize::from(now != 0);
                let bits = costs.level(k, level) - costs.level(k, now) + counts[more] - counts[1];
                let gain = change * (2.0 * slope - change * energy) - self.lambda * bits;
                if gain > best.0 {
                    *best = (gain, Some((k, level)));
                }
            }
        };
        if state.count > 0 {
            (0..COEFFICIENTS).filter(|k| state.levels[*k] != 0).for_each(|k| consider(k, &mut best));
        }
        // Of levels that are zero most need no closer look: even the ideal change would pay less.
        let more = self.lambda * (counts[2] - counts[1]);
        let mut most = [0.0; 8 * CODED_ROWS.len()];
        for (row, most) in CODED_ROWS.into_iter().zip(most.as_chunks_mut::<8>().0) {
            for lane in 0..8 {
                let at = 8 * row + lane;
                most[lane] = slopes[at] * slopes[at] * first.inverses[at] - first.least[at] - more;
            }
        }
        for (row, most) in CODED_ROWS.into_iter().zip(most.as_chunks::<8>().0) {
            let mut any = 0;
            for lane in 0..8 {
                any |= u32::from(most[lane] > best.0) << lane;
            }
            while any != 0 {
                let at = 8 * row + any.trailing_zeros() as usize;
                any &= any - 1;
                if let Some(k) = self.places[at] {
                    consider(usize::from(k), &mut best);
                }
            }
        }
        best.1
    }
}

/// What is known of the first level at each position.
struct FirstCosts {
    /// Bits of a magnitude at least.
    magnitude: f32,
    /// Lambda times the bits that it takes at least; infinite where there is a level already or can be none.
    least: Field,
    /// One over the energy of the basis function; zero if that is too little.
    inverses: Field,
}

/// Levels so far, what they are to reach, and the error that they leave.
#[derive(Clone)]
pub(super) struct State {
    pub levels: [i32; COEFFICIENTS],
    count: usize,
    goal: Field,
    pub weights: Field,
    error: Field,
    /// Voxels that were of the wrong sign once.
    guarded: [bool; 512],
}

impl State {
    /// No levels.
    #[inline(always)]
    pub(super) fn new(target: &BlockTarget, prediction: &Field) -> Self {
        let mut state = Self {
            levels: [0; COEFFICIENTS],
            count: 0,
            goal: target.samples,
            weights: target.weights,
            error: [0.0; 512],
            guarded: [false; 512],
        };
        for voxel in 0..512 {
            state.error[voxel] = state.goal[voxel] - prediction[voxel];
        }
        state
    }

    /// Weighted squared error.
    #[inline(always)]
    pub(super) fn weighted_error(&self) -> f32 {
        let mut squares = [0.0; 8];
        for (error, weights) in self.error.as_chunks::<8>().0.iter().zip(self.weights.as_chunks::<8>().0) {
            for lane in 0..8 {
                squares[lane] += weights[lane] * error[lane] * error[lane];
            }
        }
        squares.iter().sum()
    }

    /// Weighted squared error in truth: of voxels of which only the sign matters, those whose sign is safe count as far ones
    /// whether they were in danger once or not.
    #[inline(always)]
    pub(super) fn true_error(&self, target: &BlockTarget) -> f32 {
        let mut sums = [0.0; 8];
        for row in 0..64 {
            let only_sign = (target.only_sign[row / 8] >> (8 * (row % 8))) as u32;
            for lane in 0..8 {
                let voxel = 8 * row + lane;
                let sample = target.samples[voxel];
                let decoded = self.goal[voxel] - self.error[voxel];
                let error = sample - decoded;
                let (right, distance) = if sample < 0.0 { (-decoded, -sample) } else { (decoded, sample) };
                let missing = distance.min(SIGN_TARGET) - right;
                let in_danger = (only_sign >> lane & 1 != 0) & (right < distance) & (right < SIGN_MARGIN);
                let danger = if in_danger { SIGN_WEIGHT * missing * missing } else { 0.0 };
                sums[lane] += target.weights[voxel] * error * error + danger;
            }
        }
        sums.iter().sum()
    }

    /// Gives weight to the voxels of which only the sign matters and whose sign is wrong. Whether there are new ones.
    #[inline(always)]
    pub(super) fn guard_signs(&mut self, target: &BlockTarget) -> bool {
        let mut found = false;
        for row in 0..64 {
            let at = 8 * row;
            let mut wrong = 0u32;
            for lane in 0..8 {
                let sample = target.samples[at + lane];
                let decoded = self.goal[at + lane] - self.error[at + lane];
                let right = if sample < 0.0 { -decoded } else { decoded };
                let distance = if sample < 0.0 { -sample } else { sample };
                wrong |= u32::from((right < distance) & (right < SIGN_MARGIN)) << lane;
            }
            wrong &= (target.only_sign[row / 8] >> (8 * (row % 8))) as u32 & 255;
            while wrong != 0 {
                let voxel = at + wrong.trailing_zeros() as usize;
                wrong &= wrong - 1;
                if self.guarded[voxel] {
                    continue;
                }
                (self.guarded[voxel], found) = (true, true);
                let sample = target.samples[voxel];
                let decoded = self.goal[voxel] - self.error[voxel];
                let distance = sample.abs().min(SIGN_TARGET);
                self.goal[voxel] = if sample < 0.0 { -distance } else { distance };
                self.error[voxel] = self.goal[voxel] - decoded;
                self.weights[voxel] = SIGN_WEIGHT;
            }
        }
        found
    }
}
