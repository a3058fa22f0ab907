//! Point clouds, and D1 and D2 by hand.

use glam::DVec3;
use isv_metrics::{CompareOptions, GeometryError, MAX_PSNR_DB, compare, summary};
use isv_volume::{PointCloud, TriangleMesh};

fn cloud(positions: &[[f64; 3]], normals: &[DVec3]) -> PointCloud {
    let positions = positions.iter().copied().map(DVec3::from).collect();
    PointCloud {
        positions,
        normals: normals.to_vec(),
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

fn measured(reference: &PointCloud, test: &PointCloud) -> GeometryError {
    compare(reference, test, &CompareOptions::default()).unwrap()
}

fn square(z: f64) -> TriangleMesh {
    TriangleMesh {
        vertices: [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]].map(DVec3::from).to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        appearance: None,
    }
}

#[track_caller]
fn assert_psnr(actual: Option<f64>, peak: f64, mse: f64) {
    let expected = 10.0 * (3.0 * peak * peak / mse).log10();
    let actual = actual.unwrap();
    assert!((actual - expected).abs() < 1e-9, "{actual} dB, expected {expected}");
}

#[test]
fn d1_is_the_mean_squared_distance_and_d2_its_part_along_the_normals() {
    let reference = cloud(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], &[DVec3::Z; 2]);
    let test = cloud(&[[0.0, 0.0, 0.1], [2.0, 0.2, 0.0]], &[]);
    let error = measured(&reference, &test);
    assert_eq!(error.psnr_peak_m, 2.0);
    assert_psnr(error.d1_psnr_db, 2.0, (0.01 + 0.04) / 2.0);
    assert_psnr(error.d2_psnr_db, 2.0, (0.01 + 0.0) / 2.0);
    assert!((error.chamfer_mm - 150.0).abs() < 1e-9);
}

#[test]
fn the_worse_direction_counts() {
    let reference = cloud(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], &[DVec3::Z; 2]);
    let stray = cloud(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 4.0, 3.0]], &[DVec3::Z; 3]);
    let error = measured(&reference, &stray);
    assert_psnr(error.d1_psnr_db, 1.0, 25.0 / 3.0);
    assert_psnr(error.d2_psnr_db, 1.0, 9.0 / 3.0);
    let missing = measured(&stray, &reference);
    assert_psnr(missing.d1_psnr_db, 4.0, 25.0 / 3.0);
    // The first test point got the normals of the point at its place and of the stray one, which are the same.
    assert_psnr(missing.d2_psnr_db, 4.0, 9.0 / 3.0);
}

/// Two reference points, facing x and y, have one test point between them, which gets the mean of both normals, of
/// length 0.71.
#[test]
fn normals_handed_over_are_means_and_not_unit_vectors() {
    let reference = cloud(&[[-0.1, 0.0, 0.0], [0.3, 0.0, 0.0]], &[DVec3::X, DVec3::Y]);
    let test = cloud(&[[0.0, 0.0, 0.0]], &[DVec3::Z]);
    let error = measured(&reference, &test);
    // There: (0.1 / 2)^2 and (0.3 / 2)^2, mean 0.0125. Back: the nearest faces x, 0.1^2.
    assert_psnr(error.d2_psnr_db, 0.4, 0.0125);
    assert_psnr(error.d1_psnr_db, 0.4, (0.01 + 0.09) / 2.0);
}

/// The second test point is nobody's nearest; it takes the normal of its own nearest. That matters where another
/// reference point is as near to both: of equally near points each counts its share.
#[test]
fn points_that_got_no_normal_take_one_and_ties_share() {
    let reference = cloud(&[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]], &[DVec3::X, DVec3::Y]);
    let test = cloud(&[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], &[]);
    let error = measured(&reference, &test);
    // Reference 0 is as near to both and gives its normal to both; reference 1 adds its own to test 0: (x + y) / 2.
    // There: from 0 to test 0: (1/2)^2, to test 1: 1^2, mean 0.625; from 1 to test 0: (3/2)^2 = 2.25. Mean 1.4375.
    // Back: from both 1^2 along x.
    assert_psnr(error.d2_psnr_db, 4.0, (0.625 + 2.25) / 2.0);
    let alone = cloud(&[[0.0, 0.0, 0.2], [0.0, 0.0, 0.5]], &[]);
    let error = measured(&reference, &alone);
    // Test 1 is nobody's nearest. Back: nothing along x. There: test 0 has (x + y) / 2, so 0 from 0, 2^2 from 1.
    assert_psnr(error.d2_psnr_db, 4.0, (0.0 + 4.0) / 2.0);
}

#[test]
fn no_error_is_the_largest_psnr_and_one_point_has_none() {
    let reference = cloud(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], &[DVec3::Z; 3]);
    let error = measured(&reference, &reference);
    assert_eq!((error.d1_psnr_db, error.d2_psnr_db), (Some(MAX_PSNR_DB), Some(MAX_PSNR_DB)));
    assert_eq!((error.chamfer_mm, error.normal_error_deg), (0.0, Some(0.0)));
    let point = cloud(&[[1.0, 2.0, 3.0]], &[DVec3::X]);
    let error = measured(&point, &cloud(&[[1.0, 2.0, 3.5]], &[DVec3::Y]));
    assert_eq!((error.psnr_peak_m, error.d1_psnr_db, error.d2_psnr_db), (0.0, None, None));
    assert_eq!((error.chamfer_mm, error.normal_error_deg), (500.0, Some(90.0)));
}

#[test]
fn d2_needs_the_normals_of_the_whole_reference_and_angles_those_there_are() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    let test = cloud(&positions, &[DVec3::Y, DVec3::Y]);
    let bare = measured(&cloud(&positions, &[]), &test);
    assert_eq!((bare.d2_psnr_db, bare.normal_error_deg), (None, None));
    assert!(bare.d1_psnr_db.is_some());
    let half = measured(&cloud(&positions, &[DVec3::X, DVec3::ZERO]), &test);
    assert_eq!((half.d2_psnr_db, half.normal_error_deg), (None, Some(90.0)));
}

#[test]
fn a_mesh_and_points_have_the_one_direction_towards_the_mesh() {
    let points = cloud(&[[0.2, 0.3, 0.1], [0.7, 0.5, 0.3]], &[DVec3::X, DVec3::NEG_Z]);
    let error = compare(&square(0.0), &points, &CompareOptions::default()).unwrap();
    let back = [error.test_to_ref_mean_mm, error.test_to_ref_rms_mm, error.test_to_ref_p99_mm];
    for (value, expected) in back.iter().zip([200.0, 50_000f64.sqrt(), 300.0]) {
        assert!((value.unwrap() - expected).abs() < 1e-9, "{value:?}, expected {expected}");
    }
    assert_eq!(error.test_to_ref_max_mm, error.test_to_ref_p99_mm);
    assert_eq!((error.ref_to_test_mean_mm, error.p2s_mean_mm, error.hausdorff_mm), (None, None, None));
    assert_eq!((error.area_ratio, error.components_ref, error.components_test), (None, Some(1.0), None));
    assert_eq!(error.component_ratio, None);
    assert!(error.chamfer_floor_mm.is_some() && error.d1_ceiling_db.is_some() && error.d2_psnr_db.is_some());
    // Towards the mesh the angles are 90 and 180 degrees; back, more of the square is nearest to one or the other.
    let degrees = error.normal_error_deg.unwrap();
    assert!((135.0 + 90.0) / 2.0 < degrees && degrees < (135.0 + 180.0) / 2.0, "{degrees}");

    let swapped = compare(&points, &square(0.0), &CompareOptions::default()).unwrap();
    assert_eq!(swapped.ref_to_test_mean_mm, error.test_to_ref_mean_mm);
    assert_eq!((swapped.test_to_ref_mean_mm, swapped.p2s_rms_mm), (None, None));
    assert_eq!((swapped.chamfer_floor_mm, swapped.d1_ceiling_db, swapped.d2_ceiling_db), (None, None, None));
    assert_eq!((swapped.components_ref, swapped.components_test), (None, Some(1.0)));
}

#[test]
fn a_mean_is_over_the_frames_that_have_a_figure() {
    let points = cloud(&[[0.0, 0.0, 0.5], [1.0, 0.0, 0.5]], &[]);
    let with = compare(&square(0.0), &square(0.25), &CompareOptions::default()).unwrap();
    let without = compare(&square(0.0), &points, &CompareOptions::default()).unwrap();
    let mean = summary(&[without, with]).unwrap();
    assert_eq!(mean.p2s_mean_mm, with.p2s_mean_mm);
    assert!((mean.test_to_ref_mean_mm.unwrap() - 375.0).abs() < 1e-9);
    assert_eq!(mean.chamfer_mm, (without.chamfer_mm + with.chamfer_mm) / 2.0);
    assert_eq!(summary(&[measured(&points, &points)]).unwrap().p2s_mean_mm, None);
}
