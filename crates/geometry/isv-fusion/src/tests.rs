//! Fusion of made scenes whose true surface is known.

use crate::{Accumulator, FusionError, FusionSettings, fuse};
use glam::{DMat4, DVec2, DVec3};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{Random, camera_ring, cube, look_at, render_depth, sheet, sphere};
use isv_volume::{
    BlockEdge, CameraPose, DepthImage, FitError, Grid, Intrinsics, SparseVolume, TriangleMesh, Truncation,
    VoxelSize,
};

const LENS: Intrinsics =
    Intrinsics { width: 160, height: 120, focal: DVec2::splat(140.0), principal: DVec2::new(79.5, 59.5) };

fn settings(voxel_m: f64, edge: BlockEdge) -> FusionSettings {
    FusionSettings::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge,
        truncation: Truncation::DEFAULT,
    })
}

fn surface(volume: &SparseVolume) -> TriangleMesh {
    extract_surface(volume, &SurfaceOptions::default())
}

/// The depths of a function of column and row, from a camera at the origin that looks along z.
fn image(depth: impl Fn(f64, f64) -> f64) -> DepthImage {
    let pixels = (0..LENS.pixels()).map(|i| depth((i % 160) as f64, (i / 160) as f64) as f32);
    DepthImage::new(LENS, CameraPose::from_matrix(DMat4::IDENTITY).unwrap(), pixels.collect()).unwrap()
}

/// Sample and place in metres of each observed voxel.
fn observed(volume: &SparseVolume) -> Vec<(f64, DVec3)> {
    let n = volume.grid().edge.voxels();
    let mut found = Vec::new();
    for (block, coord) in volume.coords().iter().enumerate() {
        for (voxel, sample) in volume.block(block).iter().enumerate() {
            if !volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
                let at = [voxel % n, voxel / n % n, voxel / n / n];
                found.push((f64::from(*sample) / 256.0, volume.grid().voxel_centre_m(*coord, at)));
            }
        }
    }
    found
}

/// Joins two meshes.
fn together(mut a: TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let first = a.vertices.len() as u32;
    a.vertices.extend(&b.vertices);
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    a
}

fn moved(mut mesh: TriangleMesh, by: DVec3) -> TriangleMesh {
    mesh.vertices.iter_mut().for_each(|v| *v += by);
    mesh
}

#[test]
fn a_slanted_wall_gets_distances_along_its_normal() {
    // z = 2 + 0.8 x, seen under up to 70 degrees.
    let wall = image(|column, _| 2.0 / (1.0 - 0.8 * (column - 79.5) / 140.0));
    let normal = DVec3::new(0.8, 0.0, -1.0).normalize();
    for edge in [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16] {
        let voxels = observed(&fuse(std::slice::from_ref(&wall), &settings(0.02, edge)).unwrap());
        let within = voxels.iter().filter(|(s, _)| s.abs() < 2.5);
        assert!(within.clone().count() > 30_000);
        for (s, at) in within {
            let truth = (*at - DVec3::Z * 2.0).dot(normal) / 0.02;
            assert!((s - truth).abs() < 0.05, "{s} instead of {truth} at {at}");
        }
    }
}

#[test]
fn what_was_not_seen_is_unobserved() {
    let wall = image(|_, _| 2.0);
    let volume = fuse(&[wall], &settings(0.02, BlockEdge::E8)).unwrap();
    for (s, at) in observed(&volume) {
        let place = LENS.project(at);
        assert!(at.z < 2.0 + 8.5 * 0.02, "{at} lies behind the band");
        assert!(
            place.min_element() > -0.51 && place.x < 159.51 && place.y < 119.51,
            "{at} lies beside the image"
        );
        assert!((s < 0.0) == (at.z > 2.0), "{s} at {at}");
    }
    let mesh = surface(&volume);
    let (low, high) = mesh.bounds().unwrap();
    assert!((high.x - low.x - 2.0 * 160.0 / 140.0).abs() < 0.1, "the wall is {} m wide", high.x - low.x);
}

#[test]
fn no_curtain_hangs_between_a_thing_and_what_is_behind_it() {
    let scene = together(moved(sheet(0.3), DVec3::Z * -1.5), &moved(sheet(4.0), DVec3::Z * -2.0));
    let seen = render_depth(&scene, &LENS, &look_at(DVec3::ZERO, DVec3::NEG_Z));
    let mesh = surface(&fuse(&[seen], &settings(0.02, BlockEdge::E8)).unwrap());
    let off = |v: &DVec3| (v.z + 1.5).abs().min((v.z + 2.0).abs());
    let worst = mesh.vertices.iter().map(off).fold(0.0, f64::max);
    assert!(worst < 0.01, "a vertex lies {worst} m from both sheets");
    let front = mesh.vertices.iter().filter(|v| v.z > -1.75).fold(0.0, |reach: f64, v| reach.max(v.x));
    assert!((front - 0.3).abs() < 0.04, "the front sheet reaches {front} m instead of 0.3 m");
}

#[test]
fn both_sides_of_a_thin_board_are_where_they_are() {
    // Five voxels thick, thinner than the band of eight: each side lies in the other's band.
    let mut board = cube(0.5);
    board.vertices.iter_mut().for_each(|v| v.z *= 0.05);
    let views = [DVec3::Z, DVec3::NEG_Z].map(|from| render_depth(&board, &LENS, &look_at(from, DVec3::ZERO)));
    let mesh = surface(&fuse(&views, &settings(0.01, BlockEdge::E8)).unwrap());
    let inner = mesh.vertices.iter().filter(|v| v.x.abs().max(v.y.abs()) < 0.4);
    assert!(inner.clone().count() > 10_000);
    let worst = inner.map(|v| (v.z.abs() - 0.025).abs()).fold(0.0, f64::max);
    assert!(worst < 0.001, "{worst} m");
}

#[test]
fn a_view_from_behind_does_not_carve() {
    let wall = moved(sheet(0.5), DVec3::Z * -1.0);
    let cover = moved(sheet(0.5), DVec3::Z * -1.5);
    let front = render_depth(&wall, &LENS, &look_at(DVec3::ZERO, DVec3::NEG_Z));
    // From the other side a second sheet hides the wall.
    let behind = render_depth(&together(wall, &cover), &LENS, &look_at(DVec3::Z * -3.0, DVec3::ZERO));
    let settings = settings(0.01, BlockEdge::E8);
    let near = |mesh: &TriangleMesh| mesh.vertices.iter().filter(|v| (v.z + 1.0).abs() < 0.1).count();
    let alone = near(&surface(&fuse(std::slice::from_ref(&front), &settings).unwrap()));
    let both = near(&surface(&fuse(&[front, behind], &settings).unwrap()));
    assert!(alone > 8_000 && both == alone, "{both} vertices instead of {alone}");
}

#[test]
fn a_ring_of_cameras_closes_a_sphere() {
    let ball = sphere(0.4, 60);
    let views: Vec<_> = camera_ring(ball.bounds().unwrap(), &LENS)
        .iter()
        .map(|pose| render_depth(&ball, &LENS, pose))
        .collect();
    let mesh = surface(&fuse(&views, &settings(0.01, BlockEdge::E8)).unwrap());
    let error = |v: &DVec3| (v.length() - 0.4).abs();
    let mean = mesh.vertices.iter().map(error).sum::<f64>() / mesh.vertices.len() as f64;
    let worst = mesh.vertices.iter().map(error).fold(0.0, f64::max);
    assert!(mean < 0.001 && worst < 0.01, "mean {mean} m, worst {worst} m");
}

#[test]
fn later_images_take_away_what_is_gone() {
    let wall = moved(sheet(4.0), DVec3::Z * -2.0);
    let thing = together(moved(sheet(0.3), DVec3::Z * -1.5), &wall);
    let [with, without] =
        [&thing, &wall].map(|m| render_depth(m, &LENS, &look_at(DVec3::ZERO, DVec3::NEG_Z)));
    let mut accumulator = Accumulator::new(settings(0.02, BlockEdge::E8));
    let front = |a: &Accumulator| surface(&a.volume()).vertices.iter().filter(|v| v.z > -1.8).count();
    for _ in 0..5 {
        accumulator.integrate(std::slice::from_ref(&with)).unwrap();
    }
    let before = front(&accumulator);
    assert!(before > 500);
    for _ in 0..12 {
        accumulator.integrate(std::slice::from_ref(&without)).unwrap();
    }
    assert_eq!(front(&accumulator), 0, "of {before} vertices");
    let mesh = surface(&accumulator.volume());
    assert!(mesh.vertices.iter().any(|v| v.length() < 2.01), "the wall behind it is there now");
}

#[test]
fn the_first_image_accumulated_is_that_image_fused() {
    let seen = render_depth(&sphere(0.4, 40), &LENS, &look_at(DVec3::Z * 2.0, DVec3::ZERO));
    let settings = settings(0.01, BlockEdge::E8);
    let mut accumulator = Accumulator::new(settings);
    assert_eq!(accumulator.volume().block_count(), 0);
    accumulator.integrate(std::slice::from_ref(&seen)).unwrap();
    assert_eq!(accumulator.volume(), fuse(&[seen], &settings).unwrap());
}

#[test]
fn threads_do_not_change_the_result() {
    let ball = sphere(0.4, 40);
    let views = camera_ring(ball.bounds().unwrap(), &LENS).map(|pose| render_depth(&ball, &LENS, &pose));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fuse(&views, &settings(0.01, BlockEdge::E8)).unwrap())
    };
    assert_eq!(on(1), on(5));
}

#[test]
fn work_grows_with_the_area_of_the_surface() {
    let wall = image(|_, _| 2.03);
    let blocks = |voxel_m| {
        fuse(std::slice::from_ref(&wall), &settings(voxel_m, BlockEdge::E8)).unwrap().block_count() as f64
    };
    let ratio = blocks(0.01) / blocks(0.02);
    assert!((3.5..4.5).contains(&ratio), "{ratio} times the blocks at half the voxel size");
}

#[test]
fn pixels_wider_than_blocks_leave_no_gaps() {
    // A pixel covers 7 mm at 1 m; blocks are 4 mm wide.
    let lens =
        Intrinsics { width: 24, height: 18, focal: DVec2::splat(140.0), principal: DVec2::new(11.5, 8.5) };
    let pose = CameraPose::from_matrix(DMat4::IDENTITY).unwrap();
    let wall = DepthImage::new(lens, pose, vec![1.0; 24 * 18]).unwrap();
    let mesh = surface(&fuse(&[wall], &settings(0.001, BlockEdge::E4)).unwrap());
    let area = mesh.area();
    let seen = 24.0 * 18.0 / (140.0 * 140.0);
    assert!((area / seen - 1.0).abs() < 0.05, "{area} of {seen} square metres");
    assert_eq!(isv_metrics::connected_components(&mesh), 1);
}

#[test]
fn what_cannot_be_done_is_refused_with_what_can() {
    let wall = image(|_, _| 2.0);
    let one = std::slice::from_ref(&wall);
    let fine = FusionSettings { max_blocks: 100, ..settings(0.005, BlockEdge::E8) };
    let Err(FusionError::Fit(FitError::TooManyBlocks { blocks, voxel_that_fits_m, .. })) = fuse(one, &fine)
    else {
        panic!("accepted")
    };
    assert!(blocks > 1_000 && voxel_that_fits_m > 0.02, "{blocks}, {voxel_that_fits_m}");
    let fits = FusionSettings { max_blocks: 100, ..settings(voxel_that_fits_m, BlockEdge::E8) };
    assert!(fuse(one, &fits).is_ok());

    let mut accumulator =
        Accumulator::new(FusionSettings { max_blocks: 1_000, ..settings(0.04, BlockEdge::E8) });
    accumulator.integrate(one).unwrap();
    let before = accumulator.volume();
    let far = image(|_, _| 9.0);
    assert!(matches!(accumulator.integrate(&[far]), Err(FusionError::Fit(FitError::TooManyBlocks { .. }))));
    assert_eq!(accumulator.volume(), before);

    let tiny = settings(1e-6, BlockEdge::E4);
    assert!(matches!(fuse(one, &tiny), Err(FusionError::Fit(FitError::TooManyBlocks { .. }))));
    let Err(FusionError::Fit(FitError::OutOfRange { voxel_that_fits_m, .. })) =
        fuse(&[image(|_, _| 9.0)], &tiny)
    else {
        panic!("accepted")
    };
    assert!(voxel_that_fits_m > 1e-6 && voxel_that_fits_m < 4e-6, "{voxel_that_fits_m}");
    let empty = fuse(&[image(|_, _| 0.0)], &fine).unwrap_err();
    assert!(empty.to_string().starts_with("no reading in any image: 19200 pixels"), "{empty}");
    assert!(matches!(fuse(&[], &fine), Err(FusionError::NoReading { .. })));
    assert!(matches!(
        fuse(one, &FusionSettings { max_depth_m: 1.0, ..fine }),
        Err(FusionError::NoReading { .. })
    ));
    for bad in [FusionSettings { max_depth_m: f64::NAN, ..fine }, FusionSettings { noise: -1.0, ..fine }] {
        assert!(matches!(fuse(one, &bad), Err(FusionError::Setting { .. })));
    }
}

#[test]
fn pixels_far_wider_than_high_are_refused_with_a_voxel_that_fits() {
    // A pixel covers 100 m by 0.1 mm: few blocks, but many rays.
    let seen = |focal| {
        let lens = Intrinsics { width: 3, height: 3, focal, principal: DVec2::ONE };
        let pose = CameraPose::from_matrix(DMat4::IDENTITY).unwrap();
        DepthImage::new(lens, pose, vec![1.0; 9]).unwrap()
    };
    let wide = seen(DVec2::new(0.01, 10_000.0));
    let settings = FusionSettings { max_blocks: 20_000, ..settings(0.005, BlockEdge::E8) };
    let Err(FusionError::Fit(FitError::TooManyBlocks { voxel_that_fits_m, .. })) =
        fuse(std::slice::from_ref(&wide), &settings)
    else {
        panic!("accepted")
    };
    assert!((0.005..0.1).contains(&voxel_that_fits_m), "{voxel_that_fits_m}");
    assert!(fuse(&[seen(DVec2::splat(10_000.0))], &settings).is_ok());
}

#[test]
fn any_lens_gives_a_volume_or_an_error() {
    let mut random = Random::new(6);
    for _ in 0..300 {
        let focal = DVec2::new(random.signed() * 20.0, random.signed() * 20.0).exp2();
        let lens = Intrinsics { width: 4, height: 3, focal, principal: DVec2::new(1.5, 1.0) };
        let depths: Vec<f32> = (0..12).map(|_| (1.0 + 0.1 * random.signed() / focal.x) as f32).collect();
        let image = DepthImage::new(lens, look_at(random.point() * 3.0, random.point()), depths).unwrap();
        let settings = FusionSettings { max_blocks: 2_000, noise: 1.0, ..settings(0.02, BlockEdge::E8) };
        match fuse(&[image], &settings) {
            Ok(volume) => assert!(volume.block_count() <= 2_000),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

#[test]
fn any_depths_give_a_volume_or_an_error() {
    let mut random = Random::new(5);
    for round in 0..20 {
        let spread = f64::from(round) * 2.0;
        let depths: Vec<f32> = (0..LENS.pixels())
            .map(|_| (random.signed() * spread).exp2() as f32 * random.signed() as f32)
            .collect();
        let pose = look_at(random.point() * 3.0, random.point());
        let noise = DepthImage::new(LENS, pose, depths).unwrap();
        let settings = FusionSettings { max_blocks: 20_000, ..settings(0.02, BlockEdge::E8) };
        match fuse(&[noise], &settings) {
            Ok(volume) => assert!(volume.block_count() <= 20_000),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}
