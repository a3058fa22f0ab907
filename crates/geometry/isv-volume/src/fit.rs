//! What a grid can hold: refusing a surface before it costs anything, and saying at which voxel size it fits.

use crate::{BlockEdge, COORD_LIMIT, Grid, VoxelSize};
use thiserror::Error;

/// A surface that does not fit on a grid.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FitError {
    /// It needs more blocks than allowed.
    #[error(
        "the surface needs about {blocks} blocks of {edge}^3 voxels at {voxel_m} m a voxel, the limit is {limit}; \
         voxels of {voxel_that_fits_m} m fit",
        edge = edge.voxels()
    )]
    TooManyBlocks {
        /// Blocks needed, estimated from their number at the voxel size that fits.
        blocks: u64,
        /// Edge of the blocks.
        edge: BlockEdge,
        /// How many are allowed.
        limit: usize,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which the same surface stays within the limit.
        voxel_that_fits_m: f64,
    },
    /// It reaches farther from the origin than block coordinates do.
    #[error(
        "the surface reaches {reach_m} m from the origin, block coordinates end at {limit_m} m with voxels of {voxel_m} m; \
         voxels of {voxel_that_fits_m} m fit"
    )]
    OutOfRange {
        /// Largest absolute coordinate of the surface and its truncation band, in metres.
        reach_m: f64,
        /// Largest coordinate that can be addressed, in metres.
        limit_m: f64,
        /// The voxel size asked for, in metres.
        voxel_m: f64,
        /// A coarser voxel size, in metres, at which every coordinate is in range.
        voxel_that_fits_m: f64,
    },
}

impl FitError {
    /// A coarser voxel size, in metres, at which the surface fits.
    #[must_use]
    pub fn voxel_that_fits_m(&self) -> f64 {
        match self {
            Self::TooManyBlocks { voxel_that_fits_m, .. } | Self::OutOfRange { voxel_that_fits_m, .. } => {
                *voxel_that_fits_m
            }
        }
    }

    /// The error for a surface of about `area_m2` square metres, 0 if that is not known, that needs more than `limit` blocks on
    /// `grid`. `count` gives the number of blocks at a voxel size in metres, or nothing if that is above the limit.
    #[must_use]
    pub fn too_many_blocks(
        grid: &Grid,
        limit: usize,
        area_m2: f64,
        count: impl Fn(f64) -> Option<usize>,
    ) -> Self {
        let voxel_m = grid.voxel_size.metres();
        // A surface cuts about as many blocks as their faces fit on it, so with smaller voxels it is no use to count.
        let hopeless_m = (area_m2 / limit.max(1) as f64).sqrt() / grid.edge.voxels() as f64;
        let (blocks, fits_m) = voxel_that_fits(voxel_m.max(hopeless_m), count);
        // The number of blocks goes with the inverse square of their edge.
        let blocks = (blocks.max(1) as f64 * (fits_m / voxel_m).powi(2)).max(limit as f64 + 1.0) as u64;
        Self::TooManyBlocks { blocks, edge: grid.edge, limit, voxel_m, voxel_that_fits_m: fits_m }
    }
}

impl Grid {
    /// Refuses a surface that goes beyond what coordinates of cubes of `cube` voxels can address. Its largest
    /// absolute coordinate is `farthest_m` metres, and `margin` voxels are around it. The last `clear` cubes
    /// are left free.
    ///
    /// # Errors
    /// [`FitError::OutOfRange`].
    pub fn check_range(&self, farthest_m: f64, margin: f64, cube: usize, clear: i32) -> Result<(), FitError> {
        let voxel_m = self.voxel_size.metres();
        let limit_voxels = f64::from(COORD_LIMIT - clear) * cube as f64;
        if farthest_m / voxel_m + margin <= limit_voxels {
            return Ok(());
        }
        Err(FitError::OutOfRange {
            reach_m: farthest_m + margin * voxel_m,
            limit_m: limit_voxels * voxel_m,
            voxel_m,
            voxel_that_fits_m: round_up(farthest_m / (limit_voxels - margin)),
        })
    }
}

/// A voxel size not much larger than needed, and the number of blocks there. `count` gives nothing above the limit.
fn voxel_that_fits(voxel_m: f64, count: impl Fn(f64) -> Option<usize>) -> (usize, f64) {
    let largest = *VoxelSize::RANGE_NM.end() as f64 / 1e9;
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

/// A length above 0 rounded up to two significant digits, as sentences name it.
#[must_use]
pub fn round_up(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32 - 1);
    let digits = (value / unit).ceil();
    // Dividing by the inverse gives the double closest to the decimal number where the unit is below one.
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_are_kept_and_nothing_is_rounded_down() {
        for (value, rounded) in [(0.00123, 0.0013), (0.0098, 0.0098), (1.0, 1.0), (123.4, 130.0)] {
            assert_eq!(round_up(value), rounded, "{value}");
        }
    }

    #[test]
    fn the_voxel_that_fits_is_within_the_limit_and_not_much_too_large() {
        let count = |voxel_m: f64| Some((40.0 / voxel_m.powi(2)) as usize).filter(|blocks| *blocks <= 1000);
        let (blocks, fits_m) = voxel_that_fits(0.01, count);
        assert_eq!(count(fits_m), Some(blocks));
        assert!((0.2..0.25).contains(&fits_m), "{fits_m}");
    }
}
