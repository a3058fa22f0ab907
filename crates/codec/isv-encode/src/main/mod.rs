//! Profile `main`, encoder's side.
//!
//! ```text
//! SparseVolume ─ target: which blocks, which voxels matter ─ motion_search ─┐
//!                                                                           ▼
//!        block by block: candidates ─ prediction ─ pursuit: levels ─> the choice of least error + lambda x bits ─> syntax
//!                                        ▲                                  │
//!                                        └── samples as the decoder has them┘
//! ```

mod change;
mod encoder;
mod field_dct;
mod floaters;
mod lanes;
mod level_costs;
mod masks;
mod model_bits;
mod motion_query;
mod motion_search;
mod preset;
pub mod probe;
mod pursuit;
mod rate_control;
mod refinement;
mod refresh;
mod search_window;
mod settings;
mod slice;
pub(crate) mod syntax;
mod target;
mod tools;
mod weight_spectrum;

pub use encoder::MainEncoder;
pub use motion_query::{BlockShifts, MotionQuery};
pub use motion_search::SearchEffort;
pub use preset::Preset;
pub(crate) use rate_control::ColourAttempt;
pub use rate_control::{
    Bitrate, COARSEST_STEP, ColourRate, ColourShare, ColourSplit, FINEST_STEP, RateTarget,
};
pub use refresh::Refresh;
pub use settings::{Band, FrameQuality, MainSettings};
pub use tools::{Tools, UnknownTool};
