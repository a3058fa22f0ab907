//! D1 and D2: the point-to-point and point-to-plane errors of MPEG's `pc_error`.

use crate::mean::mean;
use crate::point_set::PointSet;
use glam::DVec3;
use isv_spatial::NearestPoints;

/// The PSNR of no error at all, which has none: what JSON cannot hold is this many decibels, as in MPEG's tools.
pub const MAX_PSNR_DB: f64 = 999.99;

/// Mean squared errors between two point sets, in square metres, each the larger of both directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointErrors {
    /// Mean square of the vectors to the nearest points.
    pub(crate) d1: f64,
    /// Mean square of those vectors along the normals there. `None` unless the normals of all points of the
    /// reference are known.
    pub(crate) d2: Option<f64>,
}

impl PointErrors {
    /// Measures a test set against a reference. `there` is what is nearest in the test set to each point of
    /// the reference, and `back` the reverse.
    pub(crate) fn new(
        reference: &PointSet,
        test: &[DVec3],
        there: &NearestPoints,
        back: &NearestPoints,
    ) -> Self {
        let points = reference.points();
        let d1 = mean_sq(there).max(mean_sq(back));
        let known = |normals: &&[DVec3]| normals.iter().all(|normal| *normal != DVec3::ZERO);
        let d2 = reference.normals().filter(known).map(|normals| {
            let on_test = hand_over(normals, test.len(), there, back);
            mean_plane_sq(points, test, &on_test, there).max(mean_plane_sq(test, points, normals, back))
        });
        Self { d1, d2 }
    }
}

/// `10 log10(3 peak^2 / mse)` in decibels, at most [`MAX_PSNR_DB`]; the 3 stands for three coordinates. `None` without a
/// peak, where the reference is one point.
pub(crate) fn psnr_db(mse: f64, peak_m: f64) -> Option<f64> {
    (peak_m > 0.0).then(|| (10.0 * (3.0 * peak_m * peak_m / mse).log10()).min(MAX_PSNR_DB))
}

fn mean_sq(nearest: &NearestPoints) -> f64 {
    let distances_sq = nearest.distances_sq();
    mean(distances_sq.len(), |i| distances_sq[i])
}

/// Mean squared length along the normals of `to` of the vectors to the nearest points. Of equally near points each
/// counts its share.
fn mean_plane_sq(from: &[DVec3], to: &[DVec3], normals: &[DVec3], nearest: &NearestPoints) -> f64 {
    mean(from.len(), |i| {
        let ties = nearest.of(i);
        let plane_sq = |at: &u32| (from[i] - to[*at as usize]).dot(normals[*at as usize]).powi(2);
        ties.iter().map(plane_sq).sum::<f64>() / ties.len() as f64
    })
}

/// Normals of a test set, from those of its reference, as `scaleNormals` of `pc_error` has it. Each point of
/// the reference adds its normal to its nearest test points. Sums are divided by how many were added, which
/// does not make them unit vectors again. A test point that got none takes the mean of its nearest in the
/// reference.
fn hand_over(
    normals: &[DVec3],
    test_points: usize,
    there: &NearestPoints,
    back: &NearestPoints,
) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0u32); test_points];
    for (i, normal) in normals.iter().enumerate() {
        for at in there.of(i) {
            let (sum, count) = &mut sums[*at as usize];
            *sum += *normal;
            *count += 1;
        }
    }
    let taken = |i: usize| {
        let nearest = back.of(i);
        nearest.iter().map(|at| normals[*at as usize]).sum::<DVec3>() / nearest.len() as f64
    };
    let handed = |(i, &(sum, count)): (usize, &(DVec3, u32))| match count {
        0 => taken(i),
        _ => sum / f64::from(count),
    };
    sums.iter().enumerate().map(handed).collect()
}
