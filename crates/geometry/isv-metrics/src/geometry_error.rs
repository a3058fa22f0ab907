//! The figures of a comparison, and their means over frames.

use serde::{Deserialize, Serialize};

/// How far a test shape is from a reference. The names are the keys of `isv eval --json`.
///
/// Which figures there are depends on what is compared. Distances to a surface need one, as do area and
/// components. Angles and D2 need normals. Floor and ceilings need a reference that is sampled, and PSNR one
/// of some size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeometryError {
    /// Eq. 15 between the points of the two sides, in millimetres.
    pub chamfer_mm: f64,
    /// Eq. 15 between two samplings of the reference: what sampling alone makes of a perfect test mesh.
    pub chamfer_floor_mm: Option<f64>,
    /// [`SurfaceDistances::mean`](crate::SurfaceDistances::mean) in millimetres, as all of these.
    pub p2s_mean_mm: Option<f64>,
    /// [`SurfaceDistances::rms`](crate::SurfaceDistances::rms).
    pub p2s_rms_mm: Option<f64>,
    /// [`SurfaceDistances::p99`](crate::SurfaceDistances::p99).
    pub p2s_p99_mm: Option<f64>,
    /// The larger of the largest distances of both directions.
    pub hausdorff_mm: Option<f64>,
    /// Mean distance of the reference's points to the test surface.
    pub ref_to_test_mean_mm: Option<f64>,
    /// Root mean square of the same.
    pub ref_to_test_rms_mm: Option<f64>,
    /// The smallest of the same that 99 % do not exceed.
    pub ref_to_test_p99_mm: Option<f64>,
    /// The largest of the same, and of the corners of the reference's triangles.
    pub ref_to_test_max_mm: Option<f64>,
    /// Mean distance of the test side's points to the reference surface.
    pub test_to_ref_mean_mm: Option<f64>,
    /// Root mean square of the same.
    pub test_to_ref_rms_mm: Option<f64>,
    /// The smallest of the same that 99 % do not exceed.
    pub test_to_ref_p99_mm: Option<f64>,
    /// The largest of the same, and of the corners of the test's triangles.
    pub test_to_ref_max_mm: Option<f64>,
    /// Mean angle, 0 to 180 degrees, between the normal at a point and the other side's normal where that is closest; mean of
    /// both directions. A mesh has the angle-weighted normals of its vertices, interpolated; a cloud has its own, or none.
    pub normal_error_deg: Option<f64>,
    /// Point-to-point PSNR of MPEG's `pc_error`, at most [`MAX_PSNR_DB`](crate::MAX_PSNR_DB): the lower of both directions.
    pub d1_psnr_db: Option<f64>,
    /// D1 of a second sampling of the reference: what sampling alone leaves of a perfect test mesh.
    pub d1_ceiling_db: Option<f64>,
    /// Point-to-plane PSNR of MPEG's `pc_error`, with normals handed over from the reference as there.
    pub d2_psnr_db: Option<f64>,
    /// D2 of a second sampling of the reference.
    pub d2_ceiling_db: Option<f64>,
    /// The peak of both PSNR, in metres: the longest side of the reference's bounding box.
    pub psnr_peak_m: f64,
    /// Area of the test mesh over that of the reference.
    pub area_ratio: Option<f64>,
    /// [`connected_components`](crate::connected_components) of the reference; a whole number, except in a mean over frames.
    pub components_ref: Option<f64>,
    /// Number of components of the test mesh.
    pub components_test: Option<f64>,
    /// Components of the test mesh over those of the reference: above 1 there are stray parts.
    pub component_ratio: Option<f64>,
}

/// Mean of each figure over the frames that have it; `None` without frames.
#[must_use]
pub fn summary(frames: &[GeometryError]) -> Option<GeometryError> {
    if frames.is_empty() {
        return None;
    }
    let all =
        |figure: fn(&GeometryError) -> f64| frames.iter().map(figure).sum::<f64>() / frames.len() as f64;
    let some = |figure: fn(&GeometryError) -> Option<f64>| {
        let having = frames.iter().filter_map(figure).count();
        (having > 0).then(|| frames.iter().filter_map(figure).sum::<f64>() / having as f64)
    };
    Some(GeometryError {
        chamfer_mm: all(|f| f.chamfer_mm),
        chamfer_floor_mm: some(|f| f.chamfer_floor_mm),
        p2s_mean_mm: some(|f| f.p2s_mean_mm),
        p2s_rms_mm: some(|f| f.p2s_rms_mm),
        p2s_p99_mm: some(|f| f.p2s_p99_mm),
        hausdorff_mm: some(|f| f.hausdorff_mm),
        ref_to_test_mean_mm: some(|f| f.ref_to_test_mean_mm),
        ref_to_test_rms_mm: some(|f| f.ref_to_test_rms_mm),
        ref_to_test_p99_mm: some(|f| f.ref_to_test_p99_mm),
        ref_to_test_max_mm: some(|f| f.ref_to_test_max_mm),
        test_to_ref_mean_mm: some(|f| f.test_to_ref_mean_mm),
        test_to_ref_rms_mm: some(|f| f.test_to_ref_rms_mm),
        test_to_ref_p99_mm: some(|f| f.test_to_ref_p99_mm),
        test_to_ref_max_mm: some(|f| f.test_to_ref_max_mm),
        normal_error_deg: some(|f| f.normal_error_deg),
        d1_psnr_db: some(|f| f.d1_psnr_db),
        d1_ceiling_db: some(|f| f.d1_ceiling_db),
        d2_psnr_db: some(|f| f.d2_psnr_db),
        d2_ceiling_db: some(|f| f.d2_ceiling_db),
        psnr_peak_m: all(|f| f.psnr_peak_m),
        area_ratio: some(|f| f.area_ratio),
        components_ref: some(|f| f.components_ref),
        components_test: some(|f| f.components_test),
        component_ratio: some(|f| f.component_ratio),
    })
}
