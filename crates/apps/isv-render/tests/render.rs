//! Pictures of shapes whose look is known.

use glam::DVec3;
use isv_render::{BACK_FACE, Background, Camera, NormalKind, Picture, Shading, Style, render};
use isv_volume::TriangleMesh;
use std::f64::consts::{PI, TAU};

const TRANSPARENT: Style =
    Style { background: Background::Transparent, shading: Shading::Normals, normals: NormalKind::Smooth };

/// A unit sphere in rings about the y axis.
fn sphere() -> TriangleMesh {
    let (rings, sides) = (60, 120);
    let vertices = (0..=rings)
        .flat_map(|ring| {
            let (sin, cos) = (PI * f64::from(ring) / f64::from(rings)).sin_cos();
            (0..sides).map(move |side| {
                let angle = TAU * f64::from(side) / f64::from(sides);
                DVec3::new(sin * angle.sin(), cos, sin * angle.cos())
            })
        })
        .collect();
    let triangles = (0..rings * sides)
        .flat_map(|i| {
            let next = i / sides * sides + (i + 1) % sides;
            [[i, i + sides, next + sides], [i, next + sides, next]]
        })
        .collect();
    TriangleMesh { vertices, normals: vec![], triangles, appearance: None }
}

fn camera() -> Camera {
    Camera { opening_degrees: 0.0, ..Camera::fitting((DVec3::NEG_ONE, DVec3::ONE), [200, 200]) }
}

fn near(picture: &Picture, [x, y]: [usize; 2], expected: [u8; 3]) {
    let [r, g, b, _] = picture.pixel(x, y);
    let worst = [r, g, b].iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max().unwrap();
    assert!(worst <= 3, "{:?} at ({x}, {y}), expected {expected:?}", [r, g, b]);
}

#[test]
fn a_sphere_covers_its_disc() {
    let picture = render(&sphere(), &camera(), &TRANSPARENT);
    let covered: f64 = picture.rgba().chunks(4).map(|p| f64::from(p[3]) / 255.0).sum();
    // The box is 92 % of the picture: a radius of 92 pixels.
    let disc = PI * 92.0 * 92.0;
    assert!((covered / disc - 1.0).abs() < 2e-3, "{covered} pixels, not {disc}");
}

#[test]
fn colours_are_normals_in_the_light_of_the_camera() {
    let picture = render(&sphere(), &camera(), &TRANSPARENT);
    near(&picture, [100, 100], [128, 128, 255]);
    // At 3/5 of the radius the normal is (3, 0, 4) / 5, and a fifth of half the light is lost.
    near(&picture, [155, 100], [184, 115, 207]);
    near(&picture, [100, 44], [115, 184, 207]);
    let from_right = render(&sphere(), &camera().from_direction(90.0, 0.0), &TRANSPARENT);
    near(&from_right, [100, 100], [255, 128, 128]);
}

#[test]
fn flipped_faces_have_their_own_colour() {
    let mut mesh = sphere();
    mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    near(&render(&mesh, &camera(), &TRANSPARENT), [100, 100], BACK_FACE);
}

#[test]
fn the_nearer_surface_hides_the_farther() {
    let mut mesh = sphere();
    let far = mesh.vertices.len() as u32;
    let moved: Vec<_> = mesh.vertices.iter().map(|v| *v * 0.5 + DVec3::new(0.0, 0.0, -2.0)).collect();
    let second: Vec<_> = mesh.triangles.iter().map(|t| t.map(|v| v + far)).collect();
    mesh.vertices.extend(moved);
    mesh.triangles.extend(second);
    assert_eq!(render(&mesh, &camera(), &TRANSPARENT), render(&sphere(), &camera(), &TRANSPARENT));
}

#[test]
fn backgrounds_fill_what_is_not_covered() {
    for background in [Background::Light, Background::Dark, Background::Transparent] {
        let picture = render(&sphere(), &camera(), &Style { background, ..Style::default() });
        assert_eq!(picture.pixel(0, 0), background.rgba());
        assert_eq!(picture.pixel(100, 100)[3], 255);
    }
}

#[test]
fn flat_shading_gives_each_face_one_colour() {
    let mesh = TriangleMesh {
        vertices: vec![DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::new(0.0, 1.0, 0.0)],
        normals: vec![DVec3::X, DVec3::Y, DVec3::Z],
        triangles: vec![[0, 1, 2]],
        appearance: None,
    };
    let style = Style { normals: NormalKind::Flat, ..TRANSPARENT };
    let picture = render(&mesh, &camera(), &style);
    near(&picture, [100, 100], [128, 128, 255]);
    near(&picture, [60, 150], [128, 128, 255]);
}

#[test]
fn a_camera_in_orbit_takes_every_picture_as_one_that_was_set_up_there() {
    let mut mesh = sphere();
    mesh.vertices.iter_mut().for_each(|v| *v *= DVec3::new(1.0, 0.5, 0.25));
    let camera = Camera::fitting(mesh.bounds().unwrap(), [120, 100]).in_orbit();
    let [there, back] =
        [50.0, 410.0].map(|yaw| render(&mesh, &camera.from_direction(yaw, 20.0), &TRANSPARENT));
    let differ = there.rgba().iter().zip(back.rgba()).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    assert!(differ < 8, "{differ} channels differ after a whole turn");
    let still = Camera { yaw_degrees: 50.0, pitch_degrees: 20.0, ..camera };
    assert_eq!(render(&mesh, &still, &TRANSPARENT), there);
    let wide = Camera::fitting(mesh.bounds().unwrap(), [120, 100]).from_direction(90.0, 20.0);
    let covered = |picture: &Picture| picture.rgba().chunks(4).filter(|p| p[3] > 0).count();
    let turned = render(&mesh, &camera.from_direction(90.0, 20.0), &TRANSPARENT);
    assert!(covered(&render(&mesh, &wide, &TRANSPARENT)) > covered(&turned), "alone it could be larger");
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&sphere(), &camera().from_direction(20.0, 10.0), &Style::default()))
    };
    assert_eq!(with_threads(1), with_threads(3));
}
