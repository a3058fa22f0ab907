//! All measures of one shape against another.

use crate::chamfer::{chamfer_of_nearest, second_seed};
use crate::point_to_point::{PointErrors, psnr_db};
use crate::sampling::sample_count;
use crate::side::{MeasuredSide, Seen};
use crate::{DirectedDistances, GeometryError, Shape, SurfaceDistances};
use std::fmt;
use thiserror::Error;

/// Most samples of one surface. A comparison holds the samples of both sides and of the floor, their trees
/// and what was found. That takes 420 bytes of memory to a sample of one side (measured), so this keeps it
/// below 10 GB.
pub const MAX_SAMPLES: f64 = 2e7;

/// How to compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompareOptions {
    /// One sample a square of this edge, in metres.
    pub spacing_m: f64,
    /// Seed of the sampling of the reference; those of the test mesh and of the floor follow from it.
    pub seed: u64,
}

impl Default for CompareOptions {
    /// The paper's 5 mm for humans, and seed 0.
    fn default() -> Self {
        Self { spacing_m: 0.005, seed: 0 }
    }
}

/// One of the two shapes that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The shape that is right.
    Reference,
    /// The shape that is measured.
    Test,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reference => "reference",
            Self::Test => "test",
        })
    }
}

/// Shapes that cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A mesh without faces, or whose faces have no area.
    #[error("the {side} mesh has no surface to measure")]
    NoSurface {
        /// Which mesh.
        side: Side,
    },
    /// A cloud without points.
    #[error("the {side} cloud has no points to measure")]
    NoPoints {
        /// Which cloud.
        side: Side,
    },
    /// Nothing on either side.
    #[error("neither the reference nor the test has anything to measure")]
    BothEmpty,
    /// A spacing that is zero, negative or not a number.
    #[error("sample spacing of {metres} m is not a length")]
    Spacing {
        /// The spacing asked for.
        metres: f64,
    },
    /// A spacing so fine that a surface would take more than [`MAX_SAMPLES`].
    #[error(
        "the {side} mesh of {area_m2:.3} m^2 at a sample spacing of {spacing_m} m takes {samples:.0} samples, the \
         limit is {MAX_SAMPLES:.0}; take a larger spacing"
    )]
    TooManySamples {
        /// Which mesh.
        side: Side,
        /// Area in square metres.
        area_m2: f64,
        /// The spacing asked for.
        spacing_m: f64,
        /// The samples it would take.
        samples: f64,
    },
}

impl CompareError {
    /// Whether it says that a side is empty.
    fn is_emptiness(&self) -> bool {
        matches!(self, Self::NoSurface { .. } | Self::NoPoints { .. })
    }
}

/// Measures a test shape against a reference: meshes or points, on either side.
///
/// Distances start from samples of meshes and from the points of clouds, those at exactly the same position taken once.
/// The two sides are sampled with different seeds: with one seed a perfect copy would score 0 and a better one, meshed
/// differently, the floor.
///
/// # Errors
/// See [`CompareError`].
pub fn compare<'a>(
    reference: impl Into<Shape<'a>>,
    test: impl Into<Shape<'a>>,
    options: &CompareOptions,
) -> Result<GeometryError, CompareError> {
    let (reference, test) = (reference.into(), test.into());
    let areas = checked_areas(&reference, &test, options)?;
    let peak_m = reference.longest_side();
    let &CompareOptions { spacing_m, seed } = options;
    let (reference, test) = rayon::join(
        || MeasuredSide::new(reference, spacing_m, seed),
        || MeasuredSide::new(test, spacing_m, second_seed(seed)),
    );
    let there = test.set.tree().nearest_to_each(reference.set.points());
    let back = reference.set.tree().nearest_to_each(test.set.points());
    let points = PointErrors::new(&reference.set, test.set.points(), &there, &back);
    let mut error = GeometryError {
        chamfer_mm: chamfer_of_nearest(&there, &back) * MM,
        d1_psnr_db: psnr_db(points.d1, peak_m),
        d2_psnr_db: points.d2.and_then(|mse| psnr_db(mse, peak_m)),
        psnr_peak_m: peak_m,
        ..GeometryError::default()
    };
    error.set_surface_errors(test.seen_from(&reference, &there), reference.seen_from(&test, &back));
    error.set_limits_of_sampling(&reference, options);
    error.set_counts([&reference, &test].map(|side| side.surface.as_ref().map(|s| s.components)), areas);
    Ok(error)
}

/// Millimetres a metre.
const MM: f64 = 1e3;

impl GeometryError {
    /// Point-to-surface distances and angles, by what the reference sees of the test side and the reverse.
    fn set_surface_errors(&mut self, there: Seen, back: Seen) {
        if let (Some(there), Some(back)) = (there.normal_error, back.normal_error) {
            self.normal_error_deg = Some(((there + back) / 2.0).to_degrees());
        }
        let [farthest_there, farthest_back] = [there.farthest_corner, back.farthest_corner];
        match (there.distances, back.distances) {
            (Some(there), Some(back)) => {
                let both = SurfaceDistances::new(there, back);
                self.p2s_mean_mm = Some(both.mean * MM);
                self.p2s_rms_mm = Some(both.rms * MM);
                self.p2s_p99_mm = Some(both.p99 * MM);
                self.hausdorff_mm = Some(both.hausdorff.max(farthest_there).max(farthest_back) * MM);
                self.set_ref_to_test(&both.ref_to_test, farthest_there);
                self.set_test_to_ref(&both.test_to_ref, farthest_back);
            }
            (Some(there), None) => self.set_ref_to_test(&DirectedDistances::new(there), farthest_there),
            (None, Some(back)) => self.set_test_to_ref(&DirectedDistances::new(back), farthest_back),
            (None, None) => {}
        }
    }

    fn set_ref_to_test(&mut self, distances: &DirectedDistances, farthest: f64) {
        self.ref_to_test_mean_mm = Some(distances.mean * MM);
        self.ref_to_test_rms_mm = Some(distances.rms * MM);
        self.ref_to_test_p99_mm = Some(distances.p99 * MM);
        self.ref_to_test_max_mm = Some(distances.max.max(farthest) * MM);
    }

    fn set_test_to_ref(&mut self, distances: &DirectedDistances, farthest: f64) {
        self.test_to_ref_mean_mm = Some(distances.mean * MM);
        self.test_to_ref_rms_mm = Some(distances.rms * MM);
        self.test_to_ref_p99_mm = Some(distances.p99 * MM);
        self.test_to_ref_max_mm = Some(distances.max.max(farthest) * MM);
    }

    /// What the measures on samples say of a second sampling of a reference that is a mesh.
    fn set_limits_of_sampling(&mut self, reference: &MeasuredSide, options: &CompareOptions) {
        let Some(surface) = &reference.surface else { return };
        let again = surface.sampled(options.spacing_m, second_seed(options.seed));
        let there = again.tree().nearest_to_each(reference.set.points());
        let back = reference.set.tree().nearest_to_each(again.points());
        let points = PointErrors::new(&reference.set, again.points(), &there, &back);
        self.chamfer_floor_mm = Some(chamfer_of_nearest(&there, &back) * MM);
        self.d1_ceiling_db = psnr_db(points.d1, self.psnr_peak_m);
        self.d2_ceiling_db = points.d2.and_then(|mse| psnr_db(mse, self.psnr_peak_m));
    }

    /// Ratios of what only surfaces have, each list the reference first.
    fn set_counts(&mut self, components: [Option<usize>; 2], areas_m2: [Option<f64>; 2]) {
        let [components_ref, components_test] = components.map(|count| count.map(|count| count as f64));
        let ratio = |[reference, test]: [Option<f64>; 2]| Some(test? / reference?);
        self.components_ref = components_ref;
        self.components_test = components_test;
        self.component_ratio = ratio([components_ref, components_test]);
        self.area_ratio = ratio(areas_m2);
    }
}

/// The areas of both sides, where they are meshes, once it is sure that there is something to measure.
pub(crate) fn checked_areas(
    reference: &Shape,
    test: &Shape,
    options: &CompareOptions,
) -> Result<[Option<f64>; 2], CompareError> {
    let &CompareOptions { spacing_m, .. } = options;
    if !(spacing_m.is_finite() && spacing_m > 0.0) {
        return Err(CompareError::Spacing { metres: spacing_m });
    }
    let areas =
        [checked_area(reference, Side::Reference, spacing_m), checked_area(test, Side::Test, spacing_m)];
    match areas {
        [Err(a), Err(b)] if a.is_emptiness() && b.is_emptiness() => Err(CompareError::BothEmpty),
        [reference, test] => Ok([reference?, test?]),
    }
}

/// The area of a mesh that can be sampled; `None` of points.
fn checked_area(shape: &Shape, side: Side, spacing_m: f64) -> Result<Option<f64>, CompareError> {
    let area_m2 = match shape {
        Shape::Points(points) if points.positions.is_empty() => return Err(CompareError::NoPoints { side }),
        Shape::Points(_) => return Ok(None),
        Shape::Mesh(mesh) => mesh.area(),
    };
    if area_m2 <= 0.0 {
        return Err(CompareError::NoSurface { side });
    }
    let samples = sample_count(area_m2, spacing_m);
    if samples > MAX_SAMPLES {
        return Err(CompareError::TooManySamples { side, area_m2, spacing_m, samples });
    }
    Ok(Some(area_m2))
}
