//! All measures of one mesh against another.

use crate::chamfer::{chamfer_of_trees, second_seed};
use crate::sampling::{sample_count, sample_points};
use crate::{SurfaceDistances, connected_components, distances_to_surface};
use isv_spatial::{Bvh, PointTree};
use isv_volume::TriangleMesh;
use serde::Serialize;
use std::fmt;
use thiserror::Error;

/// Most samples of one surface: at about 80 bytes of memory each this keeps a comparison below 10 GB.
pub const MAX_SAMPLES: f64 = 1e8;

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

/// One of the two meshes that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The mesh that is right.
    Reference,
    /// The mesh that is measured.
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

/// Meshes that cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CompareError {
    /// A mesh without faces, or whose faces have no area.
    #[error("the {side} mesh has no surface to measure")]
    NoSurface {
        /// Which mesh.
        side: Side,
    },
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
        /// Its area in square metres.
        area_m2: f64,
        /// The spacing asked for.
        spacing_m: f64,
        /// The samples it would take.
        samples: f64,
    },
}

/// How far a test mesh is from a reference. The names are the keys of `isv eval --json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct GeometryError {
    /// Eq. 15 between samples of the two, in millimetres.
    pub chamfer_mm: f64,
    /// Eq. 15 between two samplings of the reference: what sampling alone makes of a perfect test mesh.
    pub chamfer_floor_mm: f64,
    /// [`SurfaceDistances::mean`] in millimetres.
    pub p2s_mean_mm: f64,
    /// [`SurfaceDistances::rms`] in millimetres.
    pub p2s_rms_mm: f64,
    /// [`SurfaceDistances::p99`] in millimetres.
    pub p2s_p99_mm: f64,
    /// [`SurfaceDistances::hausdorff`] in millimetres.
    pub hausdorff_mm: f64,
    /// [`SurfaceDistances::ref_to_test_mean`] in millimetres.
    pub ref_to_test_mean_mm: f64,
    /// [`SurfaceDistances::test_to_ref_mean`] in millimetres.
    pub test_to_ref_mean_mm: f64,
    /// Area of the test mesh over that of the reference.
    pub area_ratio: f64,
    /// [`connected_components`] of the reference; a whole number, except in a mean over frames.
    pub components_ref: f64,
    /// [`connected_components`] of the test mesh; a whole number, except in a mean over frames.
    pub components_test: f64,
}

/// Measures a test mesh against a reference, both valid ([`TriangleMesh::validate`]).
///
/// Point-to-surface distances start from the same samples as the Chamfer distance. The two meshes are sampled with
/// different seeds: with one seed a perfect copy would score 0 and a better one, meshed differently, the floor.
///
/// # Errors
/// See [`CompareError`].
pub fn compare(
    reference: &TriangleMesh,
    test: &TriangleMesh,
    options: &CompareOptions,
) -> Result<GeometryError, CompareError> {
    let reference_area = checked_area(reference, Side::Reference, options)?;
    let test_area = checked_area(test, Side::Test, options)?;
    let sampling = |mesh, seed| PointTree::new(sample_points(mesh, options.spacing_m, seed));
    let on_reference = sampling(reference, options.seed);
    let on_test = sampling(test, second_seed(options.seed));
    let chamfer = chamfer_of_trees(&on_reference, &on_test);
    let floor = chamfer_of_trees(&on_reference, &sampling(reference, second_seed(options.seed)));
    let distances = SurfaceDistances::new(
        distances_to_surface(on_reference.points(), &Bvh::new(test)),
        distances_to_surface(on_test.points(), &Bvh::new(reference)),
    );
    let mm = |metres: f64| metres * 1e3;
    Ok(GeometryError {
        chamfer_mm: mm(chamfer),
        chamfer_floor_mm: mm(floor),
        p2s_mean_mm: mm(distances.mean),
        p2s_rms_mm: mm(distances.rms),
        p2s_p99_mm: mm(distances.p99),
        hausdorff_mm: mm(distances.hausdorff),
        ref_to_test_mean_mm: mm(distances.ref_to_test_mean),
        test_to_ref_mean_mm: mm(distances.test_to_ref_mean),
        area_ratio: test_area / reference_area,
        components_ref: connected_components(reference) as f64,
        components_test: connected_components(test) as f64,
    })
}

/// The area of a mesh, once it is sure that it can be sampled.
fn checked_area(mesh: &TriangleMesh, side: Side, options: &CompareOptions) -> Result<f64, CompareError> {
    let &CompareOptions { spacing_m, .. } = options;
    if !(spacing_m.is_finite() && spacing_m > 0.0) {
        return Err(CompareError::Spacing { metres: spacing_m });
    }
    let area_m2 = mesh.area();
    if area_m2 <= 0.0 {
        return Err(CompareError::NoSurface { side });
    }
    let samples = sample_count(area_m2, spacing_m);
    if samples > MAX_SAMPLES {
        return Err(CompareError::TooManySamples { side, area_m2, spacing_m, samples });
    }
    Ok(area_m2)
}

/// Mean of each figure over frames; `None` without frames.
#[must_use]
pub fn summary(frames: &[GeometryError]) -> Option<GeometryError> {
    if frames.is_empty() {
        return None;
    }
    let mean =
        |figure: fn(&GeometryError) -> f64| frames.iter().map(figure).sum::<f64>() / frames.len() as f64;
    Some(GeometryError {
        chamfer_mm: mean(|f| f.chamfer_mm),
        chamfer_floor_mm: mean(|f| f.chamfer_floor_mm),
        p2s_mean_mm: mean(|f| f.p2s_mean_mm),
        p2s_rms_mm: mean(|f| f.p2s_rms_mm),
        p2s_p99_mm: mean(|f| f.p2s_p99_mm),
        hausdorff_mm: mean(|f| f.hausdorff_mm),
        ref_to_test_mean_mm: mean(|f| f.ref_to_test_mean_mm),
        test_to_ref_mean_mm: mean(|f| f.test_to_ref_mean_mm),
        area_ratio: mean(|f| f.area_ratio),
        components_ref: mean(|f| f.components_ref),
        components_test: mean(|f| f.components_test),
    })
}
