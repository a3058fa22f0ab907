//! How far one surface is from another, in place and in colour.
//!
//! [`compare`] measures a test shape, a mesh or points, against a reference and returns every figure at once.
//! The measures behind it are public for point sets and meshes of other origin. [`compare_colours`] does the
//! same for colours. Lengths are metres, except where a name ends in `_mm`. All sampling is seeded: same
//! input, same figures, whatever the number of threads. This crate reads no files.
//!
//! ```
//! use glam::DVec3;
//! use isv_metrics::{CompareOptions, compare};
//! use isv_volume::TriangleMesh;
//!
//! let square = |z: f64| TriangleMesh {
//!     vertices: [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]].map(DVec3::from).to_vec(),
//!     normals: Vec::new(),
//!     appearance: None,
//!     triangles: vec![[0, 1, 2], [0, 2, 3]],
//! };
//! let error = compare(&square(0.0), &square(0.002), &CompareOptions::default())?;
//! assert!((error.p2s_mean_mm.expect("both are surfaces") - 2.0).abs() < 1e-9);
//! assert!(error.chamfer_mm > 2.0, "nearest samples do not lie straight opposite");
//! # Ok::<(), isv_metrics::CompareError>(())
//! ```

mod chamfer;
mod colour;
mod colour_error;
mod compare;
mod components;
mod geometry_error;
mod mean;
mod normals;
mod point_set;
mod point_to_point;
mod point_to_surface;
mod sampling;
mod shape;
mod side;

pub use chamfer::{chamfer, chamfer_floor};
pub use colour::{MAX_COLOUR_PSNR_DB, ViewErrors, compare_colours, compare_views};
pub use colour_error::{ColourError, colour_summary};
pub use compare::{CompareError, CompareOptions, MAX_SAMPLES, Side, compare};
pub use components::connected_components;
pub use geometry_error::{GeometryError, summary};
pub use isv_volume::SplitMix64;
pub use point_to_point::MAX_PSNR_DB;
pub use point_to_surface::{DirectedDistances, SurfaceDistances, distances_to_surface};
pub use sampling::{SurfaceSample, sample_surface};
pub use shape::Shape;
