//! Volumes as files: a folder of NumPy arrays. `docs/formats/volume.md` describes it.

mod dense;
mod description;
mod error;
mod fill;
mod npy;
mod read;
mod sequence;
mod vdb;
mod write;

pub use dense::{DenseAxes, DenseOptions, SampleAt};
pub use error::{ArrayFlaw, VolumeError};
pub use fill::fill_unobserved;
pub use read::{read_volume, volume_grid};
pub use sequence::{VolumeSequence, is_volume_folder};
pub use vdb::{write_vdb, write_vdb_placed, write_vdb_to};
pub use write::{write_volume, write_volume_colours};

/// Block coordinates: integers `(n, 3)`, in the order x, y, z.
const COORDS: &str = "coords.npy";
/// Signed distances: floats `(n, edge, edge, edge)`, in the order z, y, x.
const TSDF: &str = "tsdf.npy";
/// Weights, in the shape of the distances; 0 is unobserved.
const WEIGHT: &str = "weight.npy";
/// Places of colour samples in metres: floats `(m, 3)`, in the order x, y, z.
const COLOUR_POSITION: &str = "colour_position.npy";
/// Unit normals of the surface there.
const COLOUR_NORMAL: &str = "colour_normal.npy";
/// sRGB of these samples: bytes `(m, 3)`.
const COLOUR_RGB: &str = "colour_rgb.npy";
/// Voxel size, truncation and unit.
const DESCRIPTION: &str = "grid.json";
