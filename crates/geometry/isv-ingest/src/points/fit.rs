//! Voxel sizes that fit a cloud of points.

use crate::limits::{check_points_blocks, check_points_range};
use crate::points::bricks::BRICK;
use crate::points::distinct::Distinct;
use crate::points::sign::{SPACING_NEIGHBOURS, spacing};
use crate::points::surfels::WIDEST_SPACING;
use crate::{IngestError, PointIngest};
use isv_spatial::PointTree;
use isv_volume::PointCloud;
use rayon::prelude::*;

/// Points that are looked at, spread evenly over the cloud.
const SAMPLES: usize = 4096;

/// Distances between the points of a cloud, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointSpacing {
    /// Edge of the square that a point has for itself, in the median.
    pub median_m: f64,
    /// The edge that three of four points stay below.
    pub wide_m: f64,
}

impl PointSpacing {
    /// Measures a cloud by up to 4,096 of its points. Points that are not finite have no say.
    #[must_use]
    pub fn from_cloud(cloud: &PointCloud) -> Self {
        let positions: Vec<_> = cloud.positions.iter().copied().filter(|p| p.is_finite()).collect();
        let tree = PointTree::new(Distinct::new(&positions).positions.into_owned());
        let count = tree.points().len().min(SAMPLES);
        let points = tree.points();
        let mut spacings: Vec<f64> = (0..count)
            .into_par_iter()
            .map_init(Vec::new, |found, sample| {
                tree.k_nearest(points[sample * points.len() / count], SPACING_NEIGHBOURS + 1, found);
                spacing(found)
            })
            .collect();
        spacings.sort_unstable_by(f64::total_cmp);
        let at = |quarter: usize| spacings.get(quarter * spacings.len() / 4).copied().unwrap_or(0.0);
        Self { median_m: at(2), wide_m: at(3) }
    }

    /// Smallest voxel size, in metres, at which most points have neighbours in the next voxel. Three of four
    /// points must also be close enough to others to make a surface.
    #[must_use]
    pub fn voxel_m(&self) -> f64 {
        self.median_m.max(self.wide_m / WIDEST_SPACING)
    }
}

/// Refuses a cloud that the grid has no room for, and says which voxel size has: what [`crate::ingest_points`] refuses
/// before it begins.
///
/// # Errors
/// [`IngestError::Fit`].
pub fn check_points_fit(cloud: &PointCloud, settings: &PointIngest) -> Result<(), IngestError> {
    check_points_range(cloud, &settings.grid, settings.offset_voxels, BRICK)?;
    let width = f64::from(settings.grid.truncation.voxels()) + settings.offset_voxels;
    check_points_blocks(cloud, settings, width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use isv_testkit::Random;

    fn cloud(positions: Vec<DVec3>) -> PointCloud {
        PointCloud { positions, ..PointCloud::default() }
    }

    /// A square lattice of points.
    fn lattice(count: i32, edge_m: f64) -> Vec<DVec3> {
        (0..count * count)
            .map(|i| edge_m * DVec3::new(f64::from(i % count), f64::from(i / count), 0.0))
            .collect()
    }

    #[test]
    fn spacing_is_that_of_most_points() {
        let found = PointSpacing::from_cloud(&cloud(lattice(60, 0.084)));
        assert!((found.median_m / 0.084 - 1.0).abs() < 0.15, "{found:?}");
        // Neither points that fly far from all others nor doubled ones change that.
        let mut random = Random::new(1);
        let mut points = lattice(60, 0.084);
        points.extend((0..200).map(|_| 100.0 * random.point()));
        points.push(DVec3::NAN);
        let flying = PointSpacing::from_cloud(&cloud(points.clone()));
        assert!((flying.voxel_m() / found.voxel_m() - 1.0).abs() < 0.1, "{flying:?}");
        points.push(DVec3::ZERO);
        points.push(DVec3::ZERO);
        assert!(PointSpacing::from_cloud(&cloud(points)).median_m > 0.07);
    }

    #[test]
    fn most_of_what_gets_sparser_hangs_together() {
        // Two of five points are far apart.
        let mut points = lattice(30, 0.01);
        points.extend(lattice(25, 0.09).into_iter().map(|p| p + DVec3::Z));
        let found = PointSpacing::from_cloud(&cloud(points));
        assert!(found.median_m < 0.012 && found.voxel_m() > 0.025 && found.voxel_m() < 0.04, "{found:?}");
    }

    #[test]
    fn few_points_and_none_have_a_spacing() {
        assert_eq!(PointSpacing::from_cloud(&cloud(Vec::new())), PointSpacing::default());
        assert_eq!(PointSpacing::from_cloud(&cloud(vec![DVec3::ONE])).voxel_m(), 0.0);
        assert_eq!(PointSpacing::from_cloud(&cloud(vec![DVec3::ONE; 50])).voxel_m(), 0.0);
        assert!(PointSpacing::from_cloud(&cloud(vec![DVec3::ZERO, DVec3::X])).voxel_m() > 0.5);
    }
}
