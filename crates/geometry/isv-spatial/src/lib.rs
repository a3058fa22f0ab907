//! Spatial queries: closest point, first point on a ray and generalized winding number of triangle meshes, nearest neighbours in point sets. Helpers weld
//! vertices and join them into sets.
//!
//! All queries on meshes stand on one bounding-volume hierarchy and copy the triangles into its order, so a query object
//! borrows nothing. Triangles may be degenerate, duplicated or non-manifold; nothing here asks for a closed surface.
//! All arithmetic is `f64`, and every result is the same for any number of threads.
//!
//! ```
//! use glam::DVec3;
//! use isv_spatial::{Bvh, Feature, WindingNumber};
//! use isv_volume::TriangleMesh;
//!
//! let mesh = TriangleMesh {
//!     vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
//!     normals: Vec::new(),
//!     appearance: None,
//!     triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
//! };
//! let closest = Bvh::new(&mesh).closest_point(DVec3::new(0.2, 0.2, -0.5));
//! assert_eq!((closest.triangle, closest.feature), (0, Feature::Face));
//! assert!((closest.distance_sq - 0.25).abs() < 1e-12);
//! assert!((WindingNumber::new(&mesh).at(DVec3::splat(0.1)) - 1.0).abs() < 1e-6);
//! ```

mod bvh;
mod closest;
mod disjoint_sets;
mod expansion;
mod nearest;
mod point_tree;
mod position;
mod ray;
mod tree;
mod weld;
mod winding;

pub use bvh::{Bvh, Closest};
pub use closest::{Feature, closest_on_triangle};
pub use disjoint_sets::DisjointSets;
pub use nearest::{MAX_TIES, NearestPoints};
pub use point_tree::{Neighbour, PointTree};
pub use position::{PositionKey, PositionMap, PositionSet, position_key};
pub use ray::{Hit, Ray};
pub use weld::Weld;
pub use winding::{WindingNumber, exact_winding_number};
