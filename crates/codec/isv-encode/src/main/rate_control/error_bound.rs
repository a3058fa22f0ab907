//! Steps that keep every frame within an error.

use super::{Attempt, COARSEST_STEP, FINEST_STEP, FrameFacts};

/// Surface error grows about with this power of the step.
const EXPONENT: f64 = 0.7;
/// Share of the bound that is aimed at: errors of like frames scatter by a few percent.
const AIM: f64 = 0.95;
/// Error at a step of one voxel, in voxels, before anything is known: keyframes, other frames.
const ERROR_AT_ONE: [f64; 2] = [0.06, 0.07];
/// How much a step may differ from that of the frame of the same kind before.
const LARGEST_CHANGE: f64 = 1.4;
/// Limits of the power that two attempts at a frame tell.
const EXPONENTS: [f64; 2] = [0.2, 1.5];
/// Attempts by the model; the one after them takes the finest step.
const TRIES: usize = 8;
/// An attempt that failed makes the next one finer by at least the one factor, and at most the other.
const LEAST_REFINEMENT: f64 = 0.93;
const MOST_REFINEMENT: f64 = 0.5;

/// Aims at an error by the errors of the frames before.
#[derive(Clone, Debug)]
pub(crate) struct ErrorControl {
    /// In voxels.
    bound: f64,
    /// For keyframes and for other frames.
    steps: [f64; 2],
}

impl ErrorControl {
    pub(super) fn new(bound: f64) -> Self {
        let step =
            |at_one: f64| (AIM * bound / at_one).powf(1.0 / EXPONENT).clamp(FINEST_STEP, COARSEST_STEP);
        Self { bound, steps: ERROR_AT_ONE.map(step) }
    }

    pub(super) fn first_step(&self, frame: FrameFacts) -> f64 {
        self.steps[usize::from(!frame.keyframe)]
    }

    pub(super) fn retry(&self, attempts: &[Attempt]) -> Option<f64> {
        let (attempt, before) = attempts.split_last()?;
        if attempt.surface_distance <= self.bound || attempt.step <= FINEST_STEP {
            return None;
        }
        if attempts.len() >= TRIES {
            return Some(FINEST_STEP);
        }
        let exponent = before.last().map_or(EXPONENT, |before| exponent_between(before, attempt));
        let correction = self.correction(attempt, exponent).clamp(MOST_REFINEMENT, LEAST_REFINEMENT);
        Some((attempt.step * correction).max(FINEST_STEP))
    }

    pub(super) fn learn(&mut self, attempt: &Attempt) {
        let change = self.correction(attempt, EXPONENT).clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE);
        let step = &mut self.steps[usize::from(!attempt.frame.keyframe)];
        *step = (attempt.step * change).clamp(FINEST_STEP, COARSEST_STEP);
    }

    /// What the step is to be multiplied by, if the error grows with this power of it.
    fn correction(&self, attempt: &Attempt, exponent: f64) -> f64 {
        let error = attempt.surface_distance.max(1e-6);
        (AIM * self.bound / error).powf(1.0 / exponent)
    }
}

/// The power of the step that the errors of two attempts at a frame grow with. Where little is left that a finer step mends it is
/// near 0, and the model's is far too large.
fn exponent_between(one: &Attempt, other: &Attempt) -> f64 {
    let [error, step] = [one.surface_distance / other.surface_distance.max(1e-6), one.step / other.step];
    (error.ln() / step.ln()).clamp(EXPONENTS[0], EXPONENTS[1])
}
