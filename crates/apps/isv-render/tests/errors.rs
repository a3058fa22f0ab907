//! Pictures of errors whose size is known.

use glam::DVec3;
use isv_render::{
    BEYOND_RANGE, Background, Camera, ErrorScale, NormalKind, Picture, Shading, Style, render_errors,
};
use isv_volume::TriangleMesh;

const STYLE: Style =
    Style { background: Background::Transparent, shading: Shading::Normals, normals: NormalKind::Flat };

/// A square of 2 m in the plane z = 0, of two large triangles, seen from +z.
fn square() -> TriangleMesh {
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    TriangleMesh {
        vertices: corners.map(DVec3::from).to_vec(),
        normals: vec![],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        appearance: None,
    }
}

fn camera() -> Camera {
    Camera::fitting((DVec3::NEG_ONE, DVec3::ONE), [200, 200])
}

fn scale() -> ErrorScale {
    ErrorScale::new(0.002).unwrap()
}

fn rgb(picture: &Picture, [x, y]: [usize; 2]) -> [u8; 3] {
    let [r, g, b, _] = picture.pixel(x, y);
    [r, g, b]
}

#[test]
fn a_plane_that_was_moved_has_the_colour_of_its_way() {
    for (way_m, colour) in [(0.001, [253, 141, 60]), (0.0, [255, 255, 204]), (0.003, BEYOND_RANGE)] {
        let drawn = render_errors(&square(), &camera(), &STYLE, &scale(), |point| (point.z - way_m).abs());
        for at in [[100, 100], [60, 140], [141, 60]] {
            assert_eq!(rgb(&drawn.picture, at), colour, "{way_m} m at {at:?}");
        }
        let seen = drawn.seen.unwrap();
        assert!((seen.mean_m - way_m).abs() < 1e-6 && (seen.max_m - way_m).abs() < 1e-6, "{seen:?}");
    }
}

#[test]
fn errors_are_those_of_the_point_in_the_pixel_not_of_the_vertices() {
    // At all four vertices the error is 0.
    let error_m = |point: DVec3| if point.x.abs() < 0.5 { 0.001 } else { 0.0 };
    let camera = camera().from_direction(25.0, 40.0);
    let drawn = render_errors(&square(), &camera, &STYLE, &scale(), error_m);
    let seen = drawn.seen.unwrap();
    assert!((seen.mean_m - 0.0005).abs() < 0.0001, "half of the square: {seen:?}");
    let [middle, side] = [[100, 100], [63, 89]].map(|at| rgb(&drawn.picture, at).map(u32::from));
    assert!(middle[1] < middle[0] * 2 / 3, "orange: {middle:?}");
    assert!(side[1] > side[0] * 9 / 10, "yellow: {side:?}");
}

#[test]
fn points_of_pixels_lie_on_the_surface() {
    let camera = camera().from_direction(-60.0, 30.0);
    let drawn = render_errors(&square(), &camera, &STYLE, &scale(), |point| {
        let outside = (point.x.abs() - 1.0).max(point.y.abs() - 1.0).max(0.0);
        point.z.abs().max(outside)
    });
    assert!(drawn.seen.unwrap().max_m < 1e-5, "{:?}", drawn.seen);
}

#[test]
fn slanted_surfaces_are_darker_and_both_sides_alike() {
    let slanted = |yaw| {
        render_errors(&square(), &camera().from_direction(yaw, 0.0), &STYLE, &scale(), |_| 0.001).picture
    };
    let [facing, front, back] = [slanted(0.0), slanted(60.0), slanted(240.0)].map(|p| rgb(&p, [100, 100]));
    assert!(front[0] < facing[0] && front[0] > facing[0] / 2, "{facing:?} {front:?}");
    assert_eq!(front, back);
}

#[test]
fn nothing_seen_has_no_errors() {
    let nothing = TriangleMesh { vertices: vec![], normals: vec![], triangles: vec![], appearance: None };
    let drawn = render_errors(&nothing, &camera(), &STYLE, &scale(), |_| 1.0);
    assert_eq!(drawn.seen, None);
    assert!(drawn.picture.rgba().iter().all(|byte| *byte == 0));
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    let camera = camera().from_direction(20.0, 10.0);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render_errors(&square(), &camera, &STYLE, &scale(), |p| p.length() / 1000.0))
    };
    assert_eq!(with_threads(1), with_threads(3));
}
