//! Files: meshes and points in and out, the frames of a sequence, output that appears whole or not at all.
//!
//! The crate does not know the `.isv` format. `isv-take` opens streams, `isv-serve` opens pages and their files.
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

mod acquisition;
mod atomic;
mod cloud_builder;
mod depth;
mod e57;
mod error;
mod format;
mod frame_stream;
mod frame_times;
mod geometry;
mod gltf;
mod image;
mod inside;
mod las;
mod linked;
mod materials;
mod natural_order;
mod obj;
mod off;
mod options;
mod output;
mod own;
mod passed_over;
mod pcd;
mod placement;
mod ply;
mod polygon;
mod raw_colours;
mod regular_file;
mod scale_check;
mod sequence;
mod stl;
mod text;
mod unit;
mod usd;
mod volume;
mod wildcard;
mod xyz;

pub use acquisition::acquisition_time_s;
pub use atomic::AtomicFile;
pub use depth::{
    ColourSequence, DepthFileError, DepthSequence, Saturation, TUM_DEPTH_SCALE_M, TUM_INTRINSICS,
    TUM_TIME_LIMIT_S, is_depth_folder,
};
pub use error::{Malformation, Position, ReadError, WriteError};
pub use format::{Format, ParseFormatError};
pub use frame_stream::{FrameStream, FrameStreamError, MAX_FRAME_BYTES};
pub use frame_times::FrameTimes;
pub use geometry::{
    Geometry, InvalidPoints, MAX_COORDINATE_M, parse_geometry, parse_geometry_as, parse_geometry_with,
    parse_mesh, read_geometry, read_geometry_as, read_geometry_with, read_mesh, write_mesh,
    write_mesh_placed, write_mesh_to, write_points, write_points_placed, write_points_to,
};
pub use gltf::{Animation, GlbAnimationWriter, GlbEncoding, GltfFault, MAX_DURATION_S, write_glb_to};
pub use image::{ImageError, ImageFault, MAX_IMAGE_PIXELS, MAX_IMAGE_SIDE, decode_image};
pub use isv_foreign::hush_foreign_panics;
pub use natural_order::{NameOrder, OrderedNames, natural_cmp};
pub use obj::write_obj_files;
pub use options::{Colours, ReadOptions};
pub use output::{
    Output, OutputError, check_file_name, check_folder_name, check_frame_output, check_not_input,
    check_overwriting, check_stream_name, check_volume_output, is_folder, is_pipe, is_same_file,
};
pub use own::was_made_by_isv;
pub use passed_over::passed_over;
pub use placement::Placement;
pub use scale_check::{ScaleCheck, ScaleError};
pub use sequence::{FrameSequence, SequenceError};
pub use unit::{ParseUnitError, Unit};
pub use usd::{UsdEncoding, UsdStage, UsdWriter};
pub use volume::{
    ArrayFlaw, DenseAxes, DenseOptions, SampleAt, VolumeError, VolumeSequence, fill_unobserved,
    is_volume_folder, read_volume, volume_grid, write_vdb, write_vdb_placed, write_vdb_to, write_volume,
    write_volume_colours,
};
