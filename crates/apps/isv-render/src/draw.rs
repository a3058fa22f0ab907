//! Whole pictures: what a camera sees, in its colours, over a background.

use crate::camera::Camera;
use crate::error_scale::ErrorScale;
use crate::occlusion::DepthMap;
use crate::picture::Picture;
use crate::raster::Raster;
use crate::style::{Background, Paint, Style};
use glam::{DVec3, Vec3};
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// Draws a mesh in the colours of the style. The same mesh, camera and style give the same picture with any number of threads.
///
/// # Panics
/// If a triangle names a vertex that is not there, or the mesh's appearance does not fit it
/// ([`TriangleMesh::validate`] tells).
#[must_use]
pub fn render(mesh: &TriangleMesh, camera: &Camera, style: &Style) -> Picture {
    let paint = Paint::new(style.shading, mesh.appearance.is_some());
    let raster = Raster::new(mesh, camera, style.normals, paint);
    blend(&raster, camera, paint, style.background)
}

/// A picture of errors, and what they are where the surface is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPicture {
    /// The picture.
    pub picture: Picture,
    /// Errors of the pixels that show the surface; none if no pixel does.
    pub seen: Option<SeenErrors>,
}

/// Errors of the surface that a picture shows, a pixel counting once. The surface that is out of sight does
/// not count, nor is what is seen at a slant weighted up. Measures of a whole surface are those of
/// `isv-metrics`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenErrors {
    /// Mean, in metres.
    pub mean_m: f64,
    /// Largest, in metres.
    pub max_m: f64,
}

/// Draws a mesh, coloured by its error: at each pixel, `error_m` of the point of the surface seen there, in metres.
///
/// Colours are those of `scale`, a little darker where the surface turns away from the camera and in creases. Both
/// sides of a face look alike. With a closure that is the same for any order of calls, the picture is the same with any
/// number of threads.
///
/// # Panics
/// If a triangle names a vertex that is not there.
#[must_use]
pub fn render_errors(
    mesh: &TriangleMesh,
    camera: &Camera,
    style: &Style,
    scale: &ErrorScale,
    error_m: impl Fn(DVec3) -> f64 + Sync,
) -> ErrorPicture {
    let paint = Paint::Form;
    let mut raster = Raster::new(mesh, camera, style.normals, paint);
    let errors: Vec<Option<f64>> =
        (0..raster.pixels.len()).into_par_iter().map(|pixel| raster.point(pixel).map(&error_m)).collect();
    for (pixel, error) in raster.pixels.iter_mut().zip(&errors) {
        if let Some(error) = error {
            pixel.colour *= Vec3::from_array(scale.colour(*error).map(|c| f32::from(c) / 255.0));
        }
    }
    let picture = blend(&raster, camera, paint, style.background);
    ErrorPicture { picture, seen: SeenErrors::from_errors(errors.into_iter().flatten()) }
}

impl SeenErrors {
    fn from_errors(errors_m: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut sum, mut max_m, mut count) = (0.0, 0f64, 0usize);
        for error in errors_m {
            sum += error;
            max_m = max_m.max(error);
            count += 1;
        }
        (count > 0).then(|| Self { mean_m: sum / count as f64, max_m })
    }
}

/// Darkens creases and lays the pixels over a background.
fn blend(raster: &Raster, camera: &Camera, paint: Paint, background: Background) -> Picture {
    let depths: Vec<f32> = raster.pixels.iter().map(|p| p.depth).collect();
    let light = DepthMap {
        size: camera.size,
        depths: &depths,
        pixels_a_metre: raster.pixels_a_metre() as f32,
        subject_m: (camera.bounds.1 - camera.bounds.0).length() as f32,
    }
    .light();
    let mut picture = Picture::filled(camera.size, background.rgba());
    for ((place, pixel), light) in picture.rgba_mut().chunks_exact_mut(4).zip(&raster.pixels).zip(light) {
        pixel.blend_over(place, 1.0 - paint.crease_strength() * (1.0 - light));
    }
    picture
}
