//! Depth images on a GPU: a plane for each pixel.

use super::GpuFusion;
use crate::commands::Commands;
use crate::storage::{GrowingBuffer, Usage, write};
use crate::{Gpu, GpuError, Storage};
use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use isv_fusion::FusionSettings;
use isv_fusion::backend::fit_radius;
use isv_volume::{DepthImage, Intrinsics};
use std::ops::Range;

/// Bytes of a `Surfel` of `fusion_view.wgsl`.
const SURFEL_BYTES: u64 = 32;
/// Pixels of a strip at most: their rays, up to hundreds a pixel where voxels are small, are counted in 32 bits.
const STRIP_PIXELS: u64 = 1 << 22;
/// Tangents of the slant that a surface may have against what is expected of it. One is for the first fit, the other for the
/// second, as in `isv-fusion`.
const SLANTS: [f32; 2] = [2.75, 0.3];

/// The images of one instant on a GPU, a plane for each pixel.
#[derive(Debug)]
pub struct GpuViews {
    pub(super) batches: Vec<Batch>,
}

/// Strips whose surfels a kernel sees at once.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) strips: Vec<Strip>,
    /// The strips as kernels see them, their centres in voxels.
    pub(super) views: Storage,
    pub(super) surfels: Storage,
}

/// Some rows of an image.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    intrinsics: Intrinsics,
    /// World to camera.
    rotation: DMat3,
    /// Centre of the camera, in voxels.
    centre: DVec3,
    rows: Range<u32>,
    /// Index of its first surfel in those of its batch.
    surfels: u32,
}

/// `View` of `fusion_view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ViewWords {
    x_axis: [f32; 3],
    width: u32,
    y_axis: [f32; 3],
    first_row: u32,
    z_axis: [f32; 3],
    rows: u32,
    focal: [f32; 2],
    principal: [f32; 2],
    centre: [i32; 3],
    surfels: u32,
    rest: [f32; 3],
    padding: u32,
}

/// Memory that serves one image after the other.
#[derive(Debug)]
pub(super) struct ViewBuffers {
    inverse_depths: GrowingBuffer,
}

impl Default for ViewBuffers {
    fn default() -> Self {
        Self { inverse_depths: GrowingBuffer::new("depth images") }
    }
}

impl Strip {
    pub(super) fn pixels(&self) -> u32 {
        self.intrinsics.width * self.rows.len() as u32
    }

    /// The strip as kernels see it, its camera's centre in units of so many voxels.
    pub(super) fn words(&self, unit: f64) -> ViewWords {
        let axis = |axis: DVec3| axis.as_vec3().to_array();
        let centre = self.centre / unit;
        // Whole units apart, or voxels far from the origin would be off by as much as `f32` is there.
        let whole = centre.floor();
        ViewWords {
            x_axis: axis(self.rotation.x_axis),
            width: self.intrinsics.width,
            y_axis: axis(self.rotation.y_axis),
            first_row: self.rows.start,
            z_axis: axis(self.rotation.z_axis),
            rows: self.rows.len() as u32,
            focal: self.intrinsics.focal.as_vec2().to_array(),
            principal: self.intrinsics.principal.as_vec2().to_array(),
            centre: whole.as_ivec3().to_array(),
            surfels: self.surfels,
            rest: axis(centre - whole),
            padding: 0,
        }
    }
}

impl GpuFusion {
    /// Fits planes to all pixels of some images.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if a row of an image is more than a kernel sees, and what goes wrong on the GPU.
    pub(super) fn fit_planes(
        &mut self,
        images: &[DepthImage],
        settings: &FusionSettings,
    ) -> Result<GpuViews, GpuError> {
        let radii: Vec<_> = images.iter().map(|image| fit_radius(image, settings) as u32).collect();
        let mut batches = Vec::new();
        for strips in strips(&self.gpu, images, settings)?.chunk_by(|a, b| a.1.surfels < b.1.surfels) {
            let pixels: u64 = strips.iter().map(|(_, strip)| u64::from(strip.pixels())).sum();
            let surfels = self.gpu.storage("surfels", SURFEL_BYTES * pixels, Usage::Kernels)?;
            for (image, strip) in strips {
                self.fit_strip(&images[*image], strip, radii[*image], settings, &surfels)?;
            }
            let strips: Vec<_> = strips.iter().map(|(_, strip)| strip.clone()).collect();
            let words: Vec<_> = strips.iter().map(|strip| strip.words(1.0)).collect();
            let views = self.gpu.storage("views", size_of_val(&words[..]) as u64, Usage::Kernels)?;
            write(&self.gpu, &views, 0, bytemuck::cast_slice(&words));
            batches.push(Batch { strips, views, surfels });
        }
        Ok(GpuViews { batches })
    }

    /// Fits planes to the pixels of a strip.
    fn fit_strip(
        &mut self,
        image: &DepthImage,
        strip: &Strip,
        radius: u32,
        settings: &FusionSettings,
        surfels: &Storage,
    ) -> Result<(), GpuError> {
        let Intrinsics { width, height, focal, .. } = strip.intrinsics;
        let reached = strip.rows.start.saturating_sub(radius)..(strip.rows.end + radius).min(height);
        let depths = &image.depths_m()[(reached.start * width) as usize..(reached.end * width) as usize];
        let used = |depth: f32| depth > 0.0 && f64::from(depth) <= settings.max_depth_m;
        let inverse = depths.iter().map(|depth| if used(*depth) { 1.0 / depth } else { 0.0 });
        let inverse: Vec<f32> = inverse.collect();
        let inverse = self.view_buffers.inverse_depths.holding(&self.gpu, &inverse)?;
        let [first, second] = SLANTS.map(|slant| slant / focal.min_element() as f32);
        let mut words = bytemuck::cast_slice(&[strip.words(1.0)]).to_vec();
        words.extend([radius, strip.rows.start - reached.start, reached.len() as u32]);
        let truncation = settings.grid.truncation.voxels() as f32;
        let voxel_m = settings.grid.voxel_size.metres() as f32;
        words.extend([settings.noise as f32, first, second, truncation, voxel_m].map(f32::to_bits));
        let mut commands = Commands::new(&self.gpu);
        let groups = strip.pixels().div_ceil(64);
        commands.run(&self.kernels.planes, None, &words, &[inverse, surfels], groups)?;
        commands.submit()
    }
}

/// Images cut into strips that a kernel can see, each with the number of its image. Where a batch begins, so do surfels anew.
fn strips(
    gpu: &Gpu,
    images: &[DepthImage],
    settings: &FusionSettings,
) -> Result<Vec<(usize, Strip)>, GpuError> {
    let most = (gpu.binding_bytes() / SURFEL_BYTES).min(STRIP_PIXELS);
    let (mut strips, mut taken) = (Vec::new(), 0);
    for (number, image) in images.iter().enumerate() {
        let intrinsics = *image.intrinsics();
        let width = u64::from(intrinsics.width);
        if width > most {
            let (bytes, limit) = (SURFEL_BYTES * width, SURFEL_BYTES * most);
            return Err(GpuError::TooLarge { what: "a row of a depth image", bytes, limit });
        }
        let rows_at_once = (most / width).min(u64::from(intrinsics.height)) as u32;
        for first in (0..intrinsics.height).step_by(rows_at_once as usize) {
            let rows = first..first.saturating_add(rows_at_once).min(intrinsics.height);
            let pixels = width * rows.len() as u64;
            if SURFEL_BYTES * (taken + pixels) > gpu.binding_bytes() {
                taken = 0;
            }
            let strip = Strip {
                intrinsics,
                rotation: image.pose().rotation.transpose(),
                centre: image.pose().centre / settings.grid.voxel_size.metres(),
                rows,
                surfels: taken as u32,
            };
            strips.push((number, strip));
            taken += pixels;
        }
    }
    Ok(strips)
}
