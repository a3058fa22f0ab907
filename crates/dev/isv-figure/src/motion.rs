//! The dance: every joint a sum of a few sines.

use std::f64::consts::TAU;

/// Seconds after which the dance repeats.
pub const PERIOD_S: f64 = 5.0;

/// What the dance sets; `skeleton` solves the rest. Angles in radians, lengths in metres; x to her left, y up, z ahead.
/// Pairs are left, right.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    /// Middle of the hips.
    pub(crate) pelvis: [f32; 3],
    /// Turn of the hips about the vertical, and their tilt to the side.
    pub(crate) pelvis_turn: f32,
    pub(crate) pelvis_tilt: f32,
    /// Turn, sideways lean and forward bend of the chest relative to the hips.
    pub(crate) chest_turn: f32,
    pub(crate) chest_lean: f32,
    pub(crate) chest_bend: f32,
    /// Turn, tilt and nod of the head relative to the chest.
    pub(crate) head_turn: f32,
    pub(crate) head_tilt: f32,
    pub(crate) head_nod: f32,
    /// Direction from shoulder to wrist: angle above the horizon, angle forwards from the side.
    pub(crate) arm_rise: [f32; 2],
    pub(crate) arm_forward: [f32; 2],
    /// Bend of wrist and fingers.
    pub(crate) hand_curl: [f32; 2],
    /// Height of the heel, as an angle of the foot on its ball.
    pub(crate) heel_lift: [f32; 2],
}

impl Pose {
    pub(crate) fn at(time_s: f64) -> Self {
        let phase = TAU * (time_s / PERIOD_S).rem_euclid(1.0);
        // A sine with `per_period` swings, delayed by a part of the period.
        let wave = |per_period: f64, delay: f64| (per_period * (phase - TAU * delay)).sin() as f32;
        // 0 to 1 and back.
        let swell = |delay: f64| 0.5 + 0.5 * wave(1.0, delay);
        let (left, right) = (0.0, 0.5);
        Self {
            pelvis: [0.045 * wave(1.0, 0.0), 0.925 + 0.01 * wave(2.0, 0.1), 0.015 * wave(2.0, 0.0)],
            pelvis_turn: 0.28 * wave(1.0, 0.4),
            pelvis_tilt: 0.07 * wave(1.0, 0.0),
            chest_turn: 0.42 * wave(1.0, 0.9) + 0.05 * wave(2.0, 0.2),
            chest_lean: -0.13 * wave(1.0, 0.06),
            chest_bend: 0.02 + 0.05 * wave(2.0, 0.15),
            head_turn: 0.3 * wave(1.0, 0.12),
            head_tilt: 0.1 * wave(1.0, 0.55) + 0.03 * wave(2.0, 0.3),
            head_nod: -0.06 + 0.06 * wave(2.0, 0.4),
            arm_rise: [left, right].map(|side| -0.5 + 1.55 * swell(side + 0.05)),
            arm_forward: [left, right]
                .map(|side| 0.55 + 0.3 * wave(1.0, side + 0.25) + 0.1 * wave(2.0, side)),
            hand_curl: [left, right].map(|side| 0.3 + 0.16 * wave(1.0, side + 0.2)),
            heel_lift: [left, right].map(|side| 0.5 * swell(side + 0.5).powi(2)),
        }
    }
}
