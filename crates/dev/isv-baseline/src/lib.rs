//! The codecs that isv is compared with.
//!
//! | | what |
//! |---|---|
//! | [`BlockMoments`], [`BlockBasis`] | Karhunen-Loève transforms learned from blocks, the fixed DCT beside them, and how well each compacts energy (the paper's Fig. 4) |
//! | [`TangEncoder`], [`TangDecoder`] | Tang et al. 2018: a learned transform with isv's own entropy coder, intra-only |
//! | [`Draco`] | Google's mesh codec, run as a program if it is installed |
//! | [`TextureVideo`] | textures as H.264 video beside Draco's meshes, by ffmpeg |
//! | [`Gltfpack`] | meshoptimizer's packer of glTF, as a program |
//! | [`Tmc13`] | the test model of MPEG's G-PCC, as a program: points of a [`Lattice`] in, points out |
//! | [`Tmc2`] | the test model of MPEG's V-PCC, as programs: whole takes of points |
//! | [`Vdmc`] | the test model of MPEG's V-DMC, as programs: whole takes of meshes |
//! | [`Tools`] | where those programs are |
//! | [`simplify`], [`simplify_textured`] | quadric simplification, as a practical person would put before Draco |
//!
//! None of this is part of the codec: the choices are explained in `docs/design/017-baselines.md`, the rate-distortion
//! studies are elsewhere.

mod basis;
mod bench;
mod draco;
mod gltfpack;
mod lattice;
mod moments;
mod program;
mod simplify;
mod tang;
mod texture_video;
mod tmc13;
mod tmc2;
mod tool_error;
mod tools;
mod vdmc;

#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;

pub use basis::BlockBasis;
pub use bench::{CodedPoints, ToolRun};
pub use draco::{Draco, DracoError};
pub use gltfpack::Gltfpack;
pub use lattice::{Lattice, Voxels};
pub use moments::{BlockMoments, TrainingError};
pub use program::{ProgramError, ProgramRun};
pub use simplify::{SimplifyError, simplify, simplify_textured};
pub use tang::{TangDecoder, TangEncoder, TangError, TangFrame, TangSettings};
pub use texture_video::{CodedTextures, TextureEncoding, TexturePictures, TextureVideo, VideoSettings};
pub use tmc2::Tmc2;
pub use tmc13::{Tmc13, Tmc13Geometry};
pub use tool_error::ToolError;
pub use tools::{ToolVersion, Tools, UnusableTool};
pub use vdmc::Vdmc;
