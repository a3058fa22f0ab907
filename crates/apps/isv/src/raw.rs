//! The layers below, one module each, with no promise: any of it may change in any version.
//!
//! Types of `glam` and `wgpu` are found here alone.

pub use isv_decode as decode;
#[cfg(feature = "encode")]
pub use isv_encode as encode;
pub use isv_format as format;
#[cfg(feature = "encode")]
pub use isv_fusion as fusion;
#[cfg(feature = "gpu")]
pub use isv_gpu as gpu;
#[cfg(feature = "io")]
pub use isv_ingest as ingest;
#[cfg(feature = "io")]
pub use isv_io as io;
pub use isv_kernels as kernels;
#[cfg(feature = "encode")]
pub use isv_metrics as metrics;
#[cfg(feature = "io")]
pub use isv_mp4 as mp4;
#[cfg(feature = "io")]
pub use isv_simplify as simplify;
pub use isv_surface as surface;
pub use isv_take as take;
pub use isv_volume as volume;
