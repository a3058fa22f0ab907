//! Ingest of points on shapes whose distance field is known.

use crate::{
    IngestError, PointEvidence, PointIngest, PointSign, SignMode, decide_point_sign, estimate_normals,
    ingest_points,
};
use glam::DVec3;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::Random;
use isv_volume::{
    BlockEdge, FitError, Grid, PointCloud, PointsError, SparseVolume, Truncation, VoxelMask, VoxelSize,
};

fn settings(voxel_m: f64, edge: BlockEdge) -> PointIngest {
    PointIngest::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge,
        truncation: Truncation::DEFAULT,
    })
}

/// Random points on a sphere of 0.2 m, one a square of 6 mm.
fn sphere() -> PointCloud {
    let mut random = Random::new(11);
    let normals: Vec<DVec3> = std::iter::repeat_with(|| random.point())
        .filter(|p| (0.1..1.0).contains(&p.length()))
        .map(DVec3::normalize)
        .take(14_000)
        .collect();
    PointCloud {
        positions: normals.iter().map(|n| 0.2 * n).collect(),
        normals,
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

/// Random points of the square `-half..half` in the plane `z = 0.003`, facing up, without those that `hole` takes.
fn sheet(half: f64, hole: impl Fn(DVec3) -> bool) -> PointCloud {
    let mut random = Random::new(12);
    let count = (2.0 * half / 0.006).powi(2) as usize;
    let positions: Vec<DVec3> = (0..count)
        .map(|_| DVec3::new(half * random.signed(), half * random.signed(), 0.003))
        .filter(|p| !hole(*p))
        .collect();
    PointCloud {
        normals: vec![DVec3::Z; positions.len()],
        positions,
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

/// Points 1 cm apart on a square of `side` of them, from `corner` on, along the other two axes than `axis`.
fn patch(side: usize, axis: usize, corner: f64) -> PointCloud {
    let mut cloud = PointCloud::default();
    for number in 0..side * side {
        let mut position = [corner; 3];
        position[(axis + 1) % 3] += 0.01 * (number / side) as f64;
        position[(axis + 2) % 3] += 0.01 * (number % side) as f64;
        cloud.positions.push(position.into());
        cloud.normals.push(DVec3::AXES[axis]);
    }
    cloud
}

/// Calls `check` with centre (metres), sample (voxels) and whether it is observed, for every voxel of the volume.
fn for_each_voxel(volume: &SparseVolume, mut check: impl FnMut(DVec3, f64, bool)) {
    let (grid, n) = (volume.grid(), volume.grid().edge.voxels());
    for (block, coord) in volume.coords().iter().enumerate() {
        for (voxel, sample) in volume.block(block).iter().enumerate() {
            let at = grid.voxel_centre_m(*coord, [voxel % n, voxel / n % n, voxel / (n * n)]);
            let observed = !volume.unobserved(block).is_some_and(|mask| mask.contains(voxel));
            check(at, f64::from(*sample) / 256.0, observed);
        }
    }
}

/// Area of the extracted surface in square metres.
fn area(volume: &SparseVolume) -> f64 {
    let mesh = extract_surface(volume, &SurfaceOptions { normals: false });
    let corners = (0..mesh.triangles.len()).map(|face| mesh.corners(face));
    corners.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
}

#[test]
fn a_sphere_has_a_true_distance_in_all_of_the_band() {
    for edge in [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16] {
        let volume = ingest_points(&sphere(), &settings(0.01, edge), PointSign::Oriented).unwrap();
        let (mut near, mut in_band) = ((0.0, 0), 0);
        for_each_voxel(&volume, |p, s, observed| {
            let expected = (100.0 * p.length() - 20.0).clamp(-8.0, 8.0);
            assert!((s - expected).abs() < 0.25 && observed, "{p}: {s} against {expected}");
            if expected.abs() < 1.0 {
                near = (near.0 + (s - expected).abs(), near.1 + 1);
            }
            in_band += usize::from(expected.abs() < 7.7);
        });
        assert!(near.0 / f64::from(near.1) < 0.01, "on average {} voxels off", near.0 / f64::from(near.1));
        // Counted over the whole neighbourhood, no voxel of the band is missing.
        let all = (-28..28).flat_map(|x| (-28..28).flat_map(move |y| (-28..28).map(move |z| [x, y, z])));
        let distance = |v: [i32; 3]| (DVec3::from_array(v.map(f64::from)) + 0.5).length() - 20.0;
        assert_eq!(in_band, all.filter(|v| distance(*v).abs() < 7.7).count());
    }
}

#[test]
fn threads_do_not_change_the_result() {
    let cloud = sheet(0.1, |p| p.length() < 0.04);
    let work = || {
        let estimated = estimate_normals(&cloud).unwrap();
        let volume = ingest_points(&cloud, &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap();
        (estimated, volume)
    };
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let one = pool(1).install(work);
    assert!(!one.1.unobserved_masks().is_empty());
    assert_eq!(one, pool(3).install(work));
}

#[test]
fn a_wide_hole_stays_open_and_a_narrow_one_is_closed() {
    let area_with = |radius: f64| {
        let cloud = sheet(0.2, |p| p.truncate().length() < radius);
        area(&ingest_points(&cloud, &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap())
    };
    let (whole, narrow, wide) = (area_with(0.0), area_with(0.011), area_with(0.08));
    // A voxel more on each side would be 0.176 m2.
    assert!((0.15..0.176).contains(&whole), "the sheet ends where the points do: {whole} m2");
    assert!((whole - narrow).abs() < 0.001, "a hole of 22 mm is closed: {narrow} of {whole} m2");
    let hole = std::f64::consts::PI * 0.08 * 0.08;
    assert!((whole - wide - hole).abs() < 0.2 * hole, "a hole of 160 mm is not: {wide} of {whole} m2");
}

/// A plate of one and a half voxels: each side lies in the other's band.
#[test]
fn both_sides_of_a_thin_plate_are_kept() {
    let mut cloud = sheet(0.1, |_| false);
    let top = cloud.positions.len();
    for i in 0..top {
        cloud.positions.push(cloud.positions[i].with_z(-0.012) + DVec3::new(0.002, 0.001, 0.0));
        cloud.normals.push(DVec3::NEG_Z);
    }
    let volume = ingest_points(&cloud, &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap();
    for_each_voxel(&volume, |p, s, observed| {
        if observed && p.truncate().abs().max_element() < 0.08 {
            let expected = 100.0 * ((p.z + 0.0045).abs() - 0.0075);
            assert!((s - expected.min(8.0)).abs() < 0.15, "{p}: {s} against {expected}");
        }
    });
}

#[test]
fn isolated_points_neither_make_surface_nor_change_the_rest() {
    let cloud = sphere();
    let alone = ingest_points(&cloud, &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap();
    let mut with_outliers = cloud;
    for i in 1..20 {
        with_outliers.positions.push(DVec3::new(f64::from(i), 1.0, 0.0));
        with_outliers.normals.push(DVec3::Y);
    }
    let volume = ingest_points(&with_outliers, &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap();
    assert_eq!(volume, alone);
}

#[test]
fn points_without_normals_become_a_shell_around_them() {
    let cloud = PointCloud { normals: Vec::new(), ..sphere() };
    let volume = ingest_points(&cloud, &settings(0.01, BlockEdge::E8), PointSign::Offset).unwrap();
    for_each_voxel(&volume, |p, s, observed| {
        let expected = ((100.0 * p.length() - 20.0).abs() - 1.5).min(8.0);
        assert!(observed && s > expected - 0.01 && s < expected + 1.2, "{p}: {s} against {expected}");
    });
}

#[test]
fn few_coincident_and_collinear_points_do_no_harm() {
    let clouds = [
        vec![DVec3::ZERO],
        vec![DVec3::ZERO, DVec3::X],
        vec![DVec3::ONE; 1000],
        (0..1000).map(|i| DVec3::X * 0.001 * f64::from(i)).collect(),
    ];
    for positions in clouds {
        let cloud = PointCloud {
            normals: vec![DVec3::Z; positions.len()],
            positions,
            viewpoint: None,
            scans: Vec::new(),
            colours: Vec::new(),
        };
        let bare = estimate_normals(&cloud).unwrap();
        assert!(bare.normals.iter().all(|n| *n == DVec3::ZERO), "no plane, no normal");
        for mode in [SignMode::Auto, SignMode::Closed, SignMode::Offset] {
            let (sign, _) = decide_point_sign(&cloud, mode);
            match ingest_points(&cloud, &settings(0.01, BlockEdge::E8), sign) {
                Ok(volume) => assert!(volume.block_count() < 1500),
                Err(error) => assert!(matches!(error, IngestError::TooSparse { .. }), "{error}"),
            }
        }
    }
}

#[test]
fn a_decision_says_what_it_rests_on() {
    let mut cloud = sphere();
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    assert_eq!(sign, PointSign::Oriented);
    assert!((evidence.spacing_m - 0.006).abs() < 0.001, "{evidence:?}");
    cloud.normals.iter_mut().step_by(3).for_each(|n| *n = -*n);
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    assert_eq!(sign, PointSign::Offset);
    assert!(evidence.to_string().contains("100 % of the points have a normal, 5"), "{evidence}");
    assert_eq!(decide_point_sign(&cloud, SignMode::Closed).0, PointSign::Oriented);
    cloud.normals.iter_mut().step_by(4).for_each(|n| *n = DVec3::ZERO);
    assert!(decide_point_sign(&cloud, SignMode::Auto).1.to_string().starts_with("75 % of the points"));
    cloud.normals.clear();
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    assert!(
        sign == PointSign::Offset && evidence.to_string().starts_with("no point has a normal, points are")
    );
    let broken = PointCloud { positions: vec![DVec3::NAN], ..PointCloud::default() };
    assert_eq!(decide_point_sign(&broken, SignMode::Auto), (PointSign::Offset, PointEvidence::default()));
}

#[test]
fn estimated_normals_look_outward_or_to_the_viewpoint() {
    let mut cloud = sphere();
    let given = std::mem::take(&mut cloud.normals);
    let outward = estimate_normals(&cloud).unwrap();
    assert!(outward.normals.iter().zip(&given).all(|(n, m)| n.dot(*m) > 0.95));
    cloud.viewpoint = Some(DVec3::ZERO);
    let inward = estimate_normals(&cloud).unwrap();
    assert!(inward.normals.iter().zip(&given).all(|(n, m)| n.dot(*m) < -0.95));
}

#[test]
fn points_keep_their_colours_when_normals_are_estimated() {
    let mut cloud = sphere();
    cloud.colours = (0..cloud.positions.len()).map(|point| [(point % 251) as u8, 7, 9]).collect();
    let estimated = estimate_normals(&cloud).unwrap();
    assert_eq!((estimated.positions, estimated.colours), (cloud.positions, cloud.colours));
}

#[test]
fn broken_and_unfit_clouds_are_refused() {
    let settings = settings(0.01, BlockEdge::E8);
    let ingest =
        |cloud: &PointCloud, settings| ingest_points(cloud, settings, PointSign::Oriented).unwrap_err();
    let mut cloud = sphere();
    cloud.positions[5].y = f64::NAN;
    assert_eq!(ingest(&cloud, &settings), IngestError::Points(PointsError::NotFinite { point: 5 }));
    assert!(estimate_normals(&cloud).is_err());
    cloud = PointCloud { normals: Vec::new(), ..sphere() };
    assert!(matches!(
        ingest_points(&cloud, &settings, PointSign::Oriented),
        Ok(_) | Err(IngestError::NoNormals)
    ));
    cloud = PointCloud { normals: vec![DVec3::ZERO; 14_000], ..sphere() };
    assert_eq!(ingest(&cloud, &settings), IngestError::NoNormals);
    let shell = PointIngest { offset_voxels: 9.0, ..settings };
    let error = ingest_points(&cloud, &shell, PointSign::Offset).unwrap_err();
    assert_eq!(error, IngestError::Offset { voxels: 9.0, truncation: 8 });
    cloud.positions[3].x = 1e9;
    let error = ingest_points(&cloud, &settings, PointSign::Offset).unwrap_err();
    assert!(matches!(error, IngestError::Fit(FitError::OutOfRange { .. })), "{error}");
}

#[test]
fn points_too_far_apart_are_refused_with_a_voxel_that_fits() {
    let fine = settings(0.001, BlockEdge::E8);
    let error = ingest_points(&sphere(), &fine, PointSign::Oriented).unwrap_err();
    let IngestError::TooSparse { voxel_that_fits_m, .. } = error else { panic!("{error}") };
    assert!((0.0015..0.003).contains(&voxel_that_fits_m), "{error}");
    let fits = settings(voxel_that_fits_m, BlockEdge::E8);
    let volume = ingest_points(&sphere(), &fits, PointSign::Oriented).unwrap();
    assert!(volume.block_count() > 0);
}

#[test]
fn too_many_blocks_are_refused_with_a_voxel_that_fits() {
    for (edge, max_blocks) in [(BlockEdge::E4, 100), (BlockEdge::E8, 100), (BlockEdge::E16, 20)] {
        let few = PointIngest { max_blocks, ..settings(0.01, edge) };
        for sign in [PointSign::Oriented, PointSign::Offset] {
            let error = ingest_points(&sphere(), &few, sign).unwrap_err();
            let IngestError::Fit(FitError::TooManyBlocks { voxel_that_fits_m, .. }) = error else {
                panic!("{error}")
            };
            let grid = settings(voxel_that_fits_m, edge).grid;
            let volume = ingest_points(&sphere(), &PointIngest { grid, ..few }, sign).unwrap();
            assert!(volume.block_count() <= max_blocks);
        }
    }
}

#[test]
fn the_whole_sphere_is_seen() {
    let volume = ingest_points(&sphere(), &settings(0.01, BlockEdge::E8), PointSign::Oriented).unwrap();
    assert_eq!(volume.unobserved_masks().values().map(VoxelMask::count).sum::<usize>(), 0);
    let expected = 4.0 * std::f64::consts::PI * 0.04;
    assert!((area(&volume) / expected - 1.0).abs() < 0.01);
}

#[test]
fn small_patches_keep_their_surface_wherever_they_lie() {
    for side in [8, 12, 16, 25, 32, 40] {
        for axis in 0..3 {
            for corner in [0.0, 0.004, 0.0075, -0.003, 0.31] {
                let cloud = patch(side, axis, corner);
                let volume =
                    ingest_points(&cloud, &settings(0.015, BlockEdge::E8), PointSign::Oriented).unwrap();
                let surface = extract_surface(&volume, &SurfaceOptions::default());
                let area = surface.area() / (0.01 * side as f64).powi(2);
                // It ends up to a voxel beyond its last points.
                assert!((0.9..1.7).contains(&area), "{side} along axis {axis} at {corner}: {area:.2}");
            }
        }
    }
}

#[test]
fn right_angles_do_not_make_normals_contradict_each_other() {
    let mut cloud = PointCloud::default();
    for side in 0..6 {
        let (axis, sign) = (side % 3, if side < 3 { 1.0 } else { -1.0 });
        for number in 0..21 * 21 {
            let [i, j] = [number / 21, number % 21].map(|at| 0.005 * f64::from(at) - 0.05);
            let mut position = [0.05 * sign; 3];
            (position[(axis + 1) % 3], position[(axis + 2) % 3]) = (i, j);
            cloud.positions.push(position.into());
            cloud.normals.push(sign * DVec3::AXES[axis]);
        }
    }
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    assert_eq!(sign, PointSign::Oriented, "{evidence}");
    // One in ten of the points looks the other way.
    cloud.normals.iter_mut().step_by(10).for_each(|normal| *normal = -*normal);
    assert_eq!(decide_point_sign(&cloud, SignMode::Auto).0, PointSign::Offset);
}

#[test]
fn points_that_are_there_many_times_count_once() {
    let mut cloud = sphere();
    cloud.normals.clear();
    let once = estimate_normals(&cloud).unwrap();
    let spacing = crate::PointSpacing::from_cloud(&cloud);
    // As several scans that were put together may have them.
    cloud.positions = (0..12).flat_map(|_| cloud.positions.clone()).collect();
    assert_eq!(crate::PointSpacing::from_cloud(&cloud), spacing);
    let repeated = estimate_normals(&cloud).unwrap();
    for (own, normal) in repeated.normals.iter().enumerate() {
        assert_eq!(*normal, once.normals[own % once.normals.len()]);
    }
    let (sign, evidence) = decide_point_sign(&repeated, SignMode::Auto);
    assert_eq!(sign, PointSign::Oriented, "{evidence}");
    // It looks at other points.
    let ratio = evidence.spacing_m / decide_point_sign(&once, SignMode::Auto).1.spacing_m;
    assert!((0.95..1.05).contains(&ratio), "{ratio}");
    // Both sides in one place tell none.
    let mut both = PointCloud { positions: [&once.positions[..]; 2].concat(), ..once.clone() };
    both.normals = once.normals.iter().copied().chain(once.normals.iter().map(|n| -*n)).collect();
    assert_eq!(decide_point_sign(&both, SignMode::Auto).0, PointSign::Offset);
}
