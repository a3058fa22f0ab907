//! Profile `main`: only the blocks that the surface touches, predicted from the frame before or from their neighbours.
//!
//! ```text
//! segments ─ syntax ─> FrameSymbols ─ reconstruct: prediction + inverse DCT ─ loop_filter ─ extension ─> MainReference
//!                                         ▲ MainReference: the frame before ────────────────────────────┘
//! ```
//!
//! The encoder makes [`FrameSymbols`] and uses the parts of [`reconstruct`] for its closed loop, as in profile `paper`.

pub mod activity;
pub mod crossed_cells;
mod displaced_block;
mod levels;
mod loop_filter;
mod neighbours;
mod parameters;
pub mod reconstruct;
mod reference;
mod symbols;
pub mod syntax;
mod window;

pub use levels::{BlockLevels, Level};
pub use neighbours::{CausalBlocks, MERGE_NEIGHBOURS, SliceBlocks};
pub use parameters::{COEFFICIENTS, MainParameters};
pub use reference::MainReference;
pub use symbols::{BlockMode, FrameSymbols, Vector};
pub use window::Window;
