//! Which step each frame is coded with: one for all, what meets a rate, or what keeps within an error.
//!
//! ```text
//! first_step ─> the frame coded ─> Attempt ─ retry ─> none: learn, go on to the next frame
//!     ▲                                        └────> a step: the frame coded anew ─> Attempt ...
//! ```
//!
//! Nothing here depends on time or threads: the same volumes give the same steps.

mod bitrate;
mod colour;
mod error_bound;

pub use bitrate::Bitrate;
use bitrate::BitrateControl;
pub(crate) use colour::ColourAttempt;
pub use colour::{ColourRate, ColourShare, ColourSplit};
use error_bound::ErrorControl;

/// The finest step that rate control takes, in voxels.
pub const FINEST_STEP: f64 = 0.1;
/// The coarsest step that rate control takes, in voxels: beyond it surfaces come apart and go missing, and bits hardly fall
/// (`docs/design/019-rate-control.md`).
pub const COARSEST_STEP: f64 = 10.0;

/// What the steps of a stream's frames are chosen for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RateTarget {
    /// The step of the settings, in all frames.
    Constant,
    /// A rate.
    Bitrate(Bitrate),
    /// Each frame's [`surface_distance_voxels`](crate::surface_distance_voxels) is at most this, or what the finest step gives.
    MaxError(f64),
}

/// A frame to be coded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameFacts {
    pub keyframe: bool,
    /// Coded blocks.
    pub blocks: usize,
}

/// A frame as coded once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attempt {
    pub frame: FrameFacts,
    /// In voxels.
    pub step: f64,
    /// Bits in the stream, everything counted.
    pub bits: f64,
    /// Distance as in [`EncodedFrame::surface_distance_voxels`](crate::EncodedFrame); 0 where no target asks for it.
    pub surface_distance: f64,
}

/// Chooses steps.
#[derive(Clone, Debug)]
pub(crate) enum RateControl {
    Constant,
    Bitrate(BitrateControl),
    MaxError(ErrorControl),
}

impl RateControl {
    pub(crate) fn new(target: RateTarget, gop: u32) -> Self {
        match target {
            RateTarget::Constant => Self::Constant,
            RateTarget::Bitrate(bitrate) => Self::Bitrate(BitrateControl::new(bitrate, gop)),
            RateTarget::MaxError(bound) => Self::MaxError(ErrorControl::new(bound)),
        }
    }

    /// The step to code a frame with; `constant` is that of the settings.
    pub(crate) fn first_step(&self, frame: FrameFacts, constant: f64) -> f64 {
        match self {
            Self::Constant => constant,
            Self::Bitrate(control) => control.first_step(frame),
            Self::MaxError(control) => control.first_step(frame),
        }
    }

    /// The step to code the frame with anew; `None` if the last of its attempts is good enough or as good as can be. There is one
    /// attempt at least.
    pub(crate) fn retry(&self, attempts: &[Attempt]) -> Option<f64> {
        match self {
            Self::Constant => None,
            Self::Bitrate(control) => control.retry(attempts),
            Self::MaxError(control) => control.retry(attempts),
        }
    }

    /// Learns from the attempt that goes into the stream.
    pub(crate) fn learn(&mut self, attempt: &Attempt) {
        match self {
            Self::Constant => {}
            Self::Bitrate(control) => control.learn(attempt),
            Self::MaxError(control) => control.learn(attempt),
        }
    }

    /// Control of the colour of the frame that was learnt from last.
    pub(crate) fn of_colour(&mut self) -> ColourRate<'_> {
        ColourRate::new(self)
    }

    pub(crate) fn needs_error(&self) -> bool {
        matches!(self, Self::MaxError(_))
    }
}
