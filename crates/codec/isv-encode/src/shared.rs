//! Code that both profiles share: the distance of a decoded surface from the source, and the writing of block sets and masks.

mod distortion;
pub(crate) mod surface_distance;
pub mod syntax;

pub use distortion::surface_rms_voxels;
pub use surface_distance::surface_distance_voxels;
