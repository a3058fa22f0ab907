//! Frames of one sequence must share a unit.

use crate::Geometry;
use glam::DVec3;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Ratios between units that people mix up: metres, decimetres, centimetres, millimetres, inches and feet. Smaller ratios are left to
/// the figures: they grow and shrink.
const UNIT_RATIOS: [f64; 6] = [10.0, 25.4, 39.37, 100.0, 304.8, 1000.0];

/// How far a ratio of sizes may be from a ratio of units, as a share of it: a body moves between two frames.
const RATIO_TOLERANCE: f64 = 0.12;

/// Frames whose sizes differ by less share a unit, whatever lies between them.
const SAME_UNIT: f64 = 3.0;

/// Vertices or points that are looked at, evenly over the frame.
const LOOKED_AT: usize = 2000;

/// Sizes of earlier frames that are kept.
const KEPT: usize = 64;

/// A frame that is an earlier one's shape in another unit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "{}: this frame is {size_m:.4} m across but the one before, {}, is {before_size_m:.4} m, and of the same shape: all frames need one \
     common unit; convert them to one and name it with --units, or give --mixed-scales if this is right",
    path.display(), before_path.display()
)]
pub struct ScaleError {
    /// The frame.
    pub path: PathBuf,
    /// Extent of the bulk of its surface, in metres.
    pub size_m: f64,
    /// The frame before it.
    pub before_path: PathBuf,
    /// Extent of the bulk of its surface, in metres.
    pub before_size_m: f64,
}

/// Looks whether frames share a unit.
///
/// A frame is refused if it looks like the one before in another unit. Its three extents, its place and
/// nothing else then differ by the ratio of two units, and no earlier frame had its size. Extents are those
/// of the bulk of the surface, so that stray points count for nothing. What enters, leaves, spreads or
/// collapses may become any size.
#[derive(Clone, Debug, Default)]
pub struct ScaleCheck {
    before: Option<(PathBuf, Bulk)>,
    /// Sizes of earlier frames.
    sizes: Vec<f64>,
    /// Size of a frame that was refused: where a second one agrees, the odd frame was an earlier one.
    refused: Option<f64>,
}

/// The bulk of a frame: between the first and the last decile along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bulk {
    centre: DVec3,
    extent: DVec3,
    points: usize,
}

impl Bulk {
    /// Measures a frame; `None` if it has no extent.
    fn from_geometry(geometry: &Geometry) -> Option<Self> {
        let positions = match geometry {
            Geometry::Mesh(mesh) => &mesh.vertices,
            Geometry::Points(points) => &points.positions,
        };
        let points = positions.len();
        let step = points.div_ceil(LOOKED_AT).max(1);
        let decile = |axis: usize| {
            let mut values: Vec<f64> =
                positions.iter().step_by(step).map(|position| position[axis]).collect();
            values.sort_by(f64::total_cmp);
            let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
            (at(0.1), at(0.5), at(0.9))
        };
        if points == 0 {
            return None;
        }
        let [x, y, z] = [0, 1, 2].map(decile);
        let extent = DVec3::new(x.2 - x.0, y.2 - y.0, z.2 - z.0);
        (extent.length() > 0.0).then_some(Self { centre: DVec3::new(x.1, y.1, z.1), extent, points })
    }

    fn size(&self) -> f64 {
        self.extent.length()
    }

    /// Whether this is another frame's shape in another unit.
    fn is_in_another_unit_than(&self, other: &Self) -> bool {
        let (small, large) = if self.size() < other.size() { (self, other) } else { (other, self) };
        let near = |ratio: f64, wanted: f64| (ratio / wanted - 1.0).abs() <= RATIO_TOLERANCE;
        let ratio = large.size() / small.size();
        let Some(unit) = UNIT_RATIOS.into_iter().find(|unit| near(ratio, *unit)) else { return false };
        // Axes along which there is nothing say nothing.
        let axes = (0..3).all(|axis| {
            let (thin, thick) = (small.extent[axis] * unit, large.extent[axis]);
            thin.max(thick) < 0.05 * large.size() || (thin / thick - 1.0).abs() <= 2.0 * RATIO_TOLERANCE
        });
        let moved = (large.centre - small.centre * unit).length();
        let counts = small.points.max(large.points) <= 2 * small.points.min(large.points);
        axes && counts && moved <= 0.5 * large.size()
    }
}

impl ScaleCheck {
    /// A check that has seen no frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next frame and the file that it came from. Frames without extent say nothing about units and pass.
    ///
    /// # Errors
    /// [`ScaleError`] if the frame is the shape of the one before in another unit. After it, the next frame passes if it has the size of
    /// the one refused: one odd frame never costs the rest of a take.
    pub fn check(&mut self, path: &Path, geometry: &Geometry) -> Result<(), ScaleError> {
        let Some(bulk) = Bulk::from_geometry(geometry) else { return Ok(()) };
        let size = bulk.size();
        let alike = |other: &f64| size.max(*other) <= SAME_UNIT * size.min(*other);
        let is_known = self.sizes.iter().any(alike) || self.refused.as_ref().is_some_and(alike);
        if let Some((before_path, before)) = &self.before
            && !is_known
            && bulk.is_in_another_unit_than(before)
        {
            self.refused = Some(size);
            return Err(ScaleError {
                path: path.to_owned(),
                size_m: size,
                before_path: before_path.clone(),
                before_size_m: before.size(),
            });
        }
        if !self.sizes.iter().any(alike) && self.sizes.len() < KEPT {
            self.sizes.push(size);
        }
        self.refused = None;
        self.before = Some((path.to_owned(), bulk));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::PointCloud;

    /// A body of points, 1.8 m tall, whose parts are not alike; moved and scaled, and more points.
    fn body(scale: f64, moved: DVec3, others: &[DVec3]) -> Geometry {
        let at = |i: u32| {
            let (t, u) = (f64::from(i) * 0.618_034 % 1.0, f64::from(i) * 0.414_214 % 1.0);
            (DVec3::new(0.4 * (6.3 * u).cos() * (1.0 - t), 1.8 * t, 0.2 * (6.3 * u).sin()) + moved) * scale
        };
        let positions = (0..1500).map(at).chain(others.iter().copied()).collect();
        Geometry::Points(PointCloud {
            positions,
            normals: Vec::new(),
            viewpoint: None,
            scans: Vec::new(),
            colours: Vec::new(),
        })
    }

    fn plain(scale: f64) -> Geometry {
        body(scale, DVec3::ZERO, &[])
    }

    fn verdicts(frames: impl IntoIterator<Item = Geometry>) -> Vec<bool> {
        let mut check = ScaleCheck::new();
        frames.into_iter().map(|frame| check.check(Path::new("f.ply"), &frame).is_ok()).collect()
    }

    #[test]
    fn another_unit_is_noticed_in_both_directions() {
        for factor in [10.0, 25.4, 39.37, 100.0, 1000.0] {
            for factor in [factor, 1.0 / factor] {
                let moved = body(factor, DVec3::new(0.1, 0.02, -0.1), &[]);
                assert_eq!(verdicts([plain(1.0), moved, plain(1.0)]), [true, false, true], "{factor}");
            }
        }
        for factor in [1.5, 5.0, 17.0, 60.0, 400.0] {
            assert_eq!(verdicts([plain(1.0), plain(factor)]), [true, true], "{factor} is no unit");
        }
    }

    #[test]
    fn stray_points_and_people_who_enter_are_no_units() {
        let far = [DVec3::new(40.0, 3.0, -18.0), DVec3::new(0.0, -700.0, 0.0)];
        assert_eq!(verdicts([plain(1.0), body(1.0, DVec3::ZERO, &far), plain(1.0)]), [true; 3]);
        // A hand before a person, of a tenth of her size.
        let hand = |reach: DVec3| {
            let at = |i: u32| {
                DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.018 + reach
            };
            let positions = (0..1000).map(at).collect();
            Geometry::Points(PointCloud {
                positions,
                normals: Vec::new(),
                viewpoint: None,
                scans: Vec::new(),
                colours: Vec::new(),
            })
        };
        for reach in [DVec3::ZERO, DVec3::new(0.6, 1.2, 0.3)] {
            assert_eq!(verdicts([hand(reach), plain(1.0), hand(reach), plain(1.0)]), [true; 4]);
        }
        let nobody = Geometry::Points(PointCloud::default());
        assert_eq!(verdicts([nobody.clone(), plain(1.0), nobody, plain(1.0)]), [true; 4]);
    }

    #[test]
    fn one_odd_frame_never_costs_the_others() {
        let take = |odd: usize| (0..8).map(move |frame| plain(if frame == odd { 1000.0 } else { 1.0 }));
        let passed = |odd| verdicts(take(odd)).iter().filter(|passed| **passed).count();
        assert_eq!(passed(0), 7, "the second frame alone");
        assert_eq!(passed(3), 7);
        assert_eq!(passed(7), 7);
    }
}
