//! Pictures of meshes with colours that are known.

use glam::DVec3;
use isv_render::{Background, Camera, GREY, NormalKind, Picture, Shading, Style, render};
use isv_volume::{Appearance, Image, Material, Rgb, TriangleMesh};
use std::sync::Arc;

const COLOUR: Style =
    Style { background: Background::Transparent, shading: Shading::Colour, normals: NormalKind::Flat };

/// A square of 2 m in the plane z = 0, seen from +z, of `parts * parts` quads with one texture over all.
fn square(parts: u32, materials: Vec<Material>) -> TriangleMesh {
    let share = |i: u32| f64::from(i) / f64::from(parts);
    let vertices = (0..(parts + 1).pow(2))
        .map(|i| DVec3::new(2.0 * share(i % (parts + 1)) - 1.0, 1.0 - 2.0 * share(i / (parts + 1)), 0.0))
        .collect::<Vec<_>>();
    let quads = (0..parts.pow(2)).map(|i| i / parts * (parts + 1) + i % parts);
    let triangles: Vec<[u32; 3]> = quads
        .flat_map(|upper| {
            let lower = upper + parts + 1;
            [[upper, lower, lower + 1], [upper, lower + 1, upper + 1]]
        })
        .collect();
    let coordinate = |v: u32| {
        let DVec3 { x, y, .. } = vertices[v as usize];
        [((x + 1.0) / 2.0) as f32, ((1.0 - y) / 2.0) as f32]
    };
    let appearance = Appearance {
        texture_coordinates: triangles.iter().map(|t| t.map(coordinate)).collect(),
        materials,
        ..Appearance::default()
    };
    TriangleMesh { vertices, normals: vec![], triangles, appearance: Some(Arc::new(appearance)) }
}

fn textured(side: u32, texel: impl Fn(u32, u32) -> Rgb) -> Vec<Material> {
    let pixels = (0..side * side).map(|i| texel(i % side, i / side)).collect();
    let texture = Image::new(side, side, pixels).map(Arc::new);
    vec![Material { texture, ..Material::default() }]
}

/// A colour of its own for each texel of a 4 x 4 image.
fn own_colour(x: u32, y: u32) -> Rgb {
    [60 * x as u8, 60 * y as u8, 200]
}

/// A parallel view of the square, whose 2 m are 184 of the 200 pixels.
fn camera() -> Camera {
    Camera { opening_degrees: 0.0, ..Camera::fitting((DVec3::NEG_ONE, DVec3::ONE), [200, 200]) }
}

fn rgb(picture: &Picture, [x, y]: [usize; 2]) -> Rgb {
    let [r, g, b, _] = picture.pixel(x, y);
    [r, g, b]
}

/// Largest difference of two colours in a channel.
fn apart(a: Rgb, b: Rgb) -> u8 {
    (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap()
}

#[test]
fn a_texture_lies_where_its_coordinates_say() {
    let picture = render(&square(1, textured(4, own_colour)), &camera(), &COLOUR);
    for y in 0..4 {
        for x in 0..4 {
            // Texels are 46 pixels wide; their middles lie at 8 + 23 + 46 k, between two pixels.
            let at = [x, y].map(|i| 31 + 46 * i as usize);
            assert!(apart(rgb(&picture, at), own_colour(x, y)) <= 1, "{x} {y}: {:?}", rgb(&picture, at));
        }
    }
    // Halfway between the middles of two texels is their mean.
    assert!(apart(rgb(&picture, [54, 31]), [30, 0, 200]) <= 1);
}

#[test]
fn large_triangles_look_like_small_ones_in_perspective() {
    let texture = |x: u32, y: u32| {
        [(x * 8) as u8, (y * 8) as u8, if (x / 4 + y / 4).is_multiple_of(2) { 40 } else { 200 }]
    };
    let steep = Camera { opening_degrees: 100.0, ..camera() }.from_direction(55.0, 25.0);
    let [large, small] = [1, 64].map(|parts| render(&square(parts, textured(32, texture)), &steep, &COLOUR));
    let covered = |p: &Picture| p.rgba().chunks(4).filter(|p| p[3] == 255).count();
    assert!(covered(&large) > 5000);
    let pairs =
        large.rgba().chunks(4).zip(small.rgba().chunks(4)).filter(|(a, b)| a[3] == 255 && b[3] == 255);
    let worst = pairs.map(|(a, b)| apart([a[0], a[1], a[2]], [b[0], b[1], b[2]])).max();
    assert!(worst.unwrap() <= 2, "{worst:?}");
}

#[test]
fn vertex_colours_are_mixed_by_their_weights() {
    let mut mesh = square(1, vec![]);
    mesh.appearance = Some(Arc::new(Appearance {
        vertex_colours: vec![[0, 0, 0], [200, 0, 0], [0, 200, 0], [200, 200, 0]],
        ..Appearance::default()
    }));
    let picture = render(&mesh, &camera(), &COLOUR);
    for [x, y] in [[0.5, 0.5], [0.25, 0.75], [0.9, 0.1]] {
        let at = [x, y].map(|share: f64| (8.0 + 184.0 * share) as usize);
        let [red, green] = at.map(|pixel| ((pixel as f64 + 0.5 - 8.0) / 184.0 * 200.0) as u8);
        assert!(apart(rgb(&picture, at), [red, green, 0]) <= 1, "{at:?}: {:?}", rgb(&picture, at));
    }
}

#[test]
fn materials_tint_and_faces_choose_them() {
    let plain = |base_colour| Material { base_colour, ..Material::default() };
    let mut mesh = square(1, vec![plain([0.5, 1.0, 0.0]), plain([1.0, 0.0, 0.0])]);
    let appearance =
        Appearance { face_materials: vec![1, 0], ..mesh.appearance.as_deref().cloned().unwrap() };
    mesh.appearance = Some(Arc::new(appearance));
    let picture = render(&mesh, &camera(), &COLOUR);
    assert_eq!(rgb(&picture, [50, 150]), [255, 0, 0]);
    // Half of the light is the sRGB value 187.5.
    assert!(apart(rgb(&picture, [150, 50]), [188, 255, 0]) <= 1);
}

#[test]
fn colours_without_light_are_the_same_from_everywhere() {
    let mesh = square(1, textured(1, |_, _| [10, 120, 230]));
    for yaw in [0.0, 50.0, 75.0, 180.0, 255.0] {
        let seen_from = |shading| {
            rgb(&render(&mesh, &camera().from_direction(yaw, 0.0), &Style { shading, ..COLOUR }), [100, 100])
        };
        assert_eq!(seen_from(Shading::Colour), [10, 120, 230], "{yaw}");
        let facing = f64::cos(f64::to_radians(yaw)).abs();
        let lit = [10.0, 120.0, 230.0].map(|c| (c * (0.7 + 0.3 * facing)).round() as u8);
        assert!(apart(seen_from(Shading::LitColour), lit) <= 1, "{yaw}");
    }
}

#[test]
fn meshes_without_colours_are_grey_from_both_sides() {
    let mut mesh = square(1, vec![]);
    mesh.appearance = None;
    let looks = [Shading::Shaded, Shading::Colour, Shading::LitColour];
    let [front, back] = [0.0, 180.0].map(|yaw| {
        let picture =
            |shading| render(&mesh, &camera().from_direction(yaw, 0.0), &Style { shading, ..COLOUR });
        let [shaded, colour, lit] = looks.map(picture);
        assert!(shaded == colour && shaded == lit);
        rgb(&shaded, [100, 100])
    });
    assert_eq!((front, back), (GREY, GREY));
}

/// The colour of one texture on all sides of a cube is seen in every covered pixel: no seam lets another through.
#[test]
fn edges_between_textured_faces_show_no_seam() {
    let mut cube = isv_testkit::cube(1.0);
    cube.appearance = Some(Arc::new(Appearance {
        texture_coordinates: vec![[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]; cube.triangles.len()],
        materials: textured(8, |_, _| [10, 200, 90]),
        ..Appearance::default()
    }));
    for (yaw, pitch) in [(0.0, 0.0), (30.0, 20.0), (-75.0, -40.0), (45.0, 0.0)] {
        let camera = Camera::fitting(cube.bounds().unwrap(), [150, 150]).from_direction(yaw, pitch);
        let picture = render(&cube, &camera, &COLOUR);
        let covered = picture.rgba().chunks(4).filter(|p| p[3] > 0);
        assert!(covered.clone().count() > 5000);
        assert!(covered.clone().all(|p| p[..3] == [10, 200, 90]), "{yaw} {pitch}");
        let transparent = |at: usize| (1..200).contains(&picture.rgba()[4 * at + 3]);
        let inside = (0..150 * 150).filter(|at| {
            let rows = [at - at.min(&150), at - at.min(&1), (at + 1).min(22_499), (at + 150).min(22_499)];
            transparent(*at) && rows.into_iter().all(|n| picture.rgba()[4 * n + 3] == 255)
        });
        assert_eq!(inside.count(), 0, "holes at {yaw} {pitch}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    let mesh = square(8, textured(32, |x, y| [(x * 8) as u8, (y * 8) as u8, 77]));
    let camera = Camera { opening_degrees: 60.0, ..camera() }.from_direction(20.0, 10.0);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&mesh, &camera, &Style { shading: Shading::LitColour, ..COLOUR }))
    };
    assert_eq!(with_threads(1), with_threads(3));
}
