//! Colour on decoded surfaces: samples in the cells that a surface crosses.
//!
//! ```text
//! SparseVolume ─> ColourCells: which cells, where their surface lies
//!                      │
//! colour part ─ syntax: range decoder ─> ColourSymbols ─ reconstruct: prediction + inverse transform ─> ColourFrame
//!                                                             ▲ the frame before ─────────────────────────┘
//! ```
//!
//! - [`cells`]: the cells of a frame, derived from its decoded field and never sent.
//! - [`morton`]: the order of cells in a block.
//! - [`frame`]: the samples of a frame.
//! - [`Reader`]: readings of colour at points, and in the parts of cells.
//! - [`tree`]: the octree of a block's cells and its weights.
//! - [`transform`]: the weighted Haar transform over that tree (RAHT, de Queiroz and Chou 2016).
//! - [`compensation`]: prediction from the frame before, along vectors and through the surface.
//! - [`upsampling`]: prediction of children from the parents around them, within a frame.
//! - [`syntax`]: entropy-coded symbols; `isv-encode` has the writing side under the same names.
//! - [`reconstruct`]: symbols to samples, called by both sides.
//! - [`ExactColour`]: which blocks are right after a loss.
//! - [`ycbcr`]: samples to sRGB.
//!
//! All arithmetic is integers. Positions and distances count 1/256 of a voxel, as codes of the field do; samples count 1/64 of
//! an 8-bit step.

pub mod cells;
pub mod compensation;
mod crossing;
mod decoder;
mod exactness;
pub mod frame;
pub mod morton;
mod reader;
pub mod reconstruct;
mod reference;
mod region;
mod surface;
mod surfel;
pub mod symbols;
pub mod syntax;
pub mod transform;
pub mod tree;
pub mod upsampling;
pub mod ycbcr;

pub use cells::ColourCells;
pub use decoder::{ColourDecoder, ColourError, steps};
pub use exactness::{ExactColour, ExactReader, ExactSource};
pub use frame::{ColourFrame, ColourShape, Sample};
pub use reader::Reader;
pub use reference::ColourReference;
pub use surface::{colours_near, surface_colours};
pub use surfel::Surfel;
pub use symbols::ColourSymbols;
