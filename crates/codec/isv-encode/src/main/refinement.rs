//! A pursuit that goes on where the greedy one ends: a set of levels that no change of one level improves is seldom the best.
//!
//! ```text
//! of several starts:  descent ─> descent under costs near its levels ─> each level given up, descent ─> cost in truth
//! ```
//!
//! Costs in truth are the models' own bits ([`ModelBits`]). Descents go by tables of what one more or one less level would cost
//! near the levels that they start from.

use super::level_costs::LevelCosts;
use super::model_bits::ModelBits;
use super::pursuit::{Metrics, Pursued, Pursuit, State};
use super::target::BlockTarget;
use fearless_simd::{Simd, dispatch};
use isv_decode::main::COEFFICIENTS;
use isv_kernels::simd;

/// Lambdas of first descents over the one that counts: too many levels, the usual, too few.
const STARTS: [f32; 3] = [1.0, 0.4, 2.5];
/// How often each level of a block is given up.
const SWEEPS: usize = 2;
/// With more levels than this none is given up: one of so many matters little, and trying each takes the square of their number.
const MOST_LEVELS: usize = 64;
/// A sweep that leaves more than this share of the cost is the last one.
const LEAST_IMPROVEMENT: f32 = 0.999;
/// Without a level, the cost has to fall below this share.
const BETTER: f32 = 0.9999;

/// Levels that no change of one improves, and what follows from them.
#[derive(Clone)]
struct Settled {
    state: State,
    metrics: Metrics,
    /// Weighted squared error plus lambda times bits, in truth.
    cost: f32,
}

impl Pursuit<'_> {
    /// Levels of a block from its prediction, in codes, as [`Pursuit::run`] has them and then better.
    pub(crate) fn run_refined(
        &self,
        target: &BlockTarget,
        metrics: &mut Metrics,
        prediction: &[i16; 512],
        bits: &mut ModelBits,
    ) -> Pursued {
        dispatch!(simd::level(), simd => self.run_refined_vectorized(simd, target, metrics, prediction, bits))
    }

    #[inline(always)]
    fn run_refined_vectorized<S: Simd>(
        &self,
        simd: S,
        target: &BlockTarget,
        metrics: &mut Metrics,
        prediction: &[i16; 512],
        bits: &mut ModelBits,
    ) -> Pursued {
        let state = State::new(simd, target, prediction);
        let predicted_error = state.weighted_error();
        let mut best = Pursued { levels: [0; COEFFICIENTS], cost: f32::INFINITY, predicted_error };
        for share in STARTS {
            metrics.begin();
            let start = Settled { state: state.clone(), metrics: metrics.clone(), cost: f32::INFINITY };
            let settled = self.refine_from(simd, start, share, target, bits);
            if settled.cost < best.cost {
                best = Pursued { levels: settled.state.levels, cost: settled.cost, predicted_error };
            }
        }
        best
    }

    /// The best that is found from a first descent with this share of lambda.
    #[inline(always)]
    fn refine_from<S: Simd>(
        &self,
        simd: S,
        mut start: Settled,
        share: f32,
        target: &BlockTarget,
        bits: &mut ModelBits,
    ) -> Settled {
        let costs = bits.costs_near(&start.state.levels);
        let eager = Pursuit { lambda: share * self.lambda, ..*self };
        eager.settle(simd, &mut start.state, &mut start.metrics, target, &costs);
        let mut best = self.settled(simd, start, target, &costs, bits);
        let costs = bits.costs_near(&best.state.levels);
        let again = self.settled(simd, best.clone(), target, &costs, bits);
        if again.cost < best.cost {
            best = again;
        }
        for _ in 0..SWEEPS {
            if best.state.count > MOST_LEVELS {
                break;
            }
            let before = best.cost;
            self.give_levels_up(simd, &mut best, target, bits);
            if best.cost > before * LEAST_IMPROVEMENT {
                break;
            }
        }
        best
    }

    /// Gives each level up, the highest frequency first, where the others do better without it.
    #[inline(always)]
    fn give_levels_up<S: Simd>(
        &self,
        simd: S,
        best: &mut Settled,
        target: &BlockTarget,
        bits: &mut ModelBits,
    ) {
        let mut costs = bits.costs_near(&best.state.levels);
        for k in (0..COEFFICIENTS).rev() {
            if best.state.levels[k] == 0 {
                continue;
            }
            let mut without = best.clone();
            self.drop_level(simd, &mut without.state, k);
            // What it did is first for the others to do, or it would be back at once.
            let position = usize::from(self.scan[k]);
            let metric = without.metrics.of(simd, self.dct, &without.state.weights).without(position);
            self.descend(simd, &mut without.state, &metric, &costs);
            let without = self.settled(simd, without, target, &costs, bits);
            if without.cost < best.cost * BETTER {
                *best = without;
                costs = bits.costs_near(&best.state.levels);
            }
        }
    }

    #[inline(always)]
    fn settled<S: Simd>(
        &self,
        simd: S,
        mut from: Settled,
        target: &BlockTarget,
        costs: &LevelCosts,
        bits: &mut ModelBits,
    ) -> Settled {
        self.settle(simd, &mut from.state, &mut from.metrics, target, costs);
        from.cost = from.state.true_error(target) + self.lambda * bits.of(&from.state.levels);
        from
    }
}
