//! Profile `main`: only the blocks that the surface touches, predicted from the frame before or from their neighbours.
//!
//! ```text
//! segments ─ syntax ─> FrameSymbols ─ reconstruct: prediction + inverse DCT ─ loop_filter ─ extension ─> MainReference
//!               │                         ▲ MainReference: the frame before ────────────────────────────┤
//!               └ MainBlocks: the frame before without its samples ─────────────────────────────────────┘
//! ```
//!
//! What is right of the symbols is the work of a [`Backend`](crate::backend::Backend). Its frames give the syntax of the next one
//! their [`MainBlocks`]. In their samples they find what [`activity`] is expected, and for the masks the [`crossed_cells`].
//!
//! The encoder makes [`FrameSymbols`] and uses the parts of [`reconstruct`] for its closed loop, as in profile `paper`.

pub mod activity;
mod blocks;
pub mod cell_corners;
mod concealment;
pub mod crossed_cells;
pub(crate) mod decoder;
mod displaced_block;
mod exactness;
pub mod extension;
mod levels;
mod loop_filter;
mod neighbours;
mod parameters;
pub mod reconstruct;
mod recovery;
mod reference;
mod symbols;
pub mod syntax;
mod window;

pub use blocks::{CodedBlock, MainBlocks};
pub(crate) use concealment::lead_over_loss;
pub use exactness::ExactBlocks;
pub use levels::{BlockLevels, Level};
pub use neighbours::{CausalBlocks, MERGE_NEIGHBOURS, SliceBlocks};
pub use parameters::{COEFFICIENTS, MainParameters};
pub use reference::MainReference;
pub use symbols::{BlockMode, FrameSymbols, Vector};
pub use window::Window;
