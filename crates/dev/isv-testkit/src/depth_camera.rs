//! Depth and colour cameras that look at a mesh.

use glam::{DMat3, DVec2, DVec3};
use isv_volume::{CameraPose, DepthImage, Image, Intrinsics, Rgb, TriangleMesh};

/// Triangles with a corner nearer to the camera's plane than this are not drawn, in metres.
const NEAR_M: f64 = 1e-3;

/// Image that a perfect depth camera sees of a mesh, from either side of its triangles. At the centre of each
/// pixel it has the depth of the first triangle on the ray, or no reading. Triangles that reach behind the
/// camera are left out whole.
///
/// # Panics
/// If the intrinsics are not valid.
#[must_use]
pub fn render_depth(mesh: &TriangleMesh, intrinsics: &Intrinsics, pose: &CameraPose) -> DepthImage {
    let depth = |seen: &Seen| if seen.inverse > 0.0 { (1.0 / seen.inverse) as f32 } else { 0.0 };
    let depths = draw_mesh(mesh, intrinsics, pose).iter().map(depth).collect();
    DepthImage::new(*intrinsics, *pose, depths).expect("valid intrinsics")
}

/// Draws what a perfect colour camera sees of a mesh, from either side of its triangles and without light.
///
/// A pixel has the colour of the first triangle on the ray through its centre, or a background. A mesh without an appearance is white.
///
/// # Panics
/// If the intrinsics are not valid.
#[must_use]
pub fn render_colours(
    mesh: &TriangleMesh,
    intrinsics: &Intrinsics,
    pose: &CameraPose,
    background: Rgb,
) -> Image {
    let own = mesh.appearance.clone().unwrap_or_default();
    let colour = |seen: &Seen| match seen.inverse > 0.0 {
        true => own
            .colour(seen.face, mesh.triangles[seen.face], seen.weights.map(|weight| weight as f32))
            .map(|channel| channel.round() as u8),
        false => background,
    };
    let pixels = draw_mesh(mesh, intrinsics, pose).iter().map(colour).collect();
    Image::new(intrinsics.width, intrinsics.height, pixels).expect("valid intrinsics")
}

/// The surface in a pixel.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Inverse depth; 0 where there is no surface.
    inverse: f64,
    face: usize,
    /// Weights of the face's corners, in space.
    weights: [f64; 3],
}

/// The first triangle in each pixel.
fn draw_mesh(mesh: &TriangleMesh, intrinsics: &Intrinsics, pose: &CameraPose) -> Vec<Seen> {
    let mut nearest = vec![Seen::default(); intrinsics.pixels()];
    let points: Vec<DVec3> = mesh.vertices.iter().map(|v| pose.to_camera(*v)).collect();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let corners = triangle.map(|v| points[v as usize]);
        if corners.iter().all(|p| p.z > NEAR_M) {
            draw(&mut nearest, intrinsics, face, &corners);
        }
    }
    nearest
}

/// Draws a triangle in camera coordinates. The inverse of depth is affine over the image, which makes it exact.
fn draw(nearest: &mut [Seen], intrinsics: &Intrinsics, face: usize, corners: &[DVec3; 3]) {
    let [a, b, c] = corners.map(|p| intrinsics.project(p));
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return;
    }
    let last = DVec2::new(f64::from(intrinsics.width) - 1.0, f64::from(intrinsics.height) - 1.0);
    let low = a.min(b).min(c).ceil().max(DVec2::ZERO);
    let high = a.max(b).max(c).floor().min(last);
    if low.x > high.x || low.y > high.y {
        return;
    }
    for row in low.y as u32..=high.y as u32 {
        for column in low.x as u32..=high.x as u32 {
            let p = DVec2::new(f64::from(column), f64::from(row));
            let weights = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)];
            if weights.iter().all(|w| w * area >= 0.0) {
                let shares = [0, 1, 2].map(|i| weights[i] / area / corners[i].z);
                let inverse: f64 = shares.iter().sum();
                let pixel = &mut nearest[row as usize * intrinsics.width as usize + column as usize];
                if inverse > pixel.inverse {
                    *pixel = Seen { inverse, face, weights: shares.map(|share| share / inverse) };
                }
            }
        }
    }
}

/// The pose of a camera that looks from one point at another, y up in the world.
///
/// # Panics
/// If it looks straight up or down, or nowhere.
#[must_use]
pub fn look_at(from: DVec3, to: DVec3) -> CameraPose {
    let forward = (to - from).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    assert!(right.is_finite(), "no horizon to stand upright by");
    CameraPose { rotation: DMat3::from_cols(right, forward.cross(right), forward), centre: from }
}

/// Eight cameras around a bounding box, as captures place them, 45 degrees apart. By turns they stand a
/// quarter of the distance below and above the box's centre, which all of them look at. They are so far away
/// that the box fits each image.
#[must_use]
pub fn camera_ring((low, high): (DVec3, DVec3), intrinsics: &Intrinsics) -> [CameraPose; 8] {
    let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
    let size = DVec2::new(f64::from(intrinsics.width), f64::from(intrinsics.height));
    let half_view = (size / 2.0 / intrinsics.focal).min_element().atan();
    let distance = radius / half_view.sin();
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
        let turn = f64::from(i) * std::f64::consts::FRAC_PI_4;
        let height = if i % 2 == 0 { -0.25 } else { 0.25 };
        let direction = DVec3::new(turn.sin(), height, turn.cos()).normalize();
        look_at(centre + direction * distance, centre)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cube, sphere};

    const LENS: Intrinsics =
        Intrinsics { width: 64, height: 48, focal: DVec2::splat(50.0), principal: DVec2::new(31.25, 23.25) };

    #[test]
    fn a_face_of_a_cube_is_seen_at_its_depth_and_hides_the_rest() {
        let image = render_depth(&cube(1.0), &LENS, &look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO));
        assert_eq!(image.depth_m(31, 23), Some(4.0));
        assert_eq!(image.depth_m(0, 0), None);
        // 2 m at 4 m with a focal length of 50 pixels: 25 pixels wide.
        assert_eq!(image.readings(), 25 * 25);
        assert!(image.depths_m().iter().all(|d| *d == 0.0 || (d - 4.0).abs() < 1e-6));
    }

    #[test]
    fn every_camera_of_a_ring_sees_the_whole_sphere_upright() {
        let ball = sphere(1.0, 40);
        for pose in camera_ring(ball.bounds().unwrap(), &LENS) {
            let image = render_depth(&ball, &LENS, &pose);
            let edge = |c, r| image.depth_m(c, r).is_some();
            assert!((0..64).all(|c| !edge(c, 0) && !edge(c, 47)), "cut off");
            assert!(image.readings() > 200);
            assert!(pose.to_camera(pose.centre + DVec3::Y).y < -0.9, "y points down in the image");
            for (pixel, depth) in image.depths_m().iter().enumerate().filter(|(_, d)| **d > 0.0) {
                let at = DVec2::new((pixel % 64) as f64, (pixel / 64) as f64);
                let point = pose.to_world(LENS.unproject(at, f64::from(*depth)));
                assert!((point.length() - 1.0).abs() < 0.003, "{point}");
            }
        }
    }

    #[test]
    fn what_reaches_behind_the_camera_is_not_drawn() {
        let image = render_depth(&cube(1.0), &LENS, &look_at(DVec3::ZERO, DVec3::Z));
        assert_eq!(image.depth_m(31, 23), Some(1.0));
        let behind = render_depth(&cube(1.0), &LENS, &look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::Z * 9.0));
        assert_eq!(behind.readings(), 0);
    }
}
