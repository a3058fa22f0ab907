//! From the world to pixels.

use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};

/// Part of the picture left free on every side.
const MARGIN: f64 = 0.04;

/// Sides of the prism around a box that turns; it is wider than its circle by 0.5 %.
const ORBIT_CORNERS: usize = 32;

/// Camera of a picture: the direction to it, and the box it must show whole. Y is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Smallest and largest corner, in metres, of what must fit into the picture.
    pub bounds: (DVec3, DVec3),
    /// Width and height of the picture in pixels.
    pub size: [usize; 2],
    /// Degrees that the camera is turned about the up axis: 0 looks from +z, 90 from +x.
    pub yaw_degrees: f64,
    /// Degrees above the horizon: 90 looks straight down.
    pub pitch_degrees: f64,
    /// Whether the box turns with the camera: it fits at every yaw, and at every yaw its middle and scale are the same.
    pub orbits: bool,
    /// Opening of a cone around the whole box, 0 to under 180 degrees; 0 is a parallel projection.
    pub opening_degrees: f64,
}

impl Camera {
    /// A camera in front (+z) with a gentle perspective.
    #[must_use]
    pub fn fitting(bounds: (DVec3, DVec3), size: [usize; 2]) -> Self {
        Self { bounds, size, yaw_degrees: 0.0, pitch_degrees: 0.0, orbits: false, opening_degrees: 24.0 }
    }

    /// This camera, seen from another direction.
    #[must_use]
    pub fn from_direction(self, yaw_degrees: f64, pitch_degrees: f64) -> Self {
        Self { yaw_degrees, pitch_degrees, ..self }
    }

    /// This camera, made to go around what it sees: see [`Self::orbits`].
    #[must_use]
    pub fn in_orbit(self) -> Self {
        Self { orbits: true, ..self }
    }

    /// The map to pixels of this camera, `scale` times finer than its size.
    pub(crate) fn projection(&self, scale: usize) -> Projection {
        let (low, high) = self.bounds;
        let radius = (high - low).length() / 2.0;
        let per_distance = (self.opening_degrees.to_radians() / 2.0).sin() / radius.max(f64::MIN_POSITIVE);
        let mut projection = Projection {
            target: (low + high) / 2.0,
            to_view: self.axes().transpose(),
            per_distance,
            pixels_a_metre: 1.0,
            centre: [0.0; 2],
        };
        let corners = self.extremes().into_iter().map(|corner| projection.project(corner));
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (from, to) = corners.fold(empty, |(from, to), p| (from.min(p), to.max(p)));
        let size = self.size.map(|s| (s * scale) as f64);
        let fit = |axis: usize| size[axis] * (1.0 - 2.0 * MARGIN) / (to[axis] - from[axis]);
        let pixels_a_metre = fit(0).min(fit(1));
        projection.pixels_a_metre = if pixels_a_metre.is_finite() { pixels_a_metre } else { 1.0 };
        projection.centre =
            [0, 1].map(|axis| size[axis] / 2.0 - (from[axis] + to[axis]) / 2.0 * projection.pixels_a_metre);
        projection
    }

    /// Points that must fit: the corners of the box, or those of a prism around all boxes that it turns into.
    fn extremes(&self) -> Vec<DVec3> {
        let (low, high) = self.bounds;
        if !self.orbits {
            let pick = |c: usize, axis: usize| if c >> axis & 1 == 0 { low[axis] } else { high[axis] };
            return (0..8).map(|c| DVec3::new(pick(c, 0), pick(c, 1), pick(c, 2))).collect();
        }
        let middle = (low + high) / 2.0;
        let reach = (high - middle).with_y(0.0).length() / (PI / ORBIT_CORNERS as f64).cos();
        let corners = (0..ORBIT_CORNERS).flat_map(|corner| {
            let azimuth = self.yaw_degrees.to_radians() + TAU * corner as f64 / ORBIT_CORNERS as f64;
            [low.y, high.y]
                .map(|y| (middle + reach * DVec3::new(azimuth.sin(), 0.0, azimuth.cos())).with_y(y))
        });
        corners.collect()
    }

    /// Right, up, and towards the camera, as columns.
    fn axes(&self) -> DMat3 {
        let (sin_yaw, cos_yaw) = self.yaw_degrees.to_radians().sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch_degrees.to_radians().sin_cos();
        let towards = DVec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
        let right = DVec3::new(cos_yaw, 0.0, -sin_yaw);
        DMat3::from_cols(right, towards.cross(right), towards)
    }
}

/// A camera made ready for many points.
pub(crate) struct Projection {
    target: DVec3,
    to_view: DMat3,
    /// One over the distance of the eye from the target; 0 for a parallel projection.
    per_distance: f64,
    pub(crate) pixels_a_metre: f64,
    centre: [f64; 2],
}

impl Projection {
    /// Pixel coordinates x (right) and y (down), and a depth that grows towards the camera.
    ///
    /// The depth is metres from the target, stretched by the perspective so that it is linear over a flat triangle.
    /// Points behind the eye, which lie outside the camera's bounds, have no place in the picture: NaN.
    pub(crate) fn project(&self, point: DVec3) -> DVec3 {
        let view = self.to_view * (point - self.target);
        let from_eye = 1.0 - view.z * self.per_distance;
        let nearer = if from_eye > 0.0 { 1.0 / from_eye } else { f64::NAN };
        let [x, y] = [view.x, -view.y].map(|c| c * nearer * self.pixels_a_metre);
        DVec3::new(x + self.centre[0], y + self.centre[1], view.z * nearer)
    }

    /// How much larger a thing at a depth of [`Self::project`] is drawn than at the target: 1 in a parallel projection.
    pub(crate) fn magnification(&self, depth: f64) -> f64 {
        // 1 / (1 - z / distance), where the depth is z / (1 - z / distance).
        1.0 + depth * self.per_distance
    }

    /// The point at pixel coordinates and a depth: the inverse of [`Self::project`].
    pub(crate) fn unproject(&self, pixel: DVec3) -> DVec3 {
        let from_eye = 1.0 / (1.0 + pixel.z * self.per_distance);
        let [x, y] = [0, 1].map(|axis| (pixel[axis] - self.centre[axis]) / self.pixels_a_metre * from_eye);
        self.to_view.transpose() * DVec3::new(x, -y, pixel.z * from_eye) + self.target
    }

    /// Unit vector towards the camera, at the target.
    pub(crate) fn to_camera(&self) -> DVec3 {
        self.to_view.row(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_fits_and_touches_the_margin() {
        let bounds = (DVec3::new(-1.0, 0.0, -0.5), DVec3::new(2.0, 1.0, 3.0));
        for opening_degrees in [0.0, 24.0, 90.0] {
            let camera = Camera { opening_degrees, ..Camera::fitting(bounds, [300, 200]) };
            let projection = camera.from_direction(30.0, 20.0).projection(1);
            let corners = (0..8).map(|c| {
                let pick = |axis: usize| if c >> axis & 1 == 0 { bounds.0[axis] } else { bounds.1[axis] };
                projection.project(DVec3::new(pick(0), pick(1), pick(2)))
            });
            let left = corners.clone().map(|p| p.x).fold(f64::INFINITY, f64::min);
            let top = corners.map(|p| p.y).fold(f64::INFINITY, f64::min);
            assert!((left / 300.0 - MARGIN).min(top / 200.0 - MARGIN).abs() < 1e-9, "{left} {top}");
        }
    }

    #[test]
    fn a_camera_in_orbit_keeps_its_scale_and_what_it_sees() {
        let bounds = (DVec3::new(-1.0, 0.0, -0.5), DVec3::new(2.0, 1.0, 3.0));
        let camera = Camera::fitting(bounds, [300, 200]).in_orbit();
        let first = camera.from_direction(0.0, 20.0).projection(1);
        for yaw in 0..72 {
            let projection = camera.from_direction(5.0 * f64::from(yaw), 20.0).projection(1);
            assert!((projection.pixels_a_metre / first.pixels_a_metre - 1.0).abs() < 1e-9);
            assert!(projection.project(first.target).abs_diff_eq(first.project(first.target), 1e-9));
            for corner in Camera::fitting(bounds, [300, 200]).extremes() {
                let DVec3 { x, y, .. } = projection.project(corner);
                assert!((11.9..288.1).contains(&x) && (7.9..192.1).contains(&y), "{yaw}: {x} {y}");
            }
        }
    }

    #[test]
    fn points_behind_the_eye_have_no_place() {
        let projection = Camera::fitting((DVec3::NEG_ONE, DVec3::ONE), [100, 100]).projection(1);
        assert!(projection.project(DVec3::Z * 5.0).is_finite());
        assert!(projection.project(DVec3::Z * 50.0).is_nan());
    }

    #[test]
    fn pixels_and_depths_lead_back_to_points() {
        let camera = Camera::fitting((DVec3::NEG_ONE, DVec3::new(3.0, 2.0, 1.0)), [300, 200]);
        for opening_degrees in [0.0, 24.0, 90.0] {
            let camera = Camera { opening_degrees, ..camera }.from_direction(-50.0, 35.0);
            let projection = camera.projection(3);
            for point in [DVec3::ZERO, DVec3::new(2.9, -0.3, 0.8), DVec3::new(-1.0, 2.0, -1.0)] {
                let pixel = projection.project(point);
                let back = projection.unproject(pixel);
                let right = projection.to_view.row(0) * 1e-6;
                let drawn =
                    (projection.project(point + right).x - pixel.x) / 1e-6 / projection.pixels_a_metre;
                assert!((projection.magnification(pixel.z) - drawn).abs() < 1e-6, "{point}: {drawn}");
                assert!(back.abs_diff_eq(point, 1e-12), "{point} {back}");
            }
        }
    }

    #[test]
    fn yaw_and_pitch_turn_as_documented() {
        let camera = Camera::fitting((DVec3::NEG_ONE, DVec3::ONE), [100, 100]);
        let seen_from = |yaw, pitch| camera.from_direction(yaw, pitch).projection(1).to_camera();
        assert!(seen_from(0.0, 0.0).abs_diff_eq(DVec3::Z, 1e-12));
        assert!(seen_from(90.0, 0.0).abs_diff_eq(DVec3::X, 1e-12));
        assert!(seen_from(0.0, 90.0).abs_diff_eq(DVec3::Y, 1e-12));
        let above = camera.projection(1).project(DVec3::Y);
        assert!(above.y < 50.0);
    }
}
