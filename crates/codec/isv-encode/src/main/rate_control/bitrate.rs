//! Steps that meet a rate in one pass, through a leaky bucket.
//!
//! Bits of a frame are taken as `blocks x a x step^-b`, `a` learnt from the frames before of its kind. The step is the one at which
//! keyframes and the frames between them together have the wanted mean, corrected by what was spent too much or too little.

use super::{Attempt, COARSEST_STEP, FINEST_STEP, FrameFacts};

/// The power of the step that bits fall with: keyframes, other frames.
const EXPONENTS: [f64; 2] = [0.85, 0.9];
/// Bits of a block at a step of one voxel before anything is known.
const BITS_AT_ONE: [f64; 2] = [60.0, 24.0];
/// How fast `a` is learnt: weight of the last frame of a kind.
const LEARNING: [f64; 2] = [0.7, 0.3];
/// Seconds over which what was spent too much is saved.
const CORRECTION_S: f64 = 1.0;
/// Limits of the wanted mean after correction, as shares of the rate.
const MEAN_LIMITS: [f64; 2] = [0.4, 2.0];
/// How much the step of a frame may differ from that of the frame before; of keyframes, more.
const LARGEST_CHANGE: f64 = 1.12;
const LARGEST_CHANGE_AT_KEYFRAMES: f64 = 1.5;
/// Share of the room in the bucket that is aimed at when a frame would overrun it.
const AIM: f64 = 0.9;
/// A frame of a kind that nothing is known of is coded anew if its bits are farther than this factor from what was expected.
const SURPRISE: f64 = 1.25;
const SURPRISES: usize = 2;

/// A rate and the buffer that it is kept through.
///
/// The buffer is a bucket that leaks at the rate: of any run of frames, the bits are at most the run's time times the rate, and the buffer's
/// size. A frame that would overrun it is coded anew, coarser; it overruns only if the coarsest step does not help.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bitrate {
    /// Bits a second, every byte of the stream counted.
    pub bits_per_second: f64,
    /// Frames a second.
    pub frames_per_second: f64,
    /// Size of the buffer, in seconds at the rate.
    pub buffer_s: f64,
}

impl Bitrate {
    /// A rate through a buffer of one second.
    #[must_use]
    pub fn new(bits_per_second: f64, frames_per_second: f64) -> Self {
        Self { bits_per_second, frames_per_second, buffer_s: 1.0 }
    }

    /// Bits that leak out while a frame is shown.
    fn frame_bits(&self) -> f64 {
        self.bits_per_second / self.frames_per_second
    }

    fn capacity(&self) -> f64 {
        self.bits_per_second * self.buffer_s
    }
}

/// Keeps to a rate.
#[derive(Clone, Debug)]
pub(crate) struct BitrateControl {
    target: Bitrate,
    /// Frames from a keyframe to the next, as far as is known.
    gop: f64,
    /// Frames since the last keyframe.
    since_keyframe: u32,
    /// Bits in the bucket.
    level: f64,
    /// Bits spent beyond the rate so far, negative if too few.
    balance: f64,
    /// `a` of keyframes and of other frames.
    bits_at_one: [f64; 2],
    /// Whether `a` of each kind was learnt.
    known: [bool; 2],
    last_step: Option<f64>,
}

impl BitrateControl {
    pub(super) fn new(target: Bitrate, gop: u32) -> Self {
        Self {
            target,
            gop: f64::from(gop),
            since_keyframe: 0,
            level: 0.0,
            balance: 0.0,
            bits_at_one: BITS_AT_ONE,
            known: [false; 2],
            last_step: None,
        }
    }

    pub(super) fn first_step(&self, frame: FrameFacts) -> f64 {
        let wanted = self.wanted_mean(frame);
        let mut step = self.solve(|step| self.mean_bits(frame.blocks, step), wanted);
        if let Some(last) = self.last_step {
            let change = if frame.keyframe { LARGEST_CHANGE_AT_KEYFRAMES } else { LARGEST_CHANGE };
            step = step.clamp(last / change, last * change);
        }
        let room = AIM * (self.target.capacity() - self.level);
        let fits = self.solve(|step| self.bits(frame, step), room);
        step.max(fits).clamp(FINEST_STEP, COARSEST_STEP)
    }

    pub(super) fn retry(&self, attempts: &[Attempt]) -> Option<f64> {
        let (attempt, before) = attempts.split_last()?;
        let Attempt { frame, step, bits, .. } = *attempt;
        let kind = usize::from(!frame.keyframe);
        let room = self.target.capacity() - self.level;
        let finer_by =
            |factor: f64| (step * factor.powf(1.0 / EXPONENTS[kind])).clamp(FINEST_STEP, COARSEST_STEP);
        if bits > room && step < COARSEST_STEP {
            let coarser = finer_by(bits / (AIM * room).max(1.0)).max(1.1 * step);
            return Some(coarser.min(COARSEST_STEP));
        }
        if self.known[kind] || before.len() >= SURPRISES {
            return None;
        }
        // Now that a frame of the kind is known, the model has another step for it.
        let expected = self.bits(frame, step);
        let surprising = !(expected / SURPRISE..=expected * SURPRISE).contains(&bits);
        let mut wiser = self.clone();
        wiser.learn_bits(attempt);
        let better = wiser.first_step(frame);
        (surprising && bits <= room && (better / step).ln().abs() > 0.1).then_some(better)
    }

    pub(super) fn learn(&mut self, attempt: &Attempt) {
        self.learn_bits(attempt);
        self.since_keyframe = if attempt.frame.keyframe { 1 } else { self.since_keyframe + 1 };
        let spent = attempt.bits - self.target.frame_bits();
        self.level = (self.level + spent).max(0.0);
        // What a simple scene saves is not all for later.
        self.balance = (self.balance + spent).max(-self.target.capacity());
        self.last_step = Some(attempt.step);
    }

    fn learn_bits(&mut self, attempt: &Attempt) {
        let kind = usize::from(!attempt.frame.keyframe);
        let measured =
            attempt.bits / (attempt.frame.blocks.max(1) as f64 * attempt.step.powf(-EXPONENTS[kind]));
        let weight = if self.known[kind] { LEARNING[kind] } else { 1.0 };
        let learnt = self.bits_at_one[kind].ln() * (1.0 - weight) + measured.ln() * weight;
        self.bits_at_one[kind] = learnt.exp();
        self.known[kind] = true;
        if kind == 0 && !self.known[1] {
            let share = BITS_AT_ONE[1] / BITS_AT_ONE[0];
            self.bits_at_one[1] = share * self.bits_at_one[0];
        }
    }

    /// Bits of a frame by the model.
    fn bits(&self, frame: FrameFacts, step: f64) -> f64 {
        let kind = usize::from(!frame.keyframe);
        frame.blocks as f64 * self.bits_at_one[kind] * step.powf(-EXPONENTS[kind])
    }

    /// Mean bits of the frames of a GOP by the model.
    fn mean_bits(&self, blocks: usize, step: f64) -> f64 {
        let [key, other] = [true, false].map(|keyframe| self.bits(FrameFacts { keyframe, blocks }, step));
        (key + (self.gop - 1.0) * other) / self.gop
    }

    /// What the mean is to be from here on: the rate, less what was spent too much in a second's time. Right behind a keyframe the
    /// balance is above what it will be at the GOP's end, without anything being wrong.
    fn wanted_mean(&self, frame: FrameFacts) -> f64 {
        let rate = self.target.frame_bits();
        let position = if frame.keyframe { self.gop } else { f64::from(self.since_keyframe) };
        let step = self.last_step.unwrap_or(1.0);
        let other = self.bits(FrameFacts { keyframe: false, ..frame }, step);
        let to_be_saved = (rate - other).max(0.0) * (self.gop - position).max(0.0);
        let expected = if self.last_step.is_some() { to_be_saved } else { 0.0 };
        let correction = (self.balance - expected) / (CORRECTION_S * self.target.frames_per_second);
        (rate - correction).clamp(MEAN_LIMITS[0] * rate, MEAN_LIMITS[1] * rate)
    }

    /// The step at which `bits`, which fall with it, are `wanted`.
    fn solve(&self, bits: impl Fn(f64) -> f64, wanted: f64) -> f64 {
        let (mut fine, mut coarse) = (FINEST_STEP.ln(), COARSEST_STEP.ln());
        for _ in 0..40 {
            let middle = 0.5 * (fine + coarse);
            if bits(middle.exp()) > wanted { fine = middle } else { coarse = middle }
        }
        coarse.exp()
    }
}
