//! A depth image made ready: each pixel's surface as a plane in space, and how far it is to be trusted.

use crate::FusionSettings;
use crate::planes::{PlaneFit, fit_planes};
use glam::{DMat3, DVec3, Vec3};
use isv_volume::{DepthImage, Grid, Intrinsics};
use rayon::prelude::*;

/// Least cosine of the angle between a ray and the normal of the surface it meets. Surfaces seen at less than
/// 6 degrees are left out.
pub(crate) const LEAST_COSINE: f32 = 0.1;

/// Voxels from a surface, within which lie all corners of the cells that it passes through: the diagonal of a cell, rounded
/// up.
const CELL: f32 = 1.75;

/// The plane that the surface follows around a pixel, in camera coordinates with the voxel edge as unit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surfel {
    /// Unit normal, away from the camera.
    pub(crate) normal: [f32; 3],
    /// Distance of the plane from the camera's centre.
    pub(crate) distance: f32,
    /// Largest distance from the plane at which the reading says how far the surface is. It is that of a
    /// point one truncation away along the ray, and enough to draw the surface.
    pub(crate) band: f32,
    /// What the reading counts in averages; 0 where there is none.
    pub(crate) weight: f32,
    /// Largest distance at which the reading may say that the space before its surface is free; 0 near jumps.
    pub(crate) free: f32,
}

/// A camera with the surface that it saw. Lengths are in voxels.
#[derive(Debug)]
pub(crate) struct View {
    pub(crate) intrinsics: Intrinsics,
    /// World to camera.
    pub(crate) rotation: DMat3,
    pub(crate) centre: DVec3,
    /// One a pixel, row after row, and after them one that says nothing.
    pub(crate) surfels: Vec<Surfel>,
}

impl View {
    /// Fits planes to all pixels of an image.
    pub(crate) fn new(image: &DepthImage, settings: &FusionSettings) -> Self {
        let intrinsics = *image.intrinsics();
        let width = intrinsics.width as usize;
        let surfel = |(pixel, fit): (usize, &PlaneFit)| {
            let ray = ray(&intrinsics, (pixel % width) as f32, (pixel / width) as f32);
            Surfel::new(fit, ray, &intrinsics, &settings.grid).unwrap_or_default()
        };
        let fits = fit_planes(image, settings);
        let mut surfels: Vec<_> = fits.par_iter().enumerate().map(surfel).collect();
        surfels.push(Surfel::default());
        Self {
            intrinsics,
            rotation: image.pose().rotation.transpose(),
            centre: image.pose().centre / settings.grid.voxel_size.metres(),
            surfels,
        }
    }

    /// The point of a surfel's plane that falls on a place of the image; in camera coordinates.
    pub(crate) fn point(&self, surfel: &Surfel, column: f32, row: f32) -> Vec3 {
        let ray = ray(&self.intrinsics, column, row);
        ray * (surfel.distance / Vec3::from(surfel.normal).dot(ray))
    }
}

/// The direction of a place of the image, with 1 along z.
fn ray(intrinsics: &Intrinsics, column: f32, row: f32) -> Vec3 {
    let (focal, principal) = (intrinsics.focal.as_vec2(), intrinsics.principal.as_vec2());
    Vec3::new((column - principal.x) / focal.x, (row - principal.y) / focal.y, 1.0)
}

impl Surfel {
    /// Puts a fit into space. The inverse depth `i + gu (u - u0) + gv (v - v0)`, multiplied by z, is with Eq. 4 the plane
    /// `n . p = 1`.
    fn new(fit: &PlaneFit, ray: Vec3, intrinsics: &Intrinsics, grid: &Grid) -> Option<Self> {
        if fit.inverse_depth <= 0.0 || fit.support <= 0.0 {
            return None;
        }
        let focal = intrinsics.focal.as_vec2();
        let along = Vec3::new(fit.gradient[0] * focal.x, fit.gradient[1] * focal.y, 0.0);
        let normal = along + Vec3::Z * (fit.inverse_depth - along.dot(ray));
        let length = normal.length();
        let cosine = fit.inverse_depth / (length * ray.length());
        if cosine < LEAST_COSINE {
            return None;
        }
        // The noise of depth grows with its square, and so does the area that a pixel stands for.
        let weight = fit.support * (cosine * fit.inverse_depth).powi(2);
        Some(Self {
            normal: (normal / length).to_array(),
            distance: 1.0 / (length * grid.voxel_size.metres() as f32),
            band: (grid.truncation.voxels() as f32 * cosine).max(CELL),
            weight,
            free: if fit.support >= 1.0 { weight } else { 0.0 },
        })
    }

    /// Cosine of the angle between the normal and the direction of a point from the camera.
    pub(crate) fn cosine(&self, point: Vec3) -> f32 {
        Vec3::from(self.normal).dot(point) / point.length()
    }
}
