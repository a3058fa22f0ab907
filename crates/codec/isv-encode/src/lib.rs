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
//! What lies beside this file is the paper's codec, and what both profiles share; profile `main` is in `main_profile`, with files of the
//! same names for the same steps.

mod backend;
mod distortion;
mod encoder;
mod frame_coder;
mod frame_writer;
mod main_profile;
mod motion_search;
mod normal_equations;
mod paper_coder;
mod residual;
mod surface_distance;
pub mod syntax;

pub use backend::{EncodeBackend, SearchBackend};
pub use distortion::surface_rms_voxels;
pub use encoder::{BLOCKS_PER_SLICE, EncodedFrame, Encoder, EncoderSettings, MotionMode};
pub use frame_coder::FrameCoder;
pub use frame_writer::{FrameWriter, UnwrittenFrame};
#[doc(hidden)]
pub use main_profile::probe;
pub use main_profile::{
    Band, Bitrate, BlockShifts, COARSEST_STEP, FINEST_STEP, FrameQuality, MainEncoder, MainSettings,
    MotionQuery, Preset, RateTarget, Refresh, SearchEffort, Tools, UnknownTool,
};
pub use paper_coder::PaperCoder;
pub use surface_distance::surface_distance_voxels;
