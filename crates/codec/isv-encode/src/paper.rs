//! Profile `paper`, encoder's side: the codec as the paper describes it.

mod coder;
pub(crate) mod motion_search;
mod normal_equations;
pub(crate) mod residual;
pub mod syntax;

pub use coder::PaperCoder;
