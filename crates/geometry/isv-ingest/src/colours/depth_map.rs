//! Depth of a surface as a camera sees it, with what lies around each pixel.

use glam::{DVec2, DVec3};
use isv_volume::{CameraPose, Intrinsics, TriangleMesh};

/// Largest width and height of a map (pixels). Larger images get a coarser map.
const MOST_SIDE: u32 = 1024;

/// Faces with a corner nearer to the camera's plane than this are not drawn (m).
const NEAR_M: f64 = 1e-3;

/// Least and largest radius around a pixel that is looked at for jumps in depth, in pixels of the map.
const RADII: [usize; 2] = [2, 8];

/// Inverse depths of a surface in the image of a camera.
#[derive(Debug)]
pub(super) struct DepthMap {
    lens: Intrinsics,
    pose: CameraPose,
    /// Radius of the surroundings that the limits are of, in pixels.
    radius: usize,
    /// Largest and least inverse depth around each pixel (1/m); 0 where there is no surface.
    limits: Vec<[f32; 2]>,
}

impl DepthMap {
    /// Draws a mesh, both sides of its faces. `detail_m`: size of what the mesh may be wrong by; `extra`: pixels of the image by which
    /// the camera may be wrong.
    pub(super) fn new(
        mesh: &TriangleMesh,
        lens: &Intrinsics,
        pose: &CameraPose,
        detail_m: f64,
        extra: usize,
    ) -> Self {
        let scale = (f64::from(MOST_SIDE) / f64::from(lens.width.max(lens.height))).min(1.0);
        let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
        let lens = Intrinsics {
            width: side(lens.width),
            height: side(lens.height),
            focal: lens.focal * scale,
            principal: (lens.principal + 0.5) * scale - 0.5,
        };
        let nearest = draw(mesh, &lens, pose);
        let (mut sum, mut count) = (0.0, 0.0f64);
        for inverse in nearest.iter().filter(|inverse| **inverse > 0.0) {
            sum += f64::from(*inverse);
            count += 1.0;
        }
        // Pixels to a detail in the middle of what is seen.
        let detail = lens.focal.max_element() * detail_m * sum / count.max(1.0);
        let [least, most] = RADII;
        let radius = (detail.round().min(most as f64) as usize + 1).clamp(least, most);
        let radius = radius + (extra as f64 * scale).ceil() as usize;
        let limits = surroundings(&nearest, lens.width as usize, radius);
        Self { lens, pose: *pose, radius, limits }
    }

    /// Whether a point of the surface is seen, and no jump in depth is near it. `tolerance_m`: distance along the view that counts as
    /// none.
    pub(super) fn shows(&self, point: DVec3, normal: DVec3, tolerance_m: f64) -> bool {
        let p = self.pose.to_camera(point);
        if p.z <= NEAR_M {
            return false;
        }
        let place = self.lens.project(p).round();
        let last = DVec2::new(f64::from(self.lens.width) - 1.0, f64::from(self.lens.height) - 1.0);
        if !(place.cmpge(DVec2::ZERO).all() && place.cmple(last).all()) {
            return false;
        }
        let [nearest, farthest] =
            self.limits[place.y as usize * self.lens.width as usize + place.x as usize].map(f64::from);
        let slant = slant(&self.lens, &self.pose, p, normal);
        let allowed = slant * (self.radius as f64 + 0.5) + tolerance_m / (p.z * p.z);
        let inverse = 1.0 / p.z;
        nearest <= inverse + allowed && farthest >= inverse - allowed
    }
}

/// How much the inverse depth of the plane through a point changes from pixel to pixel, the largest in a step along both axes (1/m). `p` is
/// the point in camera coordinates.
pub(super) fn slant(lens: &Intrinsics, pose: &CameraPose, p: DVec3, normal: DVec3) -> f64 {
    let normal = pose.rotation.transpose() * normal;
    let along = normal.truncate().abs() / lens.focal;
    (along.x + along.y) / normal.dot(p).abs().max(1e-6 * p.z)
}

/// The largest inverse depth in each pixel (1/m); 0 where no face is.
fn draw(mesh: &TriangleMesh, lens: &Intrinsics, pose: &CameraPose) -> Vec<f32> {
    let mut nearest = vec![0.0f32; lens.pixels()];
    let points: Vec<DVec3> = mesh.vertices.iter().map(|v| pose.to_camera(*v)).collect();
    let last = DVec2::new(f64::from(lens.width) - 1.0, f64::from(lens.height) - 1.0);
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| points[v as usize]);
        // What is not a number is no place either.
        if !corners.iter().all(|p| p.z > NEAR_M) {
            continue;
        }
        let [a, b, c] = corners.map(|p| lens.project(p));
        let area = (b - a).perp_dot(c - a);
        let low = a.min(b).min(c).ceil().max(DVec2::ZERO);
        let high = a.max(b).max(c).floor().min(last);
        if area == 0.0 || !area.is_finite() || low.x > high.x || low.y > high.y {
            continue;
        }
        let inverse = corners.map(|p| 1.0 / p.z / area);
        for row in low.y as usize..=high.y as usize {
            let pixels = &mut nearest[row * lens.width as usize..][..lens.width as usize];
            for (column, pixel) in
                pixels.iter_mut().enumerate().take(high.x as usize + 1).skip(low.x as usize)
            {
                let p = DVec2::new(column as f64, row as f64);
                let weights = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)];
                if weights.iter().all(|w| w * area >= 0.0) {
                    let here: f64 = (0..3).map(|i| weights[i] * inverse[i]).sum();
                    *pixel = pixel.max(here as f32);
                }
            }
        }
    }
    nearest
}

/// The largest and the least value of the square around each pixel, as far as it lies in the image.
fn surroundings(values: &[f32], width: usize, radius: usize) -> Vec<[f32; 2]> {
    let join = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
    let along = |line: &[[f32; 2]], at: usize| {
        let around = &line[at.saturating_sub(radius)..(at + radius + 1).min(line.len())];
        around.iter().copied().reduce(join).unwrap_or_default()
    };
    let mut rows = Vec::with_capacity(values.len());
    for row in values.chunks_exact(width) {
        let line: Vec<[f32; 2]> = row.iter().map(|value| [*value; 2]).collect();
        rows.extend((0..width).map(|at| along(&line, at)));
    }
    let height = values.len() / width;
    let mut limits = vec![[0.0; 2]; values.len()];
    for column in 0..width {
        let line: Vec<[f32; 2]> = (0..height).map(|row| rows[row * width + column]).collect();
        for row in 0..height {
            limits[row * width + column] = along(&line, row);
        }
    }
    limits
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    #[test]
    fn surroundings_are_the_limits_of_squares() {
        let values: Vec<f32> = (0..35).map(|i| ((i * 17) % 23) as f32).collect();
        let found = surroundings(&values, 7, 2);
        for (at, limits) in found.iter().enumerate() {
            let inside =
                |other: &usize| (other % 7).abs_diff(at % 7) <= 2 && (other / 7).abs_diff(at / 7) <= 2;
            let around: Vec<f32> = (0..35).filter(inside).map(|other| values[other]).collect();
            let largest = around.iter().copied().fold(f32::MIN, f32::max);
            let least = around.iter().copied().fold(f32::MAX, f32::min);
            assert_eq!(*limits, [largest, least], "{at}");
        }
    }

    /// A camera that looks along z.
    fn camera() -> (Intrinsics, CameraPose) {
        let (focal, principal) = (DVec2::splat(150.0), DVec2::new(99.5, 79.5));
        let lens = Intrinsics { width: 200, height: 160, focal, principal };
        (lens, CameraPose::from_matrix(DMat4::IDENTITY).unwrap())
    }

    /// A small square half a metre before a wall.
    fn scene() -> TriangleMesh {
        let square = |half: f64, z: f64| {
            [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, y]| DVec3::new(x, y, z))
        };
        let mut vertices = square(2.0, 2.0).to_vec();
        vertices.extend(square(0.2, 1.5));
        let triangles = vec![[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]];
        TriangleMesh { vertices, triangles, ..TriangleMesh::default() }
    }

    #[test]
    fn what_is_hidden_or_beside_a_jump_is_not_shown() {
        let (lens, pose) = camera();
        let map = DepthMap::new(&scene(), &lens, &pose, 0.01, 0);
        assert_eq!(map.radius, 2);
        let shows = |x: f64, z: f64| map.shows(DVec3::new(x, 0.0, z), -DVec3::Z, 0.02);
        // A pixel is 13 mm wide on the wall and 10 mm on the square, whose edge hides the wall up to 0.267 m.
        assert!(shows(0.0, 1.5) && shows(0.5, 2.0));
        assert!(!shows(0.0, 2.0), "hidden");
        assert!(!shows(0.19, 1.5) && !shows(0.28, 2.0), "beside the jump");
        assert!(shows(0.17, 1.5) && shows(0.31, 2.0), "three pixels from the jump");
        assert!(!shows(0.5, -2.0), "behind the camera");
        assert!(!shows(1.5, 2.0), "beside the image");
        let rough = DepthMap::new(&scene(), &lens, &pose, 0.01, 4);
        assert!(!rough.shows(DVec3::new(0.31, 0.0, 2.0), -DVec3::Z, 0.02));
    }

    #[test]
    fn a_slanted_surface_is_no_jump() {
        let (lens, pose) = camera();
        let corners =
            [[-2.0, -1.0, 1.0], [2.0, -1.0, 6.0], [2.0, 1.0, 6.0], [-2.0, 1.0, 1.0]].map(DVec3::from);
        let mesh = TriangleMesh {
            vertices: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        };
        let map = DepthMap::new(&mesh, &lens, &pose, 0.01, 0);
        let normal = DVec3::new(5.0, 0.0, -4.0).normalize();
        assert!((-5..5).all(|i| {
            let x = 0.1 * f64::from(i);
            map.shows(DVec3::new(x, 0.1, 3.5 + 1.25 * x), normal, 1e-3)
        }));
    }
}
