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
use glam::{DVec3, Vec3};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{Appearance, Rgb, SparseVolume, TriangleMesh, VoxelSize};
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
///
/// Voxels of 3 mm show her face. On larger ones a texture is needed, which [`FigurePaint`] has the colours of.
#[must_use]
pub fn painted_figure_mesh(time_s: f64, voxel_size: VoxelSize) -> TriangleMesh {
    let mut mesh = figure_mesh(time_s, voxel_size);
    let paint = FigurePaint::at(time_s);
    let lit = paint.colours(&mesh.vertices).into_iter().zip(paint.light(&mesh));
    let colours = lit.map(|(colour, light)| lit_colour(colour, light)).collect();
    mesh.appearance = Some(Arc::new(Appearance { vertex_colours: colours, ..Appearance::default() }));
    mesh
}

/// Middle of the figure's head at a time (m): what a close-up shows.
#[must_use]
pub fn head_m(time_s: f64) -> DVec3 {
    Skeleton::at(time_s).head.origin.as_dvec3()
}

/// Paint of the figure at a time, and the light on her.
#[derive(Debug)]
pub struct FigurePaint {
    clay: Clay,
}

impl FigurePaint {
    /// The paint at a time (s).
    #[must_use]
    pub fn at(time_s: f64) -> Self {
        Self { clay: model(time_s) }
    }

    /// Colours at points of the surface (m), without light. Points that follow each other had better lie near each other.
    #[must_use]
    pub fn colours(&self, points: &[DVec3]) -> Vec<Rgb> {
        self.clay.colours(&to_f32(points))
    }

    /// Light at the vertices of a mesh with normals: soft, from above, about 1 in the open and less in folds.
    #[must_use]
    pub fn light(&self, mesh: &TriangleMesh) -> Vec<f32> {
        self.clay.light(&to_f32(&mesh.vertices), &to_f32(&mesh.normals))
    }
}

/// A colour in light.
#[must_use]
pub fn lit_colour(colour: Rgb, light: f32) -> Rgb {
    colour.map(|c| (f32::from(c) * light).round().min(255.0) as u8)
}

fn to_f32(points: &[DVec3]) -> Vec<Vec3> {
    points.iter().map(|point| point.as_vec3()).collect()
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
