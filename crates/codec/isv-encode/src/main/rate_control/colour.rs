//! Rate of colour: steps that go with those of geometry, and a model of the bits that they cost.

use super::{BitrateControl, FrameFacts, RateControl};

/// The power of the scale of steps that bits fall with: intra frames, predicted ones.
const EXPONENTS: [f64; 2] = [1.3, 1.9];
/// Bits of a block at scale 1 before anything is known.
const BITS_AT_ONE: [f64; 2] = [46.0, 4.5];
/// How fast they are learnt: weight of the last frame of a kind.
const LEARNING: [f64; 2] = [0.7, 0.3];
/// The finest and the coarsest scale.
const SCALES: [f64; 2] = [0.05, 16.0];
/// A frame of a kind that nothing is known of is coded anew if its bits are farther than this factor from what was expected.
const SURPRISE: f64 = 1.25;
/// A frame that overran the bucket gets steps larger by this factor at least.
const LEAST_CHANGE: f64 = 1.2;
/// Powers that the error of pictures grows with: of the step of geometry, of the scale of those of colour.
const ERROR_EXPONENTS: [f64; 2] = [0.875, 0.9];
/// Powers that bits of whole GOPs fall with: of geometry, of colour.
const MEAN_EXPONENTS: [f64; 2] = [0.9, 1.6];
/// Bits of colour over those of geometry in a good split, at a step of 1 voxel and scale 1.
const SHARES_AT_ONE: f64 = 2.2;
/// [`ColourSplit::excess`] before anything is known.
const EXCESS: f64 = 0.44;
/// How much the scale of a frame may differ from that of the frame before; of intra frames, more.
const LARGEST_CHANGE: f64 = 1.12;
const LARGEST_CHANGE_OF_INTRA: f64 = 1.5;

/// Colour in a bit rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourShare {
    /// No colour, or none that the rate counts.
    None,
    /// Colour with the steps of the settings; geometry gets the rest. Coarser steps are taken only where the buffer would be overrun.
    Fixed,
    /// Colour with steps that go with those of geometry.
    Joint,
}

/// Split of a bit rate between geometry and colour.
///
/// A bit of either takes the same error from pictures: the squared error of drawn streams against the drawn capture. That error is taken
/// as `step^0.875` of geometry and `scale^0.9` of colour, their bits as `step^-0.9` and `scale^-1.6` (`docs/design/019-rate-control.md`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSplit {
    /// Factor by which colour takes more bits than its share, at a step of 1 voxel and scale 1.
    excess: f64,
}

impl Default for ColourSplit {
    /// The split of a person, before anything is known of a take.
    fn default() -> Self {
        Self { excess: EXCESS }
    }
}

impl ColourSplit {
    /// The split of a take. `bits`: those of geometry and of colour that a step (voxels) and a scale gave.
    #[must_use]
    pub fn of_bits(bits: [f64; 2], step: f64, scale: f64) -> Self {
        let [geometry, colour] = [step, scale].map(|size| size.max(1e-3));
        let at_one = [
            bits[0].max(1.0) * geometry.powf(MEAN_EXPONENTS[0]),
            bits[1].max(1.0) * colour.powf(MEAN_EXPONENTS[1]),
        ];
        Self { excess: at_one[1] / at_one[0] / SHARES_AT_ONE }
    }

    /// The factor on the steps of colour of quality 50 that goes with a step of geometry (voxels).
    #[must_use]
    pub fn scale(&self, step: f64) -> f64 {
        let [geometry, colour] = [0, 1].map(|part| MEAN_EXPONENTS[part] + ERROR_EXPONENTS[part]);
        (self.excess * step.powf(geometry)).powf(1.0 / colour).clamp(SCALES[0], SCALES[1])
    }
}

/// Colour of a frame as coded once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColourAttempt {
    /// Whether it was coded without the frame before.
    pub intra: bool,
    /// Factor on the steps of the settings.
    pub scale: f64,
    /// Bits in the stream.
    pub bits: f64,
}

/// Bits of colour by the scale of its steps.
#[derive(Clone, Debug)]
pub(super) struct ColourModel {
    share: ColourShare,
    bits_at_one: [f64; 2],
    known: [bool; 2],
    split: ColourSplit,
    /// Scale of the last frame.
    last: Option<f64>,
}

impl ColourModel {
    pub(super) fn new(share: ColourShare) -> Self {
        Self { share, bits_at_one: BITS_AT_ONE, known: [false; 2], split: ColourSplit::default(), last: None }
    }

    /// The scale beside a step of geometry.
    pub(super) fn scale(&self, step: f64) -> f64 {
        match self.share {
            ColourShare::Joint => self.split.scale(step),
            ColourShare::None | ColourShare::Fixed => 1.0,
        }
    }

    /// The scale beside a step of geometry, near that of the frame before.
    pub(super) fn next_scale(&self, step: f64, intra: bool) -> f64 {
        let change = if intra { LARGEST_CHANGE_OF_INTRA } else { LARGEST_CHANGE };
        let wanted = self.scale(step);
        self.last.map_or(wanted, |last| wanted.clamp(last / change, last * change))
    }

    /// Whether frames of both kinds were learnt.
    pub(super) fn is_known(&self) -> bool {
        self.known == [true; 2]
    }

    /// Splits the rate by what frames of both kinds took. `bits`: means of a GOP's frames, of geometry at a step (voxels) and of colour at
    /// the scale of the last frame.
    pub(super) fn learn_split(&mut self, bits: [f64; 2], step: f64) {
        self.split = ColourSplit::of_bits(bits, step, self.last.unwrap_or(1.0));
    }

    /// Bits of a frame's colour; 0 where the rate does not count it.
    pub(super) fn bits(&self, frame: FrameFacts, scale: f64) -> f64 {
        let kind = usize::from(!frame.keyframe);
        match self.share {
            ColourShare::None => 0.0,
            _ => frame.blocks as f64 * self.bits_at_one[kind] * scale.powf(-EXPONENTS[kind]),
        }
    }

    /// The finest scale at which a frame's colour has at most so many bits.
    pub(super) fn scale_of_bits(&self, frame: FrameFacts, bits: f64) -> f64 {
        let at_one = self.bits(frame, 1.0);
        let power = 1.0 / EXPONENTS[usize::from(!frame.keyframe)];
        (at_one / bits.max(1.0)).powf(power).clamp(SCALES[0], SCALES[1])
    }

    /// The scale at which a frame should have so many bits, by an attempt that has more. `None` if there is no coarser one.
    pub(super) fn coarser(&self, attempt: &ColourAttempt, bits: f64) -> Option<f64> {
        let power = 1.0 / EXPONENTS[usize::from(!attempt.intra)];
        let factor = (attempt.bits / bits.max(1.0)).powf(power).max(LEAST_CHANGE);
        (attempt.scale < SCALES[1]).then_some((attempt.scale * factor).min(SCALES[1]))
    }

    /// Whether nothing was known of a frame's kind, and its bits are not what was expected. Steps that do not change surprise nobody.
    pub(super) fn is_surprised_by(&self, frame: FrameFacts, attempt: &ColourAttempt) -> bool {
        let expected = self.bits(frame, attempt.scale);
        self.share == ColourShare::Joint
            && !self.known[usize::from(!attempt.intra)]
            && !(expected / SURPRISE..=expected * SURPRISE).contains(&attempt.bits)
    }

    pub(super) fn learn(&mut self, frame: FrameFacts, attempt: &ColourAttempt) {
        let kind = usize::from(!attempt.intra);
        let of_block = attempt.bits.max(1.0) / frame.blocks.max(1) as f64;
        let measured = of_block * attempt.scale.powf(EXPONENTS[kind]);
        let weight = if self.known[kind] { LEARNING[kind] } else { 1.0 };
        let learnt = self.bits_at_one[kind].ln() * (1.0 - weight) + measured.ln() * weight;
        self.bits_at_one[kind] = learnt.exp();
        self.known[kind] = true;
        self.last = Some(attempt.scale);
        if kind == 0 && !self.known[1] {
            self.bits_at_one[1] = BITS_AT_ONE[1] / BITS_AT_ONE[0] * self.bits_at_one[0];
        }
    }
}

/// Rate control of the colour of the frame whose geometry was coded last.
#[derive(Debug)]
pub struct ColourRate<'a>(Option<&'a mut BitrateControl>);

impl<'a> ColourRate<'a> {
    /// Steps of the settings, in all frames.
    pub const CONSTANT: Self = Self(None);

    pub(super) fn new(control: &'a mut RateControl) -> Self {
        match control {
            RateControl::Bitrate(control) => Self(Some(control)),
            RateControl::Constant | RateControl::MaxError(_) => Self(None),
        }
    }

    /// The factor on the steps of the settings to code a frame with.
    pub(crate) fn first_scale(&self, intra: bool) -> f64 {
        self.0.as_ref().map_or(1.0, |control| control.colour_scale(intra))
    }

    /// The factor to code the frame with anew, unless the last of its attempts is good enough or as good as can be.
    pub(crate) fn retry(&self, attempts: &[ColourAttempt]) -> Option<f64> {
        self.0.as_ref().and_then(|control| control.retry_colour(attempts))
    }

    /// Counts the bits of colour that was kept and not coded, from which nothing is learnt.
    pub(crate) fn spend(&mut self, bits: f64) {
        if let Some(control) = &mut self.0 {
            control.spend(bits);
        }
    }

    /// Learns from the attempt that goes into the stream.
    pub(crate) fn learn(&mut self, attempt: &ColourAttempt) {
        if let Some(control) = &mut self.0 {
            control.learn_colour(attempt);
        }
    }
}
