//! Profile `paper`: the codec as the paper describes it.

pub(crate) mod decoder;
mod parameters;
pub mod reconstruct;
mod reference;
mod symbols;
pub mod syntax;

pub use parameters::CodingParameters;
pub use reference::Reference;
pub use symbols::FrameSymbols;
