//! What both profiles share: how far a decoded surface is from the source's, and the writing side of block sets and masks.

mod distortion;
pub(crate) mod surface_distance;
pub mod syntax;

pub use distortion::surface_rms_voxels;
pub use surface_distance::surface_distance_voxels;
