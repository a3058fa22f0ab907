//! Sparse volumes in, frame payloads out.
//!
//! ```text
//! SparseVolume ─ motion_search ─ predict ─ residual ─ DCT ─ quantizer ─> FrameSymbols ─ syntax: range coder ─> EncodedFrame
//!                     ▲                                                       └─ reconstruct ─> Reference ─┐
//!                     └────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! [`Encoder`] is the whole of it, on the CPU. In profile `paper` all but the syntax is an [`EncodeBackend`]'s, and
//! [`PaperCoder`] takes any; in profile `main` the search for motion can be a [`SearchBackend`]'s, and [`MainEncoder`] takes
//! any. [`FrameCoder`] is either of them; what it leaves to a [`FrameWriter`], the syntax of profile `paper`, can be done while the
//! next frame is coded. Prediction and reconstruction are `isv-decode`'s own (Eq. 11); what is here are the
//! choices, which may use floating point, and the writing side of the syntax. The same volumes and settings give the same
//! bytes on any number of threads.
//!
//! `main` is the product's profile, `paper` the one that it is measured against. Files of the same names have the same steps. What both
//! have is in `shared`.

mod backend;
pub mod colour;
mod encoder;
mod frame_coder;
mod frame_writer;
// A file src/main.rs would be a program.
#[path = "main/mod.rs"]
mod main;
pub mod paper;
pub mod shared;

pub use backend::{EncodeBackend, SearchBackend};
pub use encoder::{BLOCKS_PER_SLICE, EncodedFrame, Encoder, EncoderSettings, MotionMode};
pub use frame_coder::FrameCoder;
pub use frame_writer::{FrameWriter, UnwrittenFrame};
#[doc(hidden)]
pub use main::probe;
pub use main::{
    Band, Bitrate, BlockShifts, COARSEST_STEP, ColourRate, ColourShare, ColourSplit, FINEST_STEP,
    FrameQuality, MainEncoder, MainSettings, MotionQuery, Preset, RateTarget, Refresh, SearchEffort, Tools,
    UnknownTool,
};
pub use paper::PaperCoder;
pub use shared::{surface_distance_voxels, surface_rms_voxels};
