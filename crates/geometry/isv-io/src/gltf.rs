//! glTF 2.0 (Khronos, ISO/IEC 12113), as `.glb` in one file and as `.gltf` with its buffers beside it. It has
//! the triangles of the default scene in and out, moving ones too, with their base colours where these are
//! asked for. Cameras and lights are not looked at.
//!
//! Read by our own code on top of a JSON parser: see docs/design/014-animated-glb.md.

mod accessor;
mod animation;
mod appearance;
mod buffers;
mod container;
mod deform;
mod draco;
mod encoding;
mod fault;
mod hierarchy;
mod keyframes;
mod limit;
mod look_schema;
mod looks;
mod meshopt;
mod parts;
mod pieces;
mod scene;
mod schema;
mod sequence_writer;
mod write;
mod write_looks;

pub use animation::{Animation, MAX_DURATION_S};
pub use encoding::GlbEncoding;
pub use fault::GltfFault;
pub use sequence_writer::GlbAnimationWriter;
pub(crate) use write::write;
pub use write::write_glb_to;
