//! Comparisons of colours: against values worked out by hand, and what must hold of any.

use glam::DVec3;
use isv_metrics::{
    ColourError, CompareError, CompareOptions, MAX_COLOUR_PSNR_DB, Side, SplitMix64, colour_summary,
    compare_colours,
};
use isv_testkit::sphere;
use isv_volume::{Appearance, Image, Material, PointCloud, Rgb, TriangleMesh};
use std::sync::Arc;

fn options(spacing_m: f64) -> CompareOptions {
    CompareOptions { spacing_m, ..CompareOptions::default() }
}

/// A unit square in a plane z, upright, facing +z, of one colour.
fn square(z: f64, colour: Rgb) -> TriangleMesh {
    TriangleMesh {
        vertices: [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]].map(DVec3::from).to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        appearance: Some(Arc::new(Appearance { vertex_colours: vec![colour; 4], ..Appearance::default() })),
    }
}

/// Both meshes as one.
fn joined(a: &TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let first = a.vertices.len() as u32;
    let colours = |mesh: &TriangleMesh| mesh.appearance.as_ref().unwrap().vertex_colours.clone();
    TriangleMesh {
        vertices: [&a.vertices[..], &b.vertices].concat(),
        normals: Vec::new(),
        triangles: a
            .triangles
            .iter()
            .copied()
            .chain(b.triangles.iter().map(|t| t.map(|v| v + first)))
            .collect(),
        appearance: Some(Arc::new(Appearance {
            vertex_colours: [colours(a), colours(b)].concat(),
            ..Appearance::default()
        })),
    }
}

fn cloud(points: &[([f64; 3], Rgb)]) -> PointCloud {
    PointCloud {
        positions: points.iter().map(|(position, _)| DVec3::from(*position)).collect(),
        colours: points.iter().map(|(_, colour)| *colour).collect(),
        ..PointCloud::default()
    }
}

/// A sphere with a texture of noise.
fn textured_sphere(seed: u64, radius: f64) -> TriangleMesh {
    let mut mesh = sphere(radius, 20);
    let mut random = SplitMix64::new(seed);
    let pixels = (0..64 * 64).map(|_| [0; 3].map(|_: u8| random.next_u64() as u8)).collect();
    let texture = Image::new(64, 64, pixels).map(Arc::new);
    let coordinate = |v: u32| {
        let DVec3 { x, y, z } = mesh.vertices[v as usize] / radius;
        [(x * 0.5 + 0.5) as f32, (y * 0.25 + z * 0.25 + 0.5) as f32]
    };
    mesh.appearance = Some(Arc::new(Appearance {
        texture_coordinates: mesh.triangles.iter().map(|t| t.map(coordinate)).collect(),
        materials: vec![Material { texture, ..Material::default() }],
        ..Appearance::default()
    }));
    mesh
}

/// PSNR of a mean squared error.
fn db(mse: f64) -> f64 {
    10.0 * (65025.0 / mse).log10()
}

#[track_caller]
fn near(found: Option<f64>, expected: f64, tolerance: f64) {
    let found = found.unwrap();
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected}");
}

#[test]
fn greys_ten_levels_apart_have_the_psnr_of_ten_levels() {
    let error = compare_colours(&square(0.0, [100; 3]), &square(0.001, [110; 3]), &options(0.02)).unwrap();
    near(error.colour_y_psnr_db, db(100.0), 1e-4);
    near(error.colour_ycc_psnr_db, db(6.0 * 100.0 / 8.0), 1e-4);
    near(error.colour_y_symmetric_psnr_db, db(100.0), 1e-4);
    near(error.colour_ycc_symmetric_psnr_db, db(75.0), 1e-4);
    near(error.render_y_psnr_db, db(100.0), 1e-4);
    let flat = (2.0 * 100.0 * 110.0 + 6.5025) / (100.0 * 100.0 + 110.0 * 110.0 + 6.5025);
    near(error.render_ssim, flat, 1e-3);
}

#[test]
fn chroma_counts_an_eighth_each() {
    let error =
        compare_colours(&square(0.0, [100; 3]), &square(0.0, [100, 100, 110]), &options(0.02)).unwrap();
    // Ten levels of blue are 0.722 of Y; Cb and Cr are the rest of blue and red, over 1.8556 and 1.5748.
    let [y, cb, cr] = [0.722, (10.0 - 0.722) / 1.8556, -0.722 / 1.5748];
    near(error.colour_y_psnr_db, db(y * y), 1e-4);
    near(error.colour_ycc_psnr_db, db((6.0 * y * y + cb * cb + cr * cr) / 8.0), 1e-4);
}

#[test]
fn a_perfect_copy_has_the_largest_figures() {
    let coloured = |colour| square(0.2, colour);
    let layered = joined(&coloured([255, 0, 0]), &square(0.203, [0, 0, 255]));
    for mesh in [textured_sphere(1, 0.5), coloured([1, 2, 3]), layered] {
        let error = compare_colours(&mesh, &mesh, &options(0.01)).unwrap();
        let most = Some(MAX_COLOUR_PSNR_DB);
        assert_eq!(error.colour_y_psnr_db, most);
        assert_eq!(error.colour_ycc_psnr_db, most);
        assert_eq!(error.colour_y_symmetric_psnr_db, most);
        assert_eq!(error.colour_ycc_symmetric_psnr_db, most);
        assert_eq!((error.render_y_psnr_db, error.render_ssim), (most, Some(1.0)));
    }
}

#[test]
fn other_noise_is_far_from_a_perfect_copy() {
    let error = compare_colours(&textured_sphere(1, 0.5), &textured_sphere(2, 0.5), &options(0.01)).unwrap();
    // Uniform noise of two sides is 255^2 / 6 apart a channel, and bilinear reading takes 5/9 of that off; Y adds squares of its shares.
    let expected = 65025.0 / 6.0 * 4.0 / 9.0 * (0.2126f64.powi(2) + 0.7152f64.powi(2) + 0.0722f64.powi(2));
    near(error.colour_y_psnr_db, db(expected), 0.5);
    near(error.render_y_psnr_db, db(expected), 0.5);
    assert!(error.render_ssim.unwrap() < 0.3, "{error:?}");
}

#[test]
fn pictures_do_not_depend_on_the_size_of_things() {
    let sized = |radius| {
        let [reference, test] = [1, 2].map(|seed| textured_sphere(seed, radius));
        compare_colours(&reference, &test, &options(radius / 20.0)).unwrap()
    };
    let [small, large] = [0.05, 50.0].map(sized);
    near(large.render_y_psnr_db, small.render_y_psnr_db.unwrap(), 0.01);
    near(large.render_ssim, small.render_ssim.unwrap(), 0.001);
}

#[test]
fn the_test_side_is_measured_where_it_is_and_both_sides_where_either_is() {
    // The test has the left of two squares alone; the right one has another colour, 5 m away.
    let mut right = square(0.0, [150; 3]);
    right.vertices.iter_mut().for_each(|v| v.x += 5.0);
    let reference = joined(&square(0.0, [100; 3]), &right);
    let error = compare_colours(&reference, &square(0.0, [100; 3]), &options(0.05)).unwrap();
    assert_eq!(error.colour_y_psnr_db, Some(MAX_COLOUR_PSNR_DB));
    // About half of the reference's samples lie on the right: 50 levels there.
    near(error.colour_y_symmetric_psnr_db, db(1250.0), 0.5);
    let reversed = compare_colours(&square(0.0, [100; 3]), &reference, &options(0.05)).unwrap();
    near(reversed.colour_y_psnr_db, db(1250.0), 0.5);
}

#[test]
fn a_hidden_layer_gives_no_colour() {
    // Cloth 3 mm over skin, decoded as one surface 1 mm over the skin, in the colour of the cloth.
    let [skin, cloth] = [square(0.0, [200, 150, 120]), square(0.003, [20, 40, 90])];
    let source = joined(&skin, &cloth);
    let decoded = square(0.001, [20, 40, 90]);
    let error = compare_colours(&source, &decoded, &options(0.02)).unwrap();
    assert_eq!(error.colour_y_psnr_db, Some(MAX_COLOUR_PSNR_DB));
    assert!(error.colour_y_symmetric_psnr_db.unwrap() < 20.0, "samples of the skin count there: {error:?}");
}

#[test]
fn points_have_the_mean_colour_of_the_nearest() {
    let reference = cloud(&[([0.0; 3], [100; 3]), ([2.0, 0.0, 0.0], [200; 3])]);
    let test = cloud(&[([1.0, 0.0, 0.0], [140; 3]), ([1.0, 0.0, 0.0], [255; 3])]);
    let error = compare_colours(&reference, &test, &options(0.01)).unwrap();
    // The test's first point lies between both: 150 against 140. From the reference: 40 and 60 off.
    near(error.colour_y_psnr_db, db(100.0), 1e-4);
    near(error.colour_y_symmetric_psnr_db, db((1600.0 + 3600.0) / 2.0), 1e-4);
    assert_eq!((error.render_y_psnr_db, error.render_ssim), (None, None));
}

#[test]
fn points_and_meshes_are_measured_against_each_other() {
    let points = cloud(&[([0.2, 0.2, 0.1], [104; 3]), ([0.7, 0.5, -0.1], [112; 3])]);
    let mesh = square(0.0, [100; 3]);
    let error = compare_colours(&mesh, &points, &options(0.01)).unwrap();
    near(error.colour_y_psnr_db, db((16.0 + 144.0) / 2.0), 1e-4);
    assert_eq!(error.render_ssim, None);
    let reversed = compare_colours(&points, &mesh, &options(0.01)).unwrap();
    // The other samples of the mesh make a little of a difference: each is 4 or 12 levels off.
    near(reversed.colour_y_symmetric_psnr_db, error.colour_y_symmetric_psnr_db.unwrap(), 0.1);
    near(reversed.colour_y_psnr_db, error.colour_y_symmetric_psnr_db.unwrap(), 0.1);
}

#[test]
fn without_colours_on_both_sides_there_are_no_figures() {
    let coloured = square(0.0, [100; 3]);
    let bare = TriangleMesh { appearance: None, ..coloured.clone() };
    let bare_points = PointCloud { positions: vec![DVec3::ZERO], ..PointCloud::default() };
    for error in [
        compare_colours(&coloured, &bare, &options(0.1)),
        compare_colours(&bare, &coloured, &options(0.1)),
        compare_colours(&bare_points, &coloured, &options(0.1)),
        compare_colours(&bare, &bare_points, &options(0.1)),
    ] {
        assert_eq!(error, Ok(ColourError::default()));
    }
    let nothing = TriangleMesh::default();
    let side = Side::Test;
    assert_eq!(compare_colours(&coloured, &nothing, &options(0.1)), Err(CompareError::NoSurface { side }));
    assert!(compare_colours(&coloured, &coloured, &options(0.0)).is_err());
}

#[test]
fn the_figures_are_the_keys_and_means_are_over_the_frames_that_have_them() {
    let with = |psnr: Option<f64>| ColourError { colour_y_psnr_db: psnr, ..ColourError::default() };
    let mean = colour_summary(&[with(Some(30.0)), with(None), with(Some(40.0))]);
    assert_eq!(mean, with(Some(35.0)));
    assert_eq!(colour_summary(&[]), ColourError::default());
    let json = serde_json::to_value(mean).unwrap();
    assert_eq!(json["colour_y_psnr_db"], 35.0);
    for key in ["colour_ycc_psnr_db", "render_y_psnr_db", "render_ssim"] {
        assert!(json.as_object().unwrap()[key].is_null(), "{key}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_figures() {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [reference, test] = [1, 2].map(|seed| textured_sphere(seed, 0.5));
        pool.install(|| compare_colours(&reference, &test, &options(0.02)).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}
