//! The project's own animated figure: a dancer, modelled in code, for demonstrations and tests that need a moving person
//! but no captured data.
//!
//! She is about 1.75 m tall, stands on the plane y = 0 (y up, metres) and faces +z. Her dance repeats every
//! [`PERIOD_S`] seconds. As in a real capture each frame is polygonised anew: its vertices and triangles have nothing to do
//! with those of the next.
//!
//! ```
//! use isv_figure::{PERIOD_S, figure_mesh};
//! use isv_volume::VoxelSize;
//!
//! let mesh = figure_mesh(0.25 * PERIOD_S, VoxelSize::from_metres(0.012)?);
//! assert!(mesh.triangles.len() > 10_000);
//! # Ok::<(), isv_volume::GridError>(())
//! ```
//!
//! From a time to a mesh: `motion` gives joint angles, and `skeleton` solves where the bones are. `body`, `head` and
//! `clothes` put `shape`s on them like clay, each with its `paint`. `clay` joins them into one distance field, and `sampling`
//! evaluates that near its zero.

mod body;
mod clay;
mod clothes;
mod head;
mod motion;
mod paint;
mod sampling;
mod shape;
mod skeleton;

use clay::Clay;
use glam::DVec3;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{Appearance, SparseVolume, TriangleMesh, VoxelSize};
use rayon::prelude::*;
use skeleton::Skeleton;
use std::sync::Arc;

pub use motion::PERIOD_S;

/// Smallest and largest corner, in metres, of a box that holds the figure at all times: what a camera should show.
pub const BOUNDS_M: (DVec3, DVec3) = (DVec3::new(-0.78, 0.0, -0.42), DVec3::new(0.78, 1.92, 0.62));

/// The figure's surface at a time, with normals; about 6 mm is a good voxel size, and above 15 mm her fingers go.
///
/// Equal arguments give equal meshes, with any number of threads. Between platforms, whose sines differ, they may vary
/// in the last digits.
#[must_use]
pub fn figure_mesh(time_s: f64, voxel_size: VoxelSize) -> TriangleMesh {
    extract_surface(&figure_volume(time_s, voxel_size), &SurfaceOptions { normals: true })
}

/// The figure's surface at a time as [`figure_mesh`] has it, with the colours of her skin, hair and clothes at its vertices.
#[must_use]
pub fn painted_figure_mesh(time_s: f64, voxel_size: VoxelSize) -> TriangleMesh {
    let mut mesh = figure_mesh(time_s, voxel_size);
    let clay = model(time_s);
    let colours = mesh.vertices.par_iter().map(|vertex| clay.colour(vertex.as_vec3())).collect();
    mesh.appearance = Some(Arc::new(Appearance { vertex_colours: colours, ..Appearance::default() }));
    mesh
}

/// The figure at a time as the volume that [`figure_mesh`] is taken from: signed distances, good near the surface only.
#[must_use]
pub fn figure_volume(time_s: f64, voxel_size: VoxelSize) -> SparseVolume {
    sampling::sample(&model(time_s), voxel_size)
}

/// The figure in clay at a time.
fn model(time_s: f64) -> Clay {
    let skeleton = Skeleton::at(time_s);
    let mut clay = Clay::default();
    body::add(&mut clay, &skeleton);
    head::add(&mut clay, &skeleton.head);
    clothes::add(&mut clay, &skeleton);
    clay
}
