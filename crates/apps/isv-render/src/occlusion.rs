//! Darkening of creases: where the surface around a pixel comes closer than the pixel itself, less light gets in.
//!
//! Only the depth of the picture is looked at. Opposite neighbours are taken in pairs and their depths
//! averaged, so a slanted plane is not darkened. What is left measures how hollow the surface is, at a few
//! distances.

use rayon::prelude::*;

/// Depth of pixels that show no surface.
pub(crate) const NO_SURFACE: f32 = f32::NEG_INFINITY;

/// Distances looked at, in metres for a subject of 1 m.
const RADII: [f32; 4] = [0.006, 0.012, 0.024, 0.048];

/// Pairs of opposite directions.
const PAIRS: usize = 6;

/// Light lost where all around is closer by the distance looked at.
const STRENGTH: f32 = 0.9;

/// Depths of a picture's pixels, in metres, larger nearer to the camera.
pub(crate) struct DepthMap<'a> {
    pub(crate) size: [usize; 2],
    pub(crate) depths: &'a [f32],
    pub(crate) pixels_a_metre: f32,
    /// Size of the subject in metres: radii are in proportion to it.
    pub(crate) subject_m: f32,
}

impl DepthMap<'_> {
    /// The light that reaches each pixel, `1 - STRENGTH` to 1.
    pub(crate) fn light(&self) -> Vec<f32> {
        let offsets = self.offsets();
        (0..self.depths.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| self.light_at(i, &offsets))
            .collect()
    }

    /// Pixel steps to one of each pair of neighbours, and their distance in metres.
    fn offsets(&self) -> Vec<([isize; 2], f32)> {
        let directions = (0..PAIRS).map(|i| std::f32::consts::PI * i as f32 / PAIRS as f32);
        let steps = directions.flat_map(|angle| {
            RADII.map(|radius| {
                let radius_m = radius * self.subject_m;
                let radius_pixels = radius_m * self.pixels_a_metre;
                let step = [angle.cos(), angle.sin()].map(|c| (c * radius_pixels).round() as isize);
                (step, radius_m)
            })
        });
        steps.collect()
    }

    fn light_at(&self, pixel: usize, offsets: &[([isize; 2], f32)]) -> f32 {
        let here = self.depths[pixel];
        if here == NO_SURFACE {
            return 1.0;
        }
        let [x, y] = [pixel % self.size[0], pixel / self.size[0]].map(|c| c as isize);
        let shade: f32 = offsets
            .iter()
            .map(|&([dx, dy], radius_m)| {
                let rise = |depth: f32| (depth - here).clamp(-radius_m, radius_m);
                let pair = rise(self.depth(x + dx, y + dy)) + rise(self.depth(x - dx, y - dy));
                (pair / (2.0 * radius_m)).max(0.0)
            })
            .sum();
        1.0 - STRENGTH * shade / offsets.len() as f32
    }

    fn depth(&self, x: isize, y: isize) -> f32 {
        let [width, height] = self.size.map(|s| s as isize);
        if (0..width).contains(&x) && (0..height).contains(&y) {
            self.depths[(y * width + x) as usize]
        } else {
            NO_SURFACE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light_in_the_middle(depth: impl Fn(f32) -> f32) -> f32 {
        let depths: Vec<f32> = (0..101 * 101).map(|i| depth((i % 101 - 50) as f32 / 100.0)).collect();
        let map = DepthMap { size: [101, 101], depths: &depths, pixels_a_metre: 100.0, subject_m: 1.0 };
        map.light()[50 * 101 + 50]
    }

    #[test]
    fn hollows_are_darker_than_planes_and_ridges() {
        assert_eq!(light_in_the_middle(|_| 0.0), 1.0);
        assert!(light_in_the_middle(|x| 2.0 * x) > 0.999);
        assert_eq!(light_in_the_middle(|x| -x.abs()), 1.0);
        assert!(light_in_the_middle(f32::abs) < 0.8);
    }
}
