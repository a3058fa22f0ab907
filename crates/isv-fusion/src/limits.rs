//! Refusing what cannot be done, before it costs anything, and saying what could be.

use crate::allocation::{OverLimit, touched_blocks};
use crate::view::View;
use crate::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, COORD_LIMIT, DepthImage, VoxelSize};
use rustc_hash::FxHashSet;

/// The images made ready, if the settings make sense, there is a reading and all are in range.
pub(crate) fn checked_views(
    images: &[DepthImage],
    settings: &FusionSettings,
) -> Result<Vec<View>, FusionError> {
    let FusionSettings { max_depth_m, noise, .. } = *settings;
    if max_depth_m.is_nan() || max_depth_m <= 0.0 {
        let (name, range) = ("largest depth in metres", "above 0");
        return Err(FusionError::Setting { name, value: max_depth_m, range });
    }
    if !(noise.is_finite() && noise >= 0.0) {
        let (name, range) = ("noise of inverse depth in 1/m", "0 or more");
        return Err(FusionError::Setting { name, value: noise, range });
    }
    let within = |depth: &f32| *depth > 0.0 && f64::from(*depth) <= max_depth_m;
    if !images.iter().any(|image| image.depths_m().iter().any(within)) {
        let pixels = images.iter().map(|image| image.intrinsics().pixels()).sum();
        return Err(FusionError::NoReading { pixels, max_depth_m });
    }
    check_range(images, settings)?;
    Ok(images.iter().map(|image| View::new(image, settings)).collect())
}

/// Refuses images that reach beyond the range of block coordinates.
fn check_range(images: &[DepthImage], settings: &FusionSettings) -> Result<(), FusionError> {
    let grid = &settings.grid;
    let voxel_m = grid.voxel_size.metres();
    // A block is kept clear at the end of the range, so that the neighbours of all blocks have coordinates.
    let limit_voxels = f64::from(COORD_LIMIT - 1) * grid.edge.voxels() as f64;
    let band_voxels = f64::from(grid.truncation.voxels());
    let farthest = images.iter().map(|image| farthest(image, settings.max_depth_m)).fold(0.0, f64::max);
    if farthest / voxel_m + band_voxels <= limit_voxels {
        return Ok(());
    }
    Err(FusionError::OutOfRange {
        reach_m: farthest + band_voxels * voxel_m,
        limit_m: limit_voxels * voxel_m,
        voxel_m,
        voxel_that_fits_m: round_up(farthest / (limit_voxels - band_voxels)),
    })
}

/// A bound on the coordinates, in metres, of all that an image shows: its camera's, and the corners of the image at the
/// largest depth.
fn farthest(image: &DepthImage, max_depth_m: f64) -> f64 {
    let lens = image.intrinsics();
    let depths = image.depths_m().iter().map(|depth| f64::from(*depth)).filter(|depth| *depth <= max_depth_m);
    let deepest = depths.fold(0.0, f64::max);
    let size = glam::DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let corner = lens.principal.abs().max((size - lens.principal).abs()) / lens.focal;
    image.pose().centre.abs().max_element() + deepest * corner.extend(1.0).length()
}

/// The blocks that the views touch, in Morton order, if together with those known before they stay within the limit.
pub(crate) fn checked_blocks(
    views: &[View],
    settings: &FusionSettings,
    known: &[BlockCoord],
) -> Result<Vec<BlockCoord>, FusionError> {
    let limit = settings.max_blocks;
    if let Ok(blocks) = touched_blocks(views, &settings.grid, 1.0, limit)
        && (blocks.len() + known.len() <= limit || union(&blocks, known, 1.0) <= limit)
    {
        return Ok(blocks);
    }
    let count = |scale: f64| {
        let blocks = touched_blocks(views, &settings.grid, scale, limit).map_err(|OverLimit| ()).ok()?;
        Some(union(&blocks, known, scale)).filter(|blocks| *blocks <= limit)
    };
    let voxel_m = settings.grid.voxel_size.metres();
    let (blocks, fits_m) = voxel_that_fits(voxel_m, |fits_m| count(fits_m / voxel_m));
    // The number of blocks goes with the inverse square of their edge.
    let blocks = (blocks.max(1) as f64 * (fits_m / voxel_m).powi(2)).max(limit as f64 + 1.0) as u64;
    let edge = settings.grid.edge;
    Err(FusionError::TooManyBlocks { blocks, edge, limit, voxel_m, voxel_that_fits_m: fits_m })
}

/// How many blocks there are in two lists together, the second one on a grid finer by a factor.
fn union(blocks: &[BlockCoord], known: &[BlockCoord], scale: f64) -> usize {
    let coarse = |block: &BlockCoord| {
        BlockCoord::from(block.to_array().map(|c| (f64::from(c) / scale).floor() as i32))
    };
    blocks.iter().copied().chain(known.iter().map(coarse)).collect::<FxHashSet<_>>().len()
}

/// A voxel size not much larger than needed, and the number of blocks there. `count` gives nothing above the limit.
fn voxel_that_fits(voxel_m: f64, count: impl Fn(f64) -> Option<usize>) -> (usize, f64) {
    let largest = *VoxelSize::RANGE_NM.end() as f64 * 1e-9;
    let (mut too_fine, mut fits, mut blocks) = (voxel_m, voxel_m, None);
    while blocks.is_none() && fits < largest {
        too_fine = fits;
        fits = (2.0 * fits).min(largest);
        blocks = count(fits);
    }
    // Two halvings of the ratio leave at most a fifth to gain.
    for _ in 0..2 {
        let middle = round_up((too_fine * fits).sqrt());
        match count(middle) {
            Some(n) if middle < fits => (fits, blocks) = (middle, Some(n)),
            _ => too_fine = middle,
        }
    }
    (blocks.unwrap_or(0), fits)
}

/// Rounded up to two significant digits.
fn round_up(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32 - 1);
    let digits = (value / unit).ceil();
    // Dividing by the inverse gives the double closest to the decimal number where the unit is below one.
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit }
}
