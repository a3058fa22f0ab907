//! Sparse volumes in, frame payloads out.
//!
//! ```text
//! SparseVolume ─ motion_search ─ predict ─ residual ─ DCT ─ quantizer ─> FrameSymbols ─ syntax: range coder ─> EncodedFrame
//!                     ▲                                                       └─ reconstruct ─> Reference ─┐
//!                     └────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! [`Encoder`] is the whole of it, on the CPU. In profile `paper` an [`EncodeBackend`] does all but the syntax, and [`PaperCoder`]
//! takes any. In profile `main` a [`SearchBackend`] can search for motion, and [`MainEncoder`] takes any. [`FrameCoder`] is either
//! of them. It leaves the syntax of profile `paper` to a [`FrameWriter`], which can write while the next frame is coded.
//!
//! Prediction and reconstruction are `isv-decode`'s own (Eq. 11). This crate makes the choices, which may use floating point, and
//! writes the syntax. The same volumes and settings give the same bytes on any number of threads.
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
