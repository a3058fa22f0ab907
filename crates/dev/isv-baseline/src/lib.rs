//! The codecs that isv is compared with.
//!
//! | | what |
//! |---|---|
//! | [`BlockMoments`], [`BlockBasis`] | Karhunen-Loève transforms learned from blocks, the fixed DCT beside them, and how well each compacts energy (the paper's Fig. 4) |
//! | [`TangEncoder`], [`TangDecoder`] | Tang et al. 2018: a learned transform with isv's own entropy coder, intra-only |
//! | [`Draco`] | Google's mesh codec, run as a program if it is installed |
//! | [`simplify`] | quadric simplification, as a practical person would put before Draco |
//!
//! None of this is part of the codec: the choices are explained in `docs/design/017-baselines.md`, the rate-distortion
//! studies are elsewhere.

mod basis;
mod draco;
mod moments;
mod program;
mod simplify;
mod tang;

#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;

pub use basis::BlockBasis;
pub use draco::{Draco, DracoError};
pub use moments::{BlockMoments, TrainingError};
pub use program::{ProgramError, ProgramRun};
pub use simplify::{SimplifyError, simplify};
pub use tang::{TangDecoder, TangEncoder, TangError, TangFrame, TangSettings};
