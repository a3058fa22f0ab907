//! Files: meshes in and out, the frames of a sequence, output that appears whole or not at all.
//!
//! The only library of isv that knows paths. It does not know what is done with a mesh, nor the `.isv` format.
//!
//! ```
//! use isv_io::{FrameSequence, Format, Unit, read_mesh, write_mesh};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let frame = folder.path().join("frame_0.obj");
//! # std::fs::write(&frame, "v 0 0 0\nv 100 0 0\nv 0 100 0\nf 1 2 3\n")?;
//! # let input = folder.path().to_str().unwrap();
//! let frames = FrameSequence::open(input)?;
//! for path in frames.paths() {
//!     let mesh = read_mesh(path, Unit::Centimetre)?;
//!     assert_eq!(mesh.vertices[1].x, 1.0);
//!     write_mesh(&path.with_extension("ply"), &mesh, Format::Ply)?;
//! }
//! # Ok(())
//! # }
//! ```

mod atomic;
mod depth;
mod error;
mod format;
mod mesh_file;
mod natural_order;
mod obj;
mod ply;
mod polygon;
mod scale_check;
mod sequence;
mod unit;
mod wildcard;

pub use atomic::AtomicFile;
pub use depth::{
    DepthFileError, DepthSequence, TUM_DEPTH_SCALE_M, TUM_INTRINSICS, TUM_TIME_LIMIT_S, is_depth_folder,
};
pub use error::{Malformation, Position, ReadError, WriteError};
pub use format::{Format, ParseFormatError};
pub use mesh_file::{MAX_COORDINATE_M, parse_mesh, read_mesh, write_mesh, write_mesh_to};
pub use natural_order::natural_cmp;
pub use scale_check::{SCALE_JUMP, ScaleCheck, ScaleError};
pub use sequence::{FrameSequence, SequenceError};
pub use unit::{ParseUnitError, Unit};
