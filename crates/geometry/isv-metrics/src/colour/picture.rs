//! Pictures of a mesh's colours, without light, one ray a pixel.

use super::cameras::{Camera, SIZE, Seen};
use isv_volume::{Appearance, TriangleMesh, ycbcr_from_rgb};

/// Y of pixels that show nothing: a grey, so that SSIM sees no contrast that neither side has.
pub(super) const BACKGROUND: f64 = 128.0;

/// Y of each pixel, row after row from the top; none where nothing is seen.
pub(super) type Picture = Vec<Option<f64>>;

/// The surface seen in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Visible {
    pub(super) face: u32,
    /// Weights of the face's corners, in space.
    pub(super) weights: [f64; 3],
    inverse_depth: f64,
}

/// Draws a mesh in its colours, both sides of each face. A mesh without an appearance is white.
pub(super) fn draw(mesh: &TriangleMesh, camera: &Camera) -> Picture {
    let white = Appearance::default();
    let appearance = mesh.appearance.as_deref().unwrap_or(&white);
    let colour = |pixel: &Visible| {
        let weights = pixel.weights.map(|weight| weight as f32);
        let face = pixel.face as usize;
        ycbcr_from_rgb(appearance.colour(face, mesh.triangles[face], weights))[0]
    };
    visible(mesh, camera).iter().map(|pixel| pixel.as_ref().map(colour)).collect()
}

/// The surface that is seen through the middle of each pixel. A face with a corner behind the eye, which no face inside the camera's box
/// has, is not drawn.
pub(super) fn visible(mesh: &TriangleMesh, camera: &Camera) -> Vec<Option<Visible>> {
    let vertices: Vec<Option<Seen>> = mesh.vertices.iter().map(|v| camera.project(*v)).collect();
    let mut pixels = vec![None; SIZE[0] * SIZE[1]];
    for (face, triangle) in (0u32..).zip(&mesh.triangles) {
        if let [Some(a), Some(b), Some(c)] = triangle.map(|vertex| vertices[vertex as usize]) {
            draw_face(face, [a, b, c], &mut pixels);
        }
    }
    pixels
}

/// Draws a face where it is nearer than what was drawn before.
fn draw_face(face: u32, corners: [Seen; 3], pixels: &mut [Option<Visible>]) {
    let [a, b, c] = corners.map(|corner| corner.place);
    let area =
        |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let all = area(a, b, c);
    if all == 0.0 || !all.is_finite() {
        return;
    }
    // Pixels whose middle may lie inside; casts stop at 0.
    let span = |axis: usize| {
        let [from, to] = [a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis])];
        ((from - 0.5).ceil() as usize)..((to + 0.5).floor() as usize).min(SIZE[axis])
    };
    for y in span(1) {
        for x in span(0) {
            let at = [x as f64 + 0.5, y as f64 + 0.5];
            let [to_a, to_b, to_c] = [area(b, c, at) / all, area(c, a, at) / all, area(a, b, at) / all];
            if to_a < 0.0 || to_b < 0.0 || to_c < 0.0 {
                continue;
            }
            let [a, b, c] = corners;
            let shares = [to_a * a.inverse_depth, to_b * b.inverse_depth, to_c * c.inverse_depth];
            let inverse_depth = shares[0] + shares[1] + shares[2];
            let pixel = &mut pixels[y * SIZE[0] + x];
            if pixel.is_none_or(|before| inverse_depth > before.inverse_depth) {
                *pixel =
                    Some(Visible { face, weights: shares.map(|share| share / inverse_depth), inverse_depth });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use isv_spatial::{Bvh, Ray};
    use isv_testkit::{soup, sphere};

    /// Each pixel shows what a ray through its middle meets first.
    #[test]
    fn pixels_show_what_rays_meet() {
        let mut moved = soup(3, 60);
        moved.vertices.iter_mut().for_each(|v| *v = *v * 0.7 + DVec3::new(0.0, 0.0, 1.0));
        for mesh in [sphere(0.8, 12), soup(7, 40), moved] {
            let bvh = Bvh::new(&mesh);
            let [_, camera, ..] = Camera::ring((DVec3::NEG_ONE, DVec3::ONE));
            let pixels = visible(&mesh, &camera);
            let mut covered = 0;
            for (at, pixel) in pixels.iter().enumerate().step_by(7) {
                let direction = camera.direction([at % SIZE[0], at / SIZE[0]]);
                let hit = bvh.first_hit(&Ray { origin: camera.eye, direction }, f64::INFINITY);
                assert_eq!(hit.is_some(), pixel.is_some(), "{at}");
                let (Some(hit), Some(pixel)) = (hit, pixel) else { continue };
                covered += 1;
                let corners = mesh.corners(pixel.face as usize);
                let point: DVec3 = (0..3).map(|i| corners[i] * pixel.weights[i]).sum();
                let met = camera.eye + direction * hit.distance;
                assert!(point.distance(met) < 1e-9, "{at}: {point} {met}");
            }
            assert!(covered > 400, "{covered}");
        }
    }

    #[test]
    fn faces_around_the_eye_are_left_out() {
        let [camera, ..] = Camera::ring((DVec3::NEG_ONE, DVec3::ONE));
        let mut mesh = sphere(0.5, 8);
        let alone = visible(&mesh, &camera);
        mesh.vertices.push(camera.eye * 2.0);
        mesh.triangles.push([0, 1, mesh.vertices.len() as u32 - 1]);
        assert_eq!(visible(&mesh, &camera), alone);
    }
}
