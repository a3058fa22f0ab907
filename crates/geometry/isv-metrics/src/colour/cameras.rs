//! The cameras whose pictures are compared.

use glam::DVec3;
use std::f64::consts::TAU;

/// Width and height of a picture in pixels: upright, as people are.
pub(super) const SIZE: [usize; 2] = [640, 1000];

/// Number of cameras, evenly spaced around the up axis.
pub(super) const COUNT: usize = 6;

/// Angle of the first camera about the up axis (radians), from +x towards +z: no camera looks along an axis.
const FIRST_AZIMUTH: f64 = 0.35;

/// Angles above the horizon (radians), in turn.
const ELEVATIONS: [f64; 3] = [0.0, 0.45, -0.2];

/// Height of the picture over that of the box, both at the distance of its middle.
const MARGIN: f64 = 1.12;

/// Distance of a camera from the middle of the box, in heights of the picture there.
const DISTANCE: f64 = 1.6;

/// Nearest depth that is drawn, as a share of the distance of the middle.
const NEAREST: f64 = 1e-3;

/// A pinhole camera. Y is up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    pub(super) eye: DVec3,
    /// Unit vectors to the right and down in the picture, and away from the camera.
    right: DVec3,
    down: DVec3,
    forward: DVec3,
    nearest_m: f64,
}

/// A point as a camera sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Pixels from the left and upper edge of the picture.
    pub(super) place: [f64; 2],
    /// One over the depth in metres, which is linear over a triangle in the picture.
    pub(super) inverse_depth: f64,
}

impl Camera {
    /// All cameras around a box of some size.
    pub(super) fn ring((low, high): (DVec3, DVec3)) -> [Self; COUNT] {
        let size = high - low;
        let [width, height] = SIZE.map(|pixels| pixels as f64);
        let shown_m = MARGIN * size.y.max(size.with_y(0.0).length() * height / width);
        let (middle, distance_m) = (low.midpoint(high), DISTANCE * shown_m);
        std::array::from_fn(|i| {
            let (sin, cos) = (FIRST_AZIMUTH + TAU * i as f64 / COUNT as f64).sin_cos();
            let (up, out) = ELEVATIONS[i % ELEVATIONS.len()].sin_cos();
            let forward = -DVec3::new(cos * out, up, sin * out);
            let right = forward.cross(DVec3::Y).normalize();
            let down = forward.cross(right);
            Self { eye: middle - distance_m * forward, right, down, forward, nearest_m: NEAREST * distance_m }
        })
    }

    /// Focal length in pixels.
    fn focal() -> f64 {
        SIZE[1] as f64 * DISTANCE
    }

    /// The place of a point in the picture; none at or behind the eye.
    pub(super) fn project(&self, point: DVec3) -> Option<Seen> {
        let from_eye = point - self.eye;
        let depth = from_eye.dot(self.forward);
        let place =
            |axis: DVec3, pixels: usize| from_eye.dot(axis) / depth * Self::focal() + pixels as f64 / 2.0;
        (depth > self.nearest_m).then(|| Seen {
            place: [place(self.right, SIZE[0]), place(self.down, SIZE[1])],
            inverse_depth: 1.0 / depth,
        })
    }

    /// Unit vector from the eye through the middle of a pixel.
    #[cfg(test)]
    pub(super) fn direction(&self, pixel: [usize; 2]) -> DVec3 {
        let [x, y] = [0, 1].map(|axis| (pixel[axis] as f64 + 0.5 - SIZE[axis] as f64 / 2.0) / Self::focal());
        (self.forward + self.right * x + self.down * y).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_box_is_the_middle_of_each_picture_and_up_is_up() {
        let bounds = (DVec3::new(-0.4, 0.0, -0.3), DVec3::new(0.4, 1.8, 0.3));
        for camera in Camera::ring(bounds) {
            let seen = camera.project(DVec3::new(0.0, 0.9, 0.0)).unwrap();
            assert!((seen.place[0] - 320.0).abs() < 1e-9 && (seen.place[1] - 500.0).abs() < 1e-9);
            assert!((1.0 / seen.inverse_depth - 1.6 * 1.12 * 1.8).abs() < 1e-12);
            let head = camera.project(DVec3::new(0.0, 1.8, 0.0)).unwrap();
            assert!((20.0..120.0).contains(&head.place[1]), "{head:?}");
            assert!((head.place[0] - 320.0).abs() < 1e-9);
            let eye = camera.eye;
            assert!(camera.project(eye).is_none() && camera.project(eye - camera.forward).is_none());
        }
    }

    #[test]
    fn pixels_look_where_points_are_drawn() {
        let [camera, ..] = Camera::ring((DVec3::ZERO, DVec3::new(3.0, 0.2, 1.0)));
        for pixel in [[0, 0], [639, 999], [100, 800]] {
            let seen = camera.project(camera.eye + camera.direction(pixel) * 2.0).unwrap();
            assert!(
                (0..2).all(|axis| (seen.place[axis] - pixel[axis] as f64 - 0.5).abs() < 1e-9),
                "{seen:?}"
            );
        }
    }

    #[test]
    fn wide_boxes_fit_too() {
        let (low, high) = (DVec3::new(-2.0, 0.0, -2.0), DVec3::new(2.0, 0.5, 2.0));
        for camera in Camera::ring((low, high)) {
            for corner in 0..8 {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let [x, y] = camera.project(DVec3::new(pick(0), pick(1), pick(2))).unwrap().place;
                assert!((-60.0..700.0).contains(&x) && (0.0..1000.0).contains(&y), "{x} {y}");
            }
        }
    }
}
