//! Levels by pursuit: from the prediction on, one level at a time is changed, the one that lowers weighted error plus lambda
//! times bits the most, until none does.
//!
//! Under weights that only the surface has, the basis functions are far from orthogonal and many sets of levels give the same
//! surface; rounding the coefficients of a transform would send one of the long ones.

use super::field_dct::FieldDct;
use super::level_costs::LevelCosts;
use super::target::{BlockTarget, Field};
use isv_decode::main_profile::COEFFICIENTS;
use isv_kernels::simd::vectorized;

/// Changes of levels at most, and levels at most.
const CHANGES: usize = 80;
const LEVELS: usize = 60;
/// Largest magnitude that is considered.
const LARGEST: i32 = 255;
/// Levels that rounding would leave at zero by more than this are not considered.
const LEAST: f32 = 0.35;
/// Rounds in which voxels of the wrong sign are added to those that matter.
const SIGN_ROUNDS: usize = 5;
/// A voxel of which only the sign matters has to stay this far from zero (or its own distance), in voxels.
const SIGN_MARGIN: f32 = 0.5;
/// Where it does not, this distance (or its own) becomes its target, with this weight.
const SIGN_TARGET: f32 = 1.5;
const SIGN_WEIGHT: f32 = 0.3;

/// What a pursuit works with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pursuit<'a> {
    pub dct: &'a FieldDct,
    pub scan: &'a [u16],
    /// Quantizer step in voxels of the orthonormal transform.
    pub step: f32,
    /// Weighted squared voxels that a bit is worth.
    pub lambda: f32,
}

/// Levels of a block and what they cost.
#[derive(Clone, Debug)]
pub(crate) struct Pursued {
    pub levels: [i32; COEFFICIENTS],
    /// Weighted squared error plus lambda times bits.
    pub cost: f32,
}

impl Pursuit<'_> {
    /// Levels of a block from its prediction, in voxels.
    pub(crate) fn run(&self, target: &BlockTarget, prediction: &Field, costs: &LevelCosts) -> Pursued {
        vectorized(
            #[inline(always)]
            || self.run_vectorized(target, prediction, costs),
        )
    }

    #[inline(always)]
    fn run_vectorized(&self, target: &BlockTarget, prediction: &Field, costs: &LevelCosts) -> Pursued {
        let mut state = State { levels: [0; COEFFICIENTS], count: 0, error: [0.0; 512] };
        let (mut goal, mut weights) = (target.samples, target.weights);
        for voxel in 0..512 {
            state.error[voxel] = goal[voxel] - prediction[voxel];
        }
        let mut guarded = [false; 512];
        for round in 0..SIGN_ROUNDS {
            let mut found = false;
            for voxel in 0..512 {
                if guarded[voxel] || !target.only_sign.contains(voxel) {
                    continue;
                }
                let sample = target.samples[voxel];
                let sign = if sample < 0.0 { -1.0 } else { 1.0 };
                let decoded = goal[voxel] - state.error[voxel];
                if sign * decoded < sample.abs().min(SIGN_MARGIN) {
                    (guarded[voxel], found) = (true, true);
                    goal[voxel] = sign * sample.abs().min(SIGN_TARGET);
                    state.error[voxel] = goal[voxel] - decoded;
                    weights[voxel] = SIGN_WEIGHT;
                }
            }
            if round > 0 && !found {
                break;
            }
            self.descend(&mut state, &weights, costs);
        }
        let error: f32 = (0..512).map(|v| weights[v] * state.error[v] * state.error[v]).sum();
        let levels = (0..COEFFICIENTS).map(|k| costs.level(k, state.levels[k])).sum::<f32>();
        let cost = error + self.lambda * (levels + costs.count(state.count));
        Pursued { levels: state.levels, cost }
    }

    /// Changes levels until no change pays.
    #[inline(always)]
    fn descend(&self, state: &mut State, weights: &Field, costs: &LevelCosts) {
        let mut energies = [0.0; 512];
        self.dct.energies(weights, &mut energies);
        for _ in 0..CHANGES {
            let (mut weighted, mut gradient) = ([0.0; 512], [0.0; 512]);
            for voxel in 0..512 {
                weighted[voxel] = weights[voxel] * state.error[voxel];
            }
            self.dct.forward(&weighted, &mut gradient);
            let Some((k, level)) = self.best_change(state, &energies, &gradient, costs) else { break };
            let change = (level - state.levels[k]) as f32 * self.step;
            self.dct.add(usize::from(self.scan[k]), -change, &mut state.error);
            state.count = state.count + usize::from(level != 0) - usize::from(state.levels[k] != 0);
            state.levels[k] = level;
            if state.count >= LEVELS {
                break;
            }
        }
    }

    /// The change of one level that pays the most.
    #[inline(always)]
    fn best_change(
        &self,
        state: &State,
        energies: &Field,
        gradient: &Field,
        costs: &LevelCosts,
    ) -> Option<(usize, i32)> {
        let mut best = (-1e-6, None);
        let counts = [state.count.saturating_sub(1), state.count, state.count + 1].map(|n| costs.count(n));
        for k in 0..COEFFICIENTS {
            let position = usize::from(self.scan[k]);
            let (energy, slope) = (energies[position], gradient[position]);
            if energy < 1e-6 {
                continue;
            }
            let now = state.levels[k];
            let ideal = now as f32 + slope / (energy * self.step);
            if now == 0 && ideal.abs() < LEAST {
                continue;
            }
            let below = ideal.floor() as i32;
            for level in [below, below + 1, 0] {
                if level == now || level.abs() > LARGEST {
                    continue;
                }
                let change = (level - now) as f32 * self.step;
                let more = 1 + usize::from(level != 0) - usize::from(now != 0);
                let bits = costs.level(k, level) - costs.level(k, now) + counts[more] - counts[1];
                let gain = change * (change * energy - 2.0 * slope) + self.lambda * bits;
                if gain < best.0 {
                    best = (gain, Some((k, level)));
                }
            }
        }
        best.1
    }
}

/// Levels so far and the error that they leave.
struct State {
    levels: [i32; COEFFICIENTS],
    count: usize,
    error: Field,
}
