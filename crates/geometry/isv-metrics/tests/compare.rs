//! Whole comparisons of meshes: against values worked out by hand, and on captured frames.

use glam::{DVec3, Vec3Swizzles};
use isv_io::{FrameSequence, Unit, read_mesh};
use isv_metrics::{
    CompareError, CompareOptions, GeometryError, Side, SplitMix64, chamfer_floor, compare, summary,
};
use isv_testkit::capture;
use isv_volume::{PointCloud, TriangleMesh};
use std::time::Instant;

fn options(spacing_m: f64) -> CompareOptions {
    CompareOptions { spacing_m, ..CompareOptions::default() }
}

/// A unit square facing up at a height.
fn square(z: f64) -> TriangleMesh {
    TriangleMesh {
        vertices: [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]].map(DVec3::from).to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        appearance: None,
    }
}

/// The unit cube, closed, shifted.
fn cube(shift: DVec3) -> TriangleMesh {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        vertices: (0..8).map(|i| corner(i) + shift).collect(),
        normals: Vec::new(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        appearance: None,
    }
}

/// Random triangles in the unit cube.
fn soup(seed: u64, faces: u32) -> TriangleMesh {
    let mut random = SplitMix64::new(seed);
    let mut point = || DVec3::new(random.next_f64(), random.next_f64(), random.next_f64());
    TriangleMesh {
        vertices: (0..3 * faces).map(|_| point()).collect(),
        normals: Vec::new(),
        triangles: (0..faces).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
        appearance: None,
    }
}

fn assert_near(actual: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((actual - expected).abs() <= tolerance, "{what}: {actual}, expected {expected} +- {tolerance}");
}

#[test]
fn parallel_squares_are_their_gap_apart_in_every_measure() {
    let error = compare(&square(0.0), &square(0.25), &options(0.01)).unwrap();
    for (what, value) in [
        ("mean", error.p2s_mean_mm),
        ("rms", error.p2s_rms_mm),
        ("p99", error.p2s_p99_mm),
        ("hausdorff", error.hausdorff_mm),
        ("mean there", error.ref_to_test_mean_mm),
        ("rms there", error.ref_to_test_rms_mm),
        ("p99 there", error.ref_to_test_p99_mm),
        ("max there", error.ref_to_test_max_mm),
        ("mean back", error.test_to_ref_mean_mm),
        ("rms back", error.test_to_ref_rms_mm),
        ("p99 back", error.test_to_ref_p99_mm),
        ("max back", error.test_to_ref_max_mm),
    ] {
        assert_near(value.unwrap(), 250.0, 1e-9, what);
    }
    assert_eq!(error.normal_error_deg, Some(0.0));
    // All of the error lies along the normals: 3 over 1/16. Sideways there is a little more, which D1 counts.
    assert_eq!(error.psnr_peak_m, 1.0);
    assert_near(error.d2_psnr_db.unwrap(), 10.0 * 48f64.log10(), 1e-9, "D2");
    assert_near(error.d1_psnr_db.unwrap(), 10.0 * 48f64.log10(), 0.01, "D1");
    // The nearest of the other samples lies a fraction of the spacing aside: sqrt(250^2 + 5^2) = 250.05.
    assert!((250.0..250.2).contains(&error.chamfer_mm), "{}", error.chamfer_mm);
    assert_eq!([error.area_ratio, error.components_ref, error.components_test], [Some(1.0); 3]);
}

/// A unit cube is moved by `d` along x. One of its two x faces lies outside the other cube, `d` from it
/// everywhere. The other lies inside: at `t` from its outline it is `min(t, d)` from the surface. The four
/// side faces coincide but for a strip of width `d`, whose points are evenly 0 to `d` away.
#[test]
fn a_moved_cube_has_the_distances_of_its_faces() {
    let d = 0.1;
    let error = compare(&cube(DVec3::ZERO), &cube(DVec3::X * d), &options(0.006)).unwrap();
    let outer = d;
    // Mean of min(t, d) over the unit square, t the distance to its outline: d - (integral over the rim of d - t),
    // where the outline at t is 4 (1 - 2 t) long: d - (2 d^2 - 4/3 d^3).
    let inner = d - (2.0 * d * d - 4.0 / 3.0 * d * d * d);
    let side = d * d / 2.0;
    let mean = (outer + inner + 4.0 * side) / 6.0;
    assert_near(error.p2s_mean_mm.unwrap(), mean * 1e3, 0.15, "mean");
    assert_near(error.ref_to_test_mean_mm.unwrap(), mean * 1e3, 0.25, "there");
    assert_near(error.test_to_ref_mean_mm.unwrap(), mean * 1e3, 0.25, "back");
    assert_near(error.hausdorff_mm.unwrap(), d * 1e3, 1e-9, "hausdorff");
    assert_near(error.p2s_p99_mm.unwrap(), d * 1e3, 1e-9, "p99");
    // Mean squares: d^2; d^2 - integral of (d^2 - t^2) 4 (1 - 2 t) = d^2 - (8/3 d^3 - 2 d^4); a strip's d^3 / 3.
    let squares = d * d + (d * d - (8.0 / 3.0 * d.powi(3) - 2.0 * d.powi(4))) + 4.0 * d.powi(3) / 3.0;
    assert_near(error.p2s_rms_mm.unwrap(), (squares / 6.0).sqrt() * 1e3, 0.15, "rms");
}

#[test]
fn turned_surfaces_have_the_angle_between_them() {
    let turned = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut mesh = square(0.0);
        mesh.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, v.y * cos, v.y * sin));
        mesh
    };
    for degrees in [0.0, 1e-4, 30.0, 89.0] {
        let error = compare(&square(0.0), &turned(degrees), &options(0.05)).unwrap();
        assert_near(error.normal_error_deg.unwrap(), degrees, 1e-9, "angle");
    }
    let mut flipped = square(0.0);
    flipped.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    let error = compare(&square(0.0), &flipped, &options(0.05)).unwrap();
    assert_near(error.normal_error_deg.unwrap(), 180.0, 1e-9, "angle");
    assert_eq!(error.hausdorff_mm, Some(0.0));
}

/// A sphere of `2 rings^2` quads, the poles at the ends of an axis.
fn sphere(rings: u32, turned: bool) -> TriangleMesh {
    let vertex = |ring: u32, step: u32| {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        let phi = std::f64::consts::PI * f64::from(step) / f64::from(rings);
        let v = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        if turned { v.zxy() } else { v }
    };
    let around = 2 * rings;
    let corner = |ring: u32, step: u32| ring * around + step % around;
    let quads = (0..rings).flat_map(|ring| (0..around).map(move |step| (ring, step)));
    TriangleMesh {
        vertices: (0..=rings).flat_map(|ring| (0..around).map(move |step| vertex(ring, step))).collect(),
        normals: Vec::new(),
        triangles: quads
            .flat_map(|(r, s)| {
                let quad = [corner(r, s), corner(r + 1, s), corner(r + 1, s + 1), corner(r, s + 1)];
                [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
            })
            .collect(),
        appearance: None,
    }
}

/// Neighbouring faces of these spheres are 3 degrees apart; interpolated normals hardly show it.
#[test]
fn a_sphere_meshed_differently_has_almost_the_same_normals() {
    let error = compare(&sphere(60, false), &sphere(60, true), &options(0.03)).unwrap();
    assert!(error.normal_error_deg.unwrap() < 0.1, "{error:?}");
    let mut inside_out = sphere(60, true);
    inside_out.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    let error = compare(&sphere(60, false), &inside_out, &options(0.03)).unwrap();
    assert!(error.normal_error_deg.unwrap() > 179.9, "{error:?}");
}

#[test]
fn what_is_missing_and_what_is_stray_show_in_their_own_direction() {
    let mut stray = square(0.0);
    let speck =
        square(0.0).vertices.iter().map(|v| DVec3::new(0.5, 0.5, 0.1) + *v * 0.01).collect::<Vec<_>>();
    stray.vertices.extend(speck);
    stray.triangles.extend([[4, 5, 6], [4, 6, 7]]);
    let error = compare(&square(0.0), &stray, &options(0.002)).unwrap();
    assert!(error.ref_to_test_mean_mm.unwrap() < 1e-9);
    assert_near(error.test_to_ref_mean_mm.unwrap(), 100.0 * 1e-4 / (1.0 + 1e-4), 0.004, "share of the speck");
    assert_near(error.hausdorff_mm.unwrap(), 100.0, 1e-9, "hausdorff");
    assert_eq!(
        [error.components_ref, error.components_test, error.component_ratio],
        [1.0, 2.0, 2.0].map(Some)
    );
    assert_near(error.area_ratio.unwrap(), 1.0001, 1e-12, "area");
    let swapped = compare(&stray, &square(0.0), &options(0.002)).unwrap();
    assert!(swapped.test_to_ref_mean_mm.unwrap() < 1e-9 && swapped.ref_to_test_mean_mm.unwrap() > 0.005);
    assert_eq!(swapped.component_ratio, Some(0.5));
}

#[test]
fn a_speck_without_a_sample_on_it_shows_in_the_largest_distance() {
    let mut stray = square(0.0);
    let speck = square(0.1).vertices.iter().map(|v| DVec3::new(0.5e-3, 0.5e-3, 1.0) * *v).collect::<Vec<_>>();
    stray.vertices.extend(speck);
    // What no triangle with an area has is no part of the surface.
    stray.vertices.push(DVec3::Z * 50.0);
    stray.triangles.extend([[4, 5, 6], [4, 6, 7], [8, 8, 4]]);
    let error = compare(&square(0.0), &stray, &options(0.1)).unwrap();
    assert_eq!(error.p2s_p99_mm, Some(0.0));
    assert_near(error.test_to_ref_max_mm.unwrap(), 100.0, 1e-9, "max back");
    assert_near(error.hausdorff_mm.unwrap(), 100.0, 1e-9, "hausdorff");
    assert_eq!(error.ref_to_test_max_mm, Some(0.0));
}

#[test]
fn a_copy_has_no_distance_but_the_floor() {
    for mesh in [cube(DVec3::splat(7.0)), soup(3, 40)] {
        let error = compare(&mesh, &mesh, &options(0.02)).unwrap();
        assert!(error.hausdorff_mm.unwrap() < 1e-9 && error.p2s_mean_mm.unwrap() < 1e-9, "{error:?}");
        assert_eq!(Some(error.chamfer_mm), error.chamfer_floor_mm);
        assert_near(error.chamfer_mm, chamfer_floor(&mesh, 0.02, 0) * 1e3, 1e-12, "floor");
        assert_eq!((error.d1_psnr_db, error.d2_psnr_db), (error.d1_ceiling_db, error.d2_ceiling_db));
        assert!(error.d1_psnr_db.unwrap() < 50.0 && error.d1_psnr_db < error.d2_psnr_db, "{error:?}");
        assert!(error.normal_error_deg.unwrap() < 1e-6, "{error:?}");
        assert_eq!(error.area_ratio, Some(1.0));
    }
}

/// Uniform random points, one a spacing squared, have their nearest neighbour half a spacing away on average.
#[test]
fn the_floor_on_a_plane_is_half_the_spacing() {
    assert_near(chamfer_floor(&square(0.0), 0.005, 1), 0.0025, 0.00004, "floor");
}

#[test]
fn figures_are_the_same_on_any_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| compare(&cube(DVec3::ZERO), &soup(1, 30), &options(0.03)).unwrap())
    };
    assert_eq!(run(1), run(2));
    assert_eq!(run(1), run(5));
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let empty = TriangleMesh::default();
    let flat = TriangleMesh { triangles: vec![[0, 1, 1]], ..square(0.0) };
    for nothing in [&empty, &flat] {
        let refused = |side| Err(CompareError::NoSurface { side });
        assert_eq!(compare(nothing, &square(0.0), &options(0.1)), refused(Side::Reference));
        assert_eq!(compare(&square(0.0), nothing, &options(0.1)), refused(Side::Test));
        assert_eq!(compare(nothing, &PointCloud::default(), &options(0.1)), Err(CompareError::BothEmpty));
    }
    let no_points = Err(CompareError::NoPoints { side: Side::Test });
    assert_eq!(compare(&square(0.0), &PointCloud::default(), &options(0.1)), no_points);
    for metres in [0.0, -1.0, f64::INFINITY] {
        let refused = Err(CompareError::Spacing { metres });
        assert_eq!(compare(&square(0.0), &square(0.0), &options(metres)), refused);
    }
    assert!(matches!(
        compare(&square(0.0), &square(0.0), &options(1e-6)),
        Err(CompareError::TooManySamples { side: Side::Reference, .. })
    ));
}

#[test]
fn the_summary_is_the_mean_of_each_figure() {
    assert_eq!(summary(&[]), None);
    let a = compare(&square(0.0), &square(0.1), &options(0.05)).unwrap();
    let b = compare(&cube(DVec3::ZERO), &soup(1, 5), &options(0.05)).unwrap();
    assert_eq!(summary(&[a]), Some(a));
    let fields = |e: &GeometryError| serde_json::to_value(e).unwrap().as_object().unwrap().clone();
    let (a_fields, b_fields, both) = (fields(&a), fields(&b), fields(&summary(&[a, b]).unwrap()));
    assert_eq!(both.len(), 24);
    for (key, value) in &both {
        let expected = (a_fields[key].as_f64().unwrap() + b_fields[key].as_f64().unwrap()) / 2.0;
        assert_near(value.as_f64().unwrap(), expected, 1e-12 * expected.abs(), key);
    }
}

/// A frame of a captured human against itself, pushed out along its normals by a millimetre.
#[test]
fn captured_frames_are_measured() {
    let Some(folder) = capture("dancer") else { return };
    let paths = FrameSequence::open(&folder).unwrap();
    let frames: Vec<_> =
        paths.paths()[..2].iter().map(|path| read_mesh(path, Unit::Metre).unwrap()).collect();
    let start = Instant::now();
    let shift = DVec3::new(0.0006, 0.0008, 0.0);
    let mut moved = frames[0].clone();
    moved.vertices.iter_mut().for_each(|v| *v += shift);
    let error = compare(&frames[0], &moved, &CompareOptions::default()).unwrap();
    println!("moved by 1 mm: {error:#?}");
    assert!(error.hausdorff_mm.unwrap() <= 1.0 + 1e-9);
    // A surface moved by 1 mm in a random direction is half a millimetre off on average.
    assert!((0.3..0.7).contains(&error.p2s_mean_mm.unwrap()), "{error:?}");
    assert!((2.2..2.8).contains(&error.chamfer_floor_mm.unwrap()), "{error:?}");
    // Of 1 mm in a random direction a plane sees 1/3 square millimetre on average.
    let seen = 10.0 * (3.0 * (error.psnr_peak_m * 1e3).powi(2) * 3.0).log10();
    assert!((error.d2_psnr_db.unwrap() - seen).abs() < 1.5, "{seen}: {error:?}");
    assert!(error.normal_error_deg.unwrap() < 5.0, "{error:?}");
    let next = compare(&frames[0], &frames[1], &CompareOptions::default()).unwrap();
    println!("next frame: {next:#?}\n{:.0} ms a frame", start.elapsed().as_secs_f64() * 500.0);
    assert!(next.p2s_mean_mm.unwrap() > 1.0);
}
