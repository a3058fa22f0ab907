//! Planes fitted to the pixels of a depth image.
//!
//! The inverse of depth is affine over the image where the surface is a plane. The error of a triangulating
//! sensor is the same everywhere in it. So each pixel gets the plane through the inverse depths of those
//! pixels around it that lie on the same surface, by least squares.

use crate::FusionSettings;
use isv_kernels::simd::vectorized;
use isv_volume::DepthImage;
use rayon::prelude::*;

/// The inverse depth around a pixel, in 1/m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PlaneFit {
    /// At the pixel; 0 where there is no reading.
    pub(crate) inverse_depth: f32,
    /// What a pixel to the right and a pixel down add.
    pub(crate) gradient: [f32; 2],
    /// 0 to 1: how much of the surroundings is of the same surface.
    pub(crate) support: f32,
}

/// Shares of the surrounding pixels on the same surface at which a pixel begins to count, and counts in full. At a
/// straight edge the share is a little over one half.
const SUPPORT: [f32; 2] = [0.35, 0.75];

/// Tangents of the slant that a surface may have against what is expected of it. The first fit expects it to
/// face the camera. The second follows the first and leaves room for curvature alone.
const SLANTS: [f32; 2] = [2.75, 0.3];

/// Radius of the largest square of pixels that a plane is fitted to: 7 x 7.
const MOST_RADIUS: usize = 3;

/// Determinant of the pixels' positions below which they lie as good as in one line.
const LEAST_SPREAD: f32 = 0.05;

/// Fits all pixels of an image, row after row.
pub(crate) fn fit_planes(image: &DepthImage, settings: &FusionSettings) -> Vec<PlaneFit> {
    let width = image.intrinsics().width as usize;
    let focal = image.intrinsics().focal.min_element() as f32;
    let padded = PaddedImage::new(image, settings);
    let mut fits = vec![PlaneFit::default(); image.intrinsics().pixels()];
    fits.par_chunks_mut(width).enumerate().for_each_init(
        || RowFit::new(width),
        |row_fit, (row, fits)| {
            row_fit.start(&padded, row);
            for slant in SLANTS {
                let tolerance = Tolerance { noise: settings.noise as f32, slant: slant / focal };
                vectorized(
                    #[inline(always)]
                    || row_fit.gather(&padded, row, tolerance),
                );
                row_fit.solve();
            }
            row_fit.finish(&padded, row, fits);
        },
    );
    fits
}

/// Radius of the square of pixels that a plane is fitted to, from 1 to 3. It is the number of pixels to a
/// voxel at the median depth of an image. What is finer than a voxel is noise.
#[must_use]
pub fn fit_radius(image: &DepthImage, settings: &FusionSettings) -> usize {
    let mut depths: Vec<f32> = image.depths_m().iter().copied().filter(|depth| *depth > 0.0).collect();
    if depths.is_empty() {
        return 1;
    }
    let middle = depths.len() / 2;
    let (_, median, _) = depths.select_nth_unstable_by(middle, f32::total_cmp);
    let voxel_m = settings.grid.voxel_size.metres();
    let pixels = voxel_m * image.intrinsics().focal.min_element() / f64::from(*median);
    (pixels.round() as usize).clamp(1, MOST_RADIUS)
}

/// Inverse depths in 1/m, 0 where there is no reading, with a margin of no readings all around.
struct PaddedImage {
    radius: usize,
    stride: usize,
    inverse: Vec<f32>,
}

impl PaddedImage {
    fn new(image: &DepthImage, settings: &FusionSettings) -> Self {
        let width = image.intrinsics().width as usize;
        let radius = fit_radius(image, settings);
        let stride = width + 2 * radius;
        let mut inverse = vec![0.0; stride * (image.intrinsics().height as usize + 2 * radius)];
        let rows = inverse[radius * stride..].chunks_exact_mut(stride);
        for (to, from) in rows.zip(image.depths_m().chunks_exact(width)) {
            for (to, depth) in to[radius..].iter_mut().zip(from) {
                let used = *depth > 0.0 && f64::from(*depth) <= settings.max_depth_m;
                *to = if used { 1.0 / depth } else { 0.0 };
            }
        }
        Self { radius, stride, inverse }
    }

    /// The inverse depths `dx` and `dy` beside those of a row; as many as the row has pixels.
    #[inline(always)]
    fn beside(&self, row: usize, dx: isize, dy: isize) -> &[f32] {
        let radius = self.radius as isize;
        let start = (row as isize + radius + dy) as usize * self.stride + (radius + dx) as usize;
        &self.inverse[start..start + self.stride - 2 * self.radius]
    }
}

/// How far an inverse depth may be from the expected: the sensor's noise, and a slant for each pixel of distance.
#[derive(Clone, Copy)]
struct Tolerance {
    noise: f32,
    slant: f32,
}

/// Sums over the pixels around each pixel of a row, and the planes that follow from them.
struct RowFit {
    /// What is expected at the pixel, and its gradient.
    expected: [Vec<f32>; 3],
    /// Sums of 1, x, y, x^2, x y, y^2, r, x r, y r over pixels at (x, y). The inverse depth of such a pixel
    /// is r more than expected at the centre.
    sums: [Vec<f32>; 9],
    /// Pixels around a pixel.
    taps: f32,
}

impl RowFit {
    fn new(width: usize) -> Self {
        Self { expected: [0; 3].map(|_| vec![0.0; width]), sums: [0; 9].map(|_| vec![0.0; width]), taps: 0.0 }
    }

    /// Expects surfaces that face the camera.
    fn start(&mut self, padded: &PaddedImage, row: usize) {
        self.expected[0].copy_from_slice(padded.beside(row, 0, 0));
        self.expected[1].fill(0.0);
        self.expected[2].fill(0.0);
        self.taps = ((2 * padded.radius + 1) as f32).powi(2);
    }

    /// Adds up the pixels that are as expected.
    #[inline(always)]
    fn gather(&mut self, padded: &PaddedImage, row: usize, tolerance: Tolerance) {
        self.sums.iter_mut().for_each(|sum| sum.fill(0.0));
        let radius = padded.radius as isize;
        let centre = padded.beside(row, 0, 0);
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                self.add(centre, padded.beside(row, dx, dy), [dx as f32, dy as f32], tolerance);
            }
        }
    }

    /// Adds the pixel at one offset to the sums of all pixels of the row.
    #[inline(always)]
    fn add(&mut self, centre: &[f32], beside: &[f32], [x, y]: [f32; 2], tolerance: Tolerance) {
        let n = centre.len();
        let [inverse, across, down] = self.expected.each_ref().map(|e| &e[..n]);
        let [one, sx, sy, xx, xy, yy, sr, xr, yr] = self.sums.each_mut().map(|s| &mut s[..n]);
        let slant = tolerance.slant * (x * x + y * y).sqrt();
        for i in 0..n {
            let r = beside[i] - inverse[i];
            let off = r - (across[i] * x + down[i] * y);
            let same = (beside[i] > 0.0) & (off.abs() <= tolerance.noise + slant * centre[i]);
            let w = if same { 1.0 } else { 0.0 };
            let r = w * r;
            one[i] += w;
            sx[i] += w * x;
            sy[i] += w * y;
            xx[i] += w * (x * x);
            xy[i] += w * (x * y);
            yy[i] += w * (y * y);
            sr[i] += r;
            xr[i] += r * x;
            yr[i] += r * y;
        }
    }

    /// The planes of least squares become what is expected.
    fn solve(&mut self) {
        let [one, sx, sy, xx, xy, yy, sr, xr, yr] = &self.sums;
        for i in 0..one.len() {
            let n = one[i].max(1.0);
            let (mx, my, mr) = (sx[i] / n, sy[i] / n, sr[i] / n);
            let (cxx, cxy, cyy) = (xx[i] / n - mx * mx, xy[i] / n - mx * my, yy[i] / n - my * my);
            let (cxr, cyr) = (xr[i] / n - mx * mr, yr[i] / n - my * mr);
            let determinant = cxx * cyy - cxy * cxy;
            // Pixels in one line say nothing about the slant across it.
            let (gx, gy) = if determinant > LEAST_SPREAD {
                ((cyy * cxr - cxy * cyr) / determinant, (cxx * cyr - cxy * cxr) / determinant)
            } else {
                (0.0, 0.0)
            };
            self.expected[0][i] += mr - gx * mx - gy * my;
            self.expected[1][i] = gx;
            self.expected[2][i] = gy;
        }
    }

    /// Hands out the fits of the pixels that have a reading.
    fn finish(&self, padded: &PaddedImage, row: usize, fits: &mut [PlaneFit]) {
        let centre = padded.beside(row, 0, 0);
        for (i, fit) in fits.iter_mut().enumerate().filter(|(i, _)| centre[*i] > 0.0) {
            let share = self.sums[0][i] / self.taps;
            *fit = PlaneFit {
                inverse_depth: self.expected[0][i],
                gradient: [self.expected[1][i], self.expected[2][i]],
                support: ((share - SUPPORT[0]) / (SUPPORT[1] - SUPPORT[0])).clamp(0.0, 1.0),
            };
        }
    }
}
