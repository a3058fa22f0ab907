//! Resolution of depth images: the size of a pixel on the surface, and the noise of depths.

use glam::DVec3;
use isv_volume::DepthImage;

/// Pixels that are looked at in an image, at most.
const LOOKS: usize = 20_000;

/// Pixels between the readings that noise is measured from: depths in steps are often equal from pixel to pixel.
const STRIDE: u32 = 4;

/// Second differences above this share of the depth are edges, not noise.
const EDGE: f64 = 0.03;

/// Mean absolute second difference of three readings with Gaussian noise of deviation 1: the square root of 12 / pi.
const MEAN_SECOND_DIFFERENCE: f64 = 1.954_410_047_611_679_7;

/// What depth images can resolve, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthResolution {
    /// Edge of a pixel at the median depth.
    pub footprint_m: f64,
    /// Standard deviation of the noise along the depth, steps of the sensor included.
    pub noise_m: f64,
}

impl DepthResolution {
    /// Measures images of one instant; `None` if they have no reading up to `max_depth_m`.
    ///
    /// Looks at no more than 20,000 pixels of an image.
    #[must_use]
    pub fn from_images(images: &[DepthImage], max_depth_m: f64) -> Option<Self> {
        let mut footprints = Vec::new();
        let (mut sum, mut count) = (0.0, 0_u32);
        for image in images {
            let focal = image.intrinsics().focal.min_element();
            for (column, row, depth) in looks(image, max_depth_m, LOOKS) {
                footprints.push(depth / focal);
                if let Some(second) = second_difference(image, column, row, depth) {
                    sum += second;
                    count += 1;
                }
            }
        }
        if footprints.is_empty() {
            return None;
        }
        let middle = footprints.len() / 2;
        let footprint_m = *footprints.select_nth_unstable_by(middle, f64::total_cmp).1;
        Some(Self { footprint_m, noise_m: sum / f64::from(count.max(1)) / MEAN_SECOND_DIFFERENCE })
    }
}

/// Places of readings in the world, about `most` of all images together and evenly spread.
#[must_use]
pub fn sample_readings(images: &[DepthImage], max_depth_m: f64, most: usize) -> Vec<DVec3> {
    let each = most / images.len().max(1);
    let places = |image: &DepthImage| -> Vec<DVec3> {
        let place = |(column, row, depth): (u32, u32, f64)| {
            let pixel = glam::DVec2::new(f64::from(column), f64::from(row));
            image.pose().to_world(image.intrinsics().unproject(pixel, depth))
        };
        looks(image, max_depth_m, each).map(place).collect()
    };
    images.iter().flat_map(places).collect()
}

/// Column, row and depth of readings on a coarser lattice of about `most` pixels.
fn looks(image: &DepthImage, max_depth_m: f64, most: usize) -> impl Iterator<Item = (u32, u32, f64)> + '_ {
    let lens = image.intrinsics();
    let step = (lens.pixels() as f64 / most.max(1) as f64).sqrt().ceil().max(1.0) as usize;
    (0..lens.height).step_by(step).flat_map(move |row| {
        (0..lens.width).step_by(step).filter_map(move |column| {
            let depth = f64::from(image.depth_m(column, row)?);
            (depth <= max_depth_m).then_some((column, row, depth))
        })
    })
}

/// Size of the second difference of depths along the row; `None` at edges and beside missing readings.
fn second_difference(image: &DepthImage, column: u32, row: u32, depth: f64) -> Option<f64> {
    let right = column.checked_add(STRIDE).filter(|right| *right < image.intrinsics().width)?;
    let [before, after] = [image.depth_m(column.checked_sub(STRIDE)?, row)?, image.depth_m(right, row)?];
    let second = (f64::from(before) - 2.0 * depth + f64::from(after)).abs();
    (second <= EDGE * depth).then_some(second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec2};
    use isv_testkit::Random;
    use isv_volume::{CameraPose, Intrinsics};

    const LENS: Intrinsics = Intrinsics {
        width: 320,
        height: 240,
        focal: DVec2::splat(300.0),
        principal: DVec2::new(160.0, 120.0),
    };

    /// A slanted wall around 3 m away, its left part far away, with noise of a deviation.
    fn wall(noise_m: f64) -> DepthImage {
        let mut random = Random::new(3);
        let mut gauss = || (0..12).map(|_| random.signed() / 2.0).sum::<f64>() * noise_m;
        let depth = |pixel: u32| match pixel % 320 {
            0..40 => 30.0,
            column => 3.0 + 0.003 * (f64::from(column) - 180.0),
        };
        let depths = (0..LENS.pixels() as u32).map(|pixel| (depth(pixel) + gauss()) as f32).collect();
        let pose = CameraPose { rotation: DMat3::IDENTITY, centre: DVec3::new(1.0, 0.0, 0.0) };
        DepthImage::new(LENS, pose, depths).unwrap()
    }

    #[test]
    fn pixels_and_noise_are_measured() {
        for noise_m in [0.0, 0.003, 0.01] {
            let found = DepthResolution::from_images(&[wall(noise_m)], 10.0).unwrap();
            assert!((found.footprint_m - 0.01).abs() < 2e-4, "{found:?}");
            assert!((found.noise_m - noise_m).abs() < 0.1 * noise_m + 1e-6, "{found:?} for {noise_m}");
        }
    }

    #[test]
    fn what_is_too_far_away_has_no_say() {
        let wall = [wall(0.0)];
        assert_eq!(DepthResolution::from_images(&wall, 1.0), None);
        assert_eq!(DepthResolution::from_images(&[], 10.0), None);
        let places = sample_readings(&wall, 10.0, 2000);
        assert!((1000..=2000).contains(&places.len()), "{}", places.len());
        assert!(places.iter().all(|p| p.z < 4.0 && p.x > -0.5));
    }
}
