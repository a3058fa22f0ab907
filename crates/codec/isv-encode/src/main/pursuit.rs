//! Levels by pursuit: from the prediction on, one level at a time is changed. Each change is the one that lowers weighted error
//! plus lambda times bits the most, until none does.
//!
//! Under weights that only the surface has, the basis functions are far from orthogonal. Many sets of levels then give the same
//! surface. Rounding the coefficients of a transform would send one of the long ones.
//!
//! Between changes only the slopes of the error are kept, as the inner products that a change needs are at hand
//! ([`WeightSpectrum`]).

use super::field_dct::FieldDct;
use super::lanes::{codes, load};
use super::level_costs::LevelCosts;
use super::target::{Bits, BlockTarget, Field, SCALE};
use super::weight_spectrum::{CODED_ROWS, WeightSpectrum};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*};
use isv_decode::main::COEFFICIENTS;
use isv_kernels::quant::Quantizer;
use isv_kernels::simd;

/// Changes of levels at most.
const CHANGES: usize = 400;
/// Largest magnitude that is considered.
const LARGEST: i32 = Quantizer::LARGEST_LEVEL;
/// A level that is zero is left alone if its ideal value is below this.
const LEAST: f32 = 0.35;
/// A change has to pay this much.
const LEAST_GAIN: f32 = 1e-6;
/// Basis functions of less weighted energy are left alone.
const LEAST_ENERGY: f32 = 1e-6;
/// Rounds in which voxels of the wrong sign are added to those that matter.
const SIGN_ROUNDS: usize = 5;
/// A voxel of which only the sign matters has to stay this far from zero (or its own distance), in voxels.
pub(super) const SIGN_MARGIN: f32 = 0.5;
/// Target distance (voxels), or its own if that is less, of a voxel that does not keep [`SIGN_MARGIN`].
const SIGN_TARGET: f32 = 1.5;
/// Weight of a voxel that does not keep [`SIGN_MARGIN`].
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
    /// One over it; zero where it is too little.
    inverses: Field,
    /// Whether it is that of the weights as they are.
    is_current: bool,
}

impl Metric {
    const NONE: Self = Self {
        spectrum: WeightSpectrum::NONE,
        energies: [0.0; 512],
        inverses: [0.0; 512],
        is_current: false,
    };

    /// Follows the weights, if it does not already. In place: it is large.
    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, dct: &FieldDct, weights: &Field) {
        if !self.is_current {
            self.spectrum.transform(simd, dct, weights, &mut self.energies);
            self.spectrum.energies(simd, &mut self.inverses, &mut self.energies);
            self.invert(simd);
            self.is_current = true;
        }
    }

    #[inline(always)]
    fn invert<S: Simd>(&mut self, simd: S) {
        for &row in &CODED_ROWS {
            let energies = load(simd, &self.energies, row);
            let there = energies.simd_ge(LEAST_ENERGY);
            let inverses = there.select(f32x8::splat(simd, 1.0) / energies, f32x8::splat(simd, 0.0));
            inverses.store_slice(&mut self.inverses[8 * row..8 * row + 8]);
        }
    }

    /// The metric under which a position is left alone.
    #[inline(always)]
    pub(super) fn without(&self, position: usize) -> Self {
        let mut metric = self.clone();
        metric.energies[position] = 0.0;
        metric.inverses[position] = 0.0;
        metric
    }
}

/// The metrics that the pursuits of a block need. One is that of the block's weights, which is the same for all predictions. The
/// other is that of the weights of a state whose signs were guarded.
#[derive(Clone, Debug)]
pub(crate) struct Metrics {
    block: Metric,
    guarded: Metric,
    is_guarded: bool,
}

impl Metrics {
    /// Metrics of no block.
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
    /// Levels of a block from its prediction, in codes. `metrics`: of the block.
    pub(crate) fn run(
        &self,
        target: &BlockTarget,
        metrics: &mut Metrics,
        prediction: &[i16; 512],
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
        prediction: &[i16; 512],
        costs: &LevelCosts,
    ) -> Pursued {
        metrics.begin();
        let mut state = State::new(simd, target, prediction);
        let predicted_error = state.weighted_error();
        if self.rounding {
            self.round(simd, &mut state);
        } else {
            self.settle(simd, &mut state, metrics, target, costs);
        }
        let mut bits = costs.count(state.count);
        if state.count > 0 {
            bits += state.places().map(|k| costs.level(k, state.levels[k])).sum::<f32>();
        }
        let cost = state.weighted_error() + self.lambda * bits;
        Pursued { levels: state.levels, cost, predicted_error }
    }

    /// The coefficients of the error, rounded.
    #[inline(always)]
    fn round<S: Simd>(&self, simd: S, state: &mut State) {
        let mut coefficients = [0.0; 512];
        self.dct.forward(
            simd,
            #[inline(always)]
            |row| load(simd, &state.error, row),
            &mut coefficients,
        );
        for (k, position) in self.scan.iter().enumerate() {
            let level = (coefficients[usize::from(*position)] / self.step).round() as i32;
            let level = level.clamp(-LARGEST, LARGEST);
            if level != 0 {
                state.set_level(k, level);
                self.dct.add(simd, usize::from(*position), -(level as f32) * self.step, &mut state.error);
            }
        }
    }

    /// Changes levels until no change pays and no sign is in danger: without a change none comes into danger.
    #[inline(always)]
    pub(super) fn settle<S: Simd>(
        &self,
        simd: S,
        state: &mut State,
        metrics: &mut Metrics,
        target: &BlockTarget,
        costs: &LevelCosts,
    ) {
        // A function by itself: there are many ways here, and it is long.
        simd.vectorize(
            #[inline(always)]
            || {
                for round in 0..SIGN_ROUNDS {
                    if state.guard_signs(simd, target) {
                        metrics.weights_have_changed();
                    } else if round > 0 {
                        break;
                    }
                    // Even a perfect level would pay no more than all of the error.
                    if state.count == 0 && state.weighted_error() <= self.lambda * costs.least_first() {
                        break;
                    }
                    let metric = metrics.of(simd, self.dct, &state.weights);
                    if !self.descend(simd, state, metric, costs) {
                        break;
                    }
                }
            },
        );
    }

    /// Changes levels until no change pays. Whether any was.
    #[inline(always)]
    pub(super) fn descend<S: Simd>(
        &self,
        simd: S,
        state: &mut State,
        metric: &Metric,
        costs: &LevelCosts,
    ) -> bool {
        let mut slopes = [0.0; 512];
        self.dct.forward(
            simd,
            #[inline(always)]
            |row| load(simd, &state.weights, row) * load(simd, &state.error, row),
            &mut slopes,
        );
        for change in 0..CHANGES {
            let Some((k, level)) = self.best_change(simd, state, metric, &slopes, costs) else {
                return change > 0;
            };
            let position = usize::from(self.scan[k]);
            let change = (level - state.levels[k]) as f32 * self.step;
            metric.spectrum.add_products(simd, position, -change, &mut slopes);
            self.dct.add(simd, position, -change, &mut state.error);
            state.set_level(k, level);
            if state.count >= COEFFICIENTS {
                break;
            }
        }
        true
    }

    /// Gives a level up.
    #[inline(always)]
    pub(super) fn drop_level<S: Simd>(&self, simd: S, state: &mut State, k: usize) {
        let change = state.levels[k] as f32 * self.step;
        self.dct.add(simd, usize::from(self.scan[k]), change, &mut state.error);
        state.set_level(k, 0);
    }

    /// The change of one level that pays the most.
    #[inline(always)]
    fn best_change<S: Simd>(
        &self,
        simd: S,
        state: &State,
        metric: &Metric,
        slopes: &Field,
        costs: &LevelCosts,
    ) -> Option<(usize, i32)> {
        let counts = [state.count.saturating_sub(1), state.count, state.count + 1].map(|n| costs.count(n));
        let outlook = Outlook { state, metric, slopes, costs, counts };
        let mut best = BestChange { gain: LEAST_GAIN, level: None };
        for k in state.places() {
            self.consider(k, &outlook, &mut best);
        }
        // Of levels that are zero most need no closer look: even the ideal change would pay less.
        let lambda = f32x8::splat(simd, self.lambda);
        let more = f32x8::splat(simd, self.lambda * (counts[2] - counts[1]));
        for &row in &CODED_ROWS {
            let (slopes, inverses) = (load(simd, slopes, row), load(simd, &metric.inverses, row));
            let most = slopes * slopes * inverses - lambda * load(simd, costs.least_at(), row) - more;
            let mut any = most.simd_gt(best.gain).to_bitmask();
            while any != 0 {
                let at = 8 * row + any.trailing_zeros() as usize;
                any &= any - 1;
                if let Some(k) = self.places[at] {
                    self.consider(usize::from(k), &outlook, &mut best);
                }
            }
        }
        best.level
    }

    /// Whether one of the levels next to the ideal one, or none, pays more than the best change so far.
    #[inline(always)]
    fn consider(&self, k: usize, outlook: &Outlook, best: &mut BestChange) {
        let Outlook { state, metric, slopes, costs, counts } = *outlook;
        let position = usize::from(self.scan[k]);
        let (energy, slope, now) = (metric.energies[position], slopes[position], state.levels[k]);
        let ideal = now as f32 + slope * metric.inverses[position] / self.step;
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
            if gain > best.gain {
                *best = BestChange { gain, level: Some((k, level)) };
            }
        }
    }
}

/// What the gain of a change follows from.
#[derive(Clone, Copy)]
struct Outlook<'a> {
    state: &'a State,
    metric: &'a Metric,
    slopes: &'a Field,
    costs: &'a LevelCosts,
    /// Bits of one level less than there are, of as many and of one more.
    counts: [f32; 3],
}

/// The best change so far: what it gains, and the level at a place in scan order.
struct BestChange {
    gain: f32,
    level: Option<(usize, i32)>,
}

/// Levels so far, what they are to reach, and the error that they leave.
#[derive(Clone)]
pub(super) struct State {
    pub levels: [i32; COEFFICIENTS],
    /// How many are not zero.
    pub(super) count: usize,
    /// A bit for each place that has a level.
    used: [u64; COEFFICIENTS.div_ceil(64)],
    goal: Field,
    pub weights: Field,
    error: Field,
    /// Voxels that were of the wrong sign once.
    guarded: Bits,
}

impl State {
    /// No levels.
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, target: &BlockTarget, prediction: &[i16; 512]) -> Self {
        let mut state = Self {
            levels: [0; COEFFICIENTS],
            count: 0,
            used: [0; COEFFICIENTS.div_ceil(64)],
            goal: target.samples,
            weights: target.weights,
            error: [0.0; 512],
            guarded: [0; 8],
        };
        for (row, prediction) in prediction.as_chunks::<8>().0.iter().enumerate() {
            let error = load(simd, &target.samples, row) - codes(simd, prediction) * SCALE;
            error.store_slice(&mut state.error[8 * row..8 * row + 8]);
        }
        state
    }

    /// The places that have levels, in scan order.
    #[inline(always)]
    fn places(&self) -> impl Iterator<Item = usize> {
        let mut used = self.used;
        let mut word = 0;
        std::iter::from_fn(
            #[inline(always)]
            move || {
                while word < used.len() && used[word] == 0 {
                    word += 1;
                }
                let bits = used.get_mut(word)?;
                let place = 64 * word + bits.trailing_zeros() as usize;
                *bits &= *bits - 1;
                Some(place)
            },
        )
    }

    /// Another level at a place.
    #[inline(always)]
    fn set_level(&mut self, k: usize, level: i32) {
        self.count = self.count + usize::from(level != 0) - usize::from(self.levels[k] != 0);
        self.levels[k] = level;
        let bit = 1 << (k % 64);
        self.used[k / 64] = if level != 0 { self.used[k / 64] | bit } else { self.used[k / 64] & !bit };
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

    /// Weighted squared error in truth. Voxels of which only the sign matters count as far ones if their sign is safe, whether they
    /// were in danger once or not.
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
    pub(super) fn guard_signs<S: Simd>(&mut self, simd: S, target: &BlockTarget) -> bool {
        let mut found = false;
        for row in 0..64 {
            let only_sign = target.only_sign[row / 8] & !self.guarded[row / 8];
            let mut wrong = self.in_danger(simd, target, row) & (only_sign >> (8 * (row % 8))) & 0xff;
            self.guarded[row / 8] |= wrong << (8 * (row % 8));
            found |= wrong != 0;
            while wrong != 0 {
                let voxel = 8 * row + wrong.trailing_zeros() as usize;
                wrong &= wrong - 1;
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

    /// The voxels of a row that are nearer to the other side than [`SIGN_MARGIN`] and than they should be: a bit each.
    #[inline(always)]
    fn in_danger<S: Simd>(&self, simd: S, target: &BlockTarget, row: usize) -> u64 {
        let sample = load(simd, &target.samples, row);
        let decoded = load(simd, &self.goal, row) - load(simd, &self.error, row);
        let right = sample.simd_lt(0.0).select(-decoded, decoded);
        right.simd_lt(sample.abs().min(SIGN_MARGIN)).to_bitmask()
    }
}
