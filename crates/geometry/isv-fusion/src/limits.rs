//! Refusing what cannot be done, before it costs anything, and saying what could be.

use crate::backend::FusionBackend;
use crate::{FusionError, FusionSettings};
use isv_volume::{BlockCoord, DepthImage, FitError};
use rustc_hash::FxHashSet;
use std::cell::RefCell;

/// The images made ready, if the settings make sense, there is a reading and all are in range.
pub(crate) fn checked_views<B: FusionBackend>(
    backend: &mut B,
    images: &[DepthImage],
    settings: &FusionSettings,
) -> Result<B::Views, FusionError> {
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
    backend.views(images, settings)
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
pub(crate) fn checked_blocks<B: FusionBackend>(
    backend: &mut B,
    views: &B::Views,
    settings: &FusionSettings,
    known: &[BlockCoord],
) -> Result<Vec<BlockCoord>, FusionError> {
    let (grid, limit) = (&settings.grid, settings.max_blocks);
    if let Some(blocks) = backend.touched_blocks(views, grid, 1.0, limit)?
        && (blocks.len() + known.len() <= limit || union(&blocks, known, 1.0) <= limit)
    {
        return Ok(blocks);
    }
    let fine_m = grid.voxel_size.metres();
    let backend = RefCell::new((backend, None));
    let count = |voxel_m: f64| {
        let (scale, (backend, failure)) = (voxel_m / fine_m, &mut *backend.borrow_mut());
        if failure.is_some() {
            return None;
        }
        let blocks = backend.touched_blocks(views, grid, scale, limit).unwrap_or_else(|error| {
            *failure = Some(error);
            None
        });
        Some(union(&blocks?, known, scale)).filter(|blocks| *blocks <= limit)
    };
    let refusal = FitError::too_many_blocks(grid, limit, 0.0, count).into();
    let (_, failure) = backend.into_inner();
    Err(failure.unwrap_or(refusal))
}

/// How many blocks there are in two lists together, the second one on a grid finer by a factor.
fn union(blocks: &[BlockCoord], known: &[BlockCoord], scale: f64) -> usize {
    let coarse = |block: &BlockCoord| {
        BlockCoord::from(block.to_array().map(|c| (f64::from(c) / scale).floor() as i32))
    };
    blocks.iter().copied().chain(known.iter().map(coarse)).collect::<FxHashSet<_>>().len()
}
