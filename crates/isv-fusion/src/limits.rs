//! Refusing what cannot be done, before it costs anything, and saying what could be.

use crate::allocation::{OverLimit, touched_blocks};
use crate::view::View;
use crate::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, DepthImage, FitError};
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
    let farthest = images.iter().map(|image| farthest(image, settings.max_depth_m)).fold(0.0, f64::max);
    // A block is kept clear at the end of the range, so that the neighbours of all blocks have coordinates.
    Ok(grid.check_range(farthest, f64::from(grid.truncation.voxels()), grid.edge.voxels(), 1)?)
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
    let fine_m = settings.grid.voxel_size.metres();
    let count = |voxel_m: f64| {
        let scale = voxel_m / fine_m;
        let blocks = touched_blocks(views, &settings.grid, scale, limit).map_err(|OverLimit| ()).ok()?;
        Some(union(&blocks, known, scale)).filter(|blocks| *blocks <= limit)
    };
    Err(FitError::too_many_blocks(&settings.grid, limit, 0.0, count).into())
}

/// How many blocks there are in two lists together, the second one on a grid finer by a factor.
fn union(blocks: &[BlockCoord], known: &[BlockCoord], scale: f64) -> usize {
    let coarse = |block: &BlockCoord| {
        BlockCoord::from(block.to_array().map(|c| (f64::from(c) / scale).floor() as i32))
    };
    blocks.iter().copied().chain(known.iter().map(coarse)).collect::<FxHashSet<_>>().len()
}
