//! Steps that meet a rate in one pass, through a leaky bucket.
//!
//! Bits of a frame are taken as `blocks x a x step^-b`, `a` learnt from the frames before of its kind. At the step that is taken, the
//! frames of a GOP have the wanted mean. That mean is corrected by what was spent too much or too little.
//!
//! Colour is coded behind the geometry of its frame. Its bits are part of the mean, and its steps follow from that of geometry.

use super::colour::{ColourAttempt, ColourModel, ColourShare};
use super::{Attempt, COARSEST_STEP, FINEST_STEP, FrameFacts};

/// The power of the step that bits fall with: keyframes, other frames.
const EXPONENTS: [f64; 2] = [0.85, 0.9];
/// Bits of a block at a step of one voxel before anything is known.
const BITS_AT_ONE: [f64; 2] = [65.0, 16.5];
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
/// The buffer is a bucket that leaks at the rate. The bits of any run of frames are at most the run's time times the rate, plus the
/// buffer's size. A frame that would overrun it is coded anew, coarser; it overruns only if the coarsest step does not help.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bitrate {
    /// Bits a second, every byte of the stream counted.
    pub bits_per_second: f64,
    /// Frames a second.
    pub frames_per_second: f64,
    /// Size of the buffer, in seconds at the rate.
    pub buffer_s: f64,
    /// Colour that the rate pays for too.
    pub colour: ColourShare,
}

impl Bitrate {
    /// A rate of geometry alone, through a buffer of one second.
    #[must_use]
    pub fn new(bits_per_second: f64, frames_per_second: f64) -> Self {
        Self { bits_per_second, frames_per_second, buffer_s: 1.0, colour: ColourShare::None }
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
    /// Bits in the bucket right behind the last frame.
    level: f64,
    /// Bits spent beyond the rate so far, negative if too few.
    balance: f64,
    /// `a` of keyframes and of other frames.
    bits_at_one: [f64; 2],
    /// Whether `a` of each kind was learnt.
    known: [bool; 2],
    /// Geometry of the last frame that had blocks. Others say nothing of steps.
    last: Option<Attempt>,
    /// Whether the last frame had no blocks.
    was_empty: bool,
    /// Mean bits that were wanted of a frame when it was coded.
    wanted: f64,
    colour: ColourModel,
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
            last: None,
            was_empty: false,
            wanted: target.frame_bits(),
            colour: ColourModel::new(target.colour),
        }
    }

    pub(super) fn first_step(&self, frame: FrameFacts) -> f64 {
        let wanted = self.wanted_mean(frame);
        let mut step = self.solve(|step| self.mean_bits(frame.blocks, step), wanted);
        if let Some(Attempt { step: last, .. }) = self.last {
            let change = if frame.keyframe { LARGEST_CHANGE_AT_KEYFRAMES } else { LARGEST_CHANGE };
            step = step.clamp(last / change, last * change);
        }
        let fits = self.solve(|step| self.bits(frame, step), AIM * self.room());
        step.max(fits).clamp(FINEST_STEP, COARSEST_STEP)
    }

    pub(super) fn retry(&self, attempts: &[Attempt]) -> Option<f64> {
        let (attempt, before) = attempts.split_last()?;
        let Attempt { frame, step, bits, .. } = *attempt;
        let kind = usize::from(!frame.keyframe);
        let room = self.room();
        let of_frame = bits + self.colour.bits(frame, self.colour.scale(step));
        let finer_by =
            |factor: f64| (step * factor.powf(1.0 / EXPONENTS[kind])).clamp(FINEST_STEP, COARSEST_STEP);
        if of_frame > room && step < COARSEST_STEP {
            let coarser = finer_by(of_frame / (AIM * room).max(1.0)).max(1.1 * step);
            return Some(coarser.min(COARSEST_STEP));
        }
        if self.known[kind] || before.len() >= SURPRISES || frame.blocks == 0 {
            return None;
        }
        // Now that a frame of the kind is known, the model has another step for it.
        let expected = self.geometry_bits(frame, step);
        let surprising = !(expected / SURPRISE..=expected * SURPRISE).contains(&bits);
        let mut wiser = self.clone();
        wiser.learn_bits(attempt);
        let better = wiser.first_step(frame);
        (surprising && of_frame <= room && (better / step).ln().abs() > 0.1).then_some(better)
    }

    pub(super) fn learn(&mut self, attempt: &Attempt) {
        self.was_empty = attempt.frame.blocks == 0;
        if !self.was_empty {
            self.wanted = self.wanted_mean(attempt.frame);
            self.learn_bits(attempt);
            self.last = Some(*attempt);
        }
        self.since_keyframe = if attempt.frame.keyframe { 1 } else { self.since_keyframe + 1 };
        self.level = self.leaked() + attempt.bits;
        // What a simple scene saves is not all for later.
        let spent = attempt.bits - self.target.frame_bits();
        self.balance = (self.balance + spent).max(-self.target.capacity());
    }

    /// Bits in the bucket when the next frame comes.
    fn leaked(&self) -> f64 {
        (self.level - self.target.frame_bits()).max(0.0)
    }

    /// Bits that the next frame may have.
    fn room(&self) -> f64 {
        self.target.capacity() - self.leaked()
    }

    /// The scale of steps to code the colour of the last frame with.
    pub(super) fn colour_scale(&self, intra: bool) -> f64 {
        let Some(Attempt { frame, step, .. }) = self.last else { return 1.0 };
        let frame = FrameFacts { keyframe: intra, ..frame };
        let room = AIM * (self.target.capacity() - self.level);
        self.colour.next_scale(step, intra).max(self.colour.scale_of_bits(frame, room))
    }

    /// The scale to code it with anew, unless the last of its attempts, of which there is one at least, is good enough.
    pub(super) fn retry_colour(&self, attempts: &[ColourAttempt]) -> Option<f64> {
        let (attempt, before) = attempts.split_last()?;
        let frame = FrameFacts { keyframe: attempt.intra, ..self.last?.frame };
        let room = self.target.capacity() - self.level;
        if attempt.bits > room {
            return self.colour.coarser(attempt, AIM * room);
        }
        if before.len() >= SURPRISES || self.was_empty || !self.colour.is_surprised_by(frame, attempt) {
            return None;
        }
        // Now that colour of the kind is known, the model has another step for the frame: what its geometry should have had.
        let mut wiser = self.clone();
        wiser.colour.learn(frame, attempt);
        let step = wiser.solve(|step| wiser.mean_bits(frame.blocks, step), self.wanted);
        let scale = wiser.colour.scale(step).max(wiser.colour.scale_of_bits(frame, AIM * room));
        ((scale / attempt.scale).ln().abs() > 0.1).then_some(scale)
    }

    /// Learns from the colour that goes into the stream.
    pub(super) fn learn_colour(&mut self, attempt: &ColourAttempt) {
        let Some(Attempt { frame, step, .. }) = self.last.filter(|_| !self.was_empty) else {
            return self.spend(attempt.bits);
        };
        self.colour.learn(FrameFacts { keyframe: attempt.intra, ..frame }, attempt);
        if self.known == [true; 2] && self.colour.is_known() {
            let of_kind = |keyframe| FrameFacts { keyframe, ..frame };
            let bits = [
                self.mean_of(|keyframe| self.geometry_bits(of_kind(keyframe), step)),
                self.mean_of(|keyframe| self.colour.bits(of_kind(keyframe), attempt.scale)),
            ];
            self.colour.learn_split(bits, step);
        }
        self.spend(attempt.bits);
    }

    /// Counts bits beside the geometry of the last frame.
    pub(super) fn spend(&mut self, bits: f64) {
        self.level += bits;
        self.balance += bits;
    }

    fn learn_bits(&mut self, attempt: &Attempt) {
        let kind = usize::from(!attempt.frame.keyframe);
        let measured = attempt.bits / (attempt.frame.blocks as f64 * attempt.step.powf(-EXPONENTS[kind]));
        let weight = if self.known[kind] { LEARNING[kind] } else { 1.0 };
        let learnt = self.bits_at_one[kind].ln() * (1.0 - weight) + measured.ln() * weight;
        self.bits_at_one[kind] = learnt.exp();
        self.known[kind] = true;
        if kind == 0 && !self.known[1] {
            let share = BITS_AT_ONE[1] / BITS_AT_ONE[0];
            self.bits_at_one[1] = share * self.bits_at_one[0];
        }
    }

    /// Bits of a frame by the models.
    fn bits(&self, frame: FrameFacts, step: f64) -> f64 {
        self.geometry_bits(frame, step) + self.colour.bits(frame, self.colour.scale(step))
    }

    fn geometry_bits(&self, frame: FrameFacts, step: f64) -> f64 {
        let kind = usize::from(!frame.keyframe);
        frame.blocks as f64 * self.bits_at_one[kind] * step.powf(-EXPONENTS[kind])
    }

    /// Mean bits of the frames of a GOP by the model.
    fn mean_bits(&self, blocks: usize, step: f64) -> f64 {
        self.mean_of(|keyframe| self.bits(FrameFacts { keyframe, blocks }, step))
    }

    /// Mean over a GOP of what keyframes have and what the others do.
    fn mean_of(&self, value: impl Fn(bool) -> f64) -> f64 {
        (value(true) + (self.gop - 1.0) * value(false)) / self.gop
    }

    /// What the mean is to be from here on: the rate, less what was spent too much in a second's time. Right behind a keyframe the
    /// balance is above what it will be at the GOP's end, without anything being wrong.
    fn wanted_mean(&self, frame: FrameFacts) -> f64 {
        let rate = self.target.frame_bits();
        let position = if frame.keyframe { self.gop } else { f64::from(self.since_keyframe) };
        let step = self.last.map_or(1.0, |last| last.step);
        let other = self.bits(FrameFacts { keyframe: false, ..frame }, step);
        let to_be_saved = (rate - other).max(0.0) * (self.gop - position).max(0.0);
        let expected = if self.last.is_some() { to_be_saved } else { 0.0 };
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
