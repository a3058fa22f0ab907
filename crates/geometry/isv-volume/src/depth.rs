//! Depth images and the cameras that took them.

use glam::{DMat3, DMat4, DVec2, DVec3};
use thiserror::Error;

/// Most pixels of a depth image: 268 million, 1 GiB of depths.
pub const MAX_PIXELS: u64 = 1 << 28;

/// How far the product of a rotation with its transpose may be from the identity, in its worst entry. Poses written with
/// three decimals pass, a scale of 1.01 does not.
const ROTATION_TOLERANCE: f64 = 0.01;

/// A camera or image that cannot be worked with.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum DepthError {
    /// Focal lengths that are not positive, a principal point that is not finite, or a size that is zero or too large.
    #[error("intrinsics of {width} x {height} pixels with fx {fx}, fy {fy}, cx {cx}, cy {cy} make no camera")]
    Intrinsics {
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Focal length in pixels, along a row.
        fx: f64,
        /// Focal length in pixels, along a column.
        fy: f64,
        /// Column of the principal point.
        cx: f64,
        /// Row of the principal point.
        cy: f64,
    },
    /// A focal length below 0, as tools of OpenGL write it.
    #[error(
        "{axis} is {focal}: give {} and turn the y and z axes of the poses over, as image rows run downwards and z forward here",
        focal.abs()
    )]
    NegativeFocal {
        /// `fx` or `fy`.
        axis: &'static str,
        /// The focal length in pixels.
        focal: f64,
    },
    /// A pose that is not a rotation and a translation.
    #[error("the pose is no rotation and translation: {why}")]
    Pose {
        /// What is wrong with it.
        why: &'static str,
    },
    /// An image of another size than its camera's.
    #[error("{pixels} depths for a camera of {width} x {height} pixels")]
    ImageSize {
        /// Depths given.
        pixels: usize,
        /// Pixels a row of the camera.
        width: u32,
        /// Rows of the camera.
        height: u32,
    },
}

/// A pinhole camera without distortion (Eq. 4), x right, y down, z forward. A point `(x, y, z)` in front of
/// it falls on column `fx x / z + cx` and row `fy y / z + cy`. Whole numbers are the centres of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal lengths in pixels, along a row and along a column.
    pub focal: DVec2,
    /// Column and row of the principal point.
    pub principal: DVec2,
}

impl Intrinsics {
    /// Checks that a camera can have these numbers.
    ///
    /// # Errors
    /// [`DepthError::Intrinsics`].
    pub fn validate(&self) -> Result<(), DepthError> {
        let Self { width, height, focal, principal } = *self;
        let pixels = u64::from(width) * u64::from(height);
        let lens = focal.is_finite() && focal.min_element() > 0.0 && principal.is_finite();
        if lens && (1..=MAX_PIXELS).contains(&pixels) {
            return Ok(());
        }
        let (fx, fy, cx, cy) = (focal.x, focal.y, principal.x, principal.y);
        let negative =
            [("fx", fx), ("fy", fy)].into_iter().find(|(_, focal)| focal.is_finite() && *focal < 0.0);
        if let Some((axis, focal)) = negative {
            return Err(DepthError::NegativeFocal { axis, focal });
        }
        Err(DepthError::Intrinsics { width, height, fx, fy, cx, cy })
    }

    /// Pixels in an image.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Column and row of a point in front of the camera, in camera coordinates (Eq. 4).
    #[must_use]
    pub fn project(&self, p: DVec3) -> DVec2 {
        self.focal * p.truncate() / p.z + self.principal
    }

    /// The point at a depth along z that falls on a column and row; in camera coordinates.
    #[must_use]
    pub fn unproject(&self, pixel: DVec2, depth_m: f64) -> DVec3 {
        ((pixel - self.principal) / self.focal * depth_m).extend(depth_m)
    }
}

/// Pose of a camera: from its coordinates (x right, y down, z forward) to the world's, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Columns are the camera's axes in the world.
    pub rotation: DMat3,
    /// The camera's centre in the world.
    pub centre: DVec3,
}

impl CameraPose {
    /// From a 4x4 camera-to-world matrix. A rotation that is slightly off, as decimals leave it, is made whole.
    ///
    /// # Errors
    /// [`DepthError::Pose`] unless the matrix is a rotation and a translation.
    pub fn from_matrix(matrix: DMat4) -> Result<Self, DepthError> {
        let fault = |why| Err(DepthError::Pose { why });
        if !matrix.is_finite() {
            return fault("a number is not finite");
        }
        if !matrix.row(3).abs_diff_eq(glam::DVec4::W, 1e-6) {
            return fault("the last row is not 0 0 0 1");
        }
        let rotation = DMat3::from_mat4(matrix);
        if !(rotation.transpose() * rotation).abs_diff_eq(DMat3::IDENTITY, ROTATION_TOLERANCE) {
            return fault("the axes are not of unit length and square to each other");
        }
        if rotation.determinant() < 0.0 {
            return fault("it mirrors");
        }
        let x = rotation.x_axis.normalize();
        let y = (rotation.y_axis - x * x.dot(rotation.y_axis)).normalize();
        Ok(Self { rotation: DMat3::from_cols(x, y, x.cross(y)), centre: matrix.w_axis.truncate() })
    }

    /// A point of the world in camera coordinates (Eq. 3).
    #[must_use]
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.rotation.transpose() * (world - self.centre)
    }

    /// The pose turned about the world's origin by a rotation.
    #[must_use]
    pub fn turned(self, rotation: DMat3) -> Self {
        Self { rotation: rotation * self.rotation, centre: rotation * self.centre }
    }

    /// The pose in the world of a camera whose pose in this camera's coordinates is known.
    #[must_use]
    pub fn of(&self, other: &Self) -> Self {
        Self { rotation: self.rotation * other.rotation, centre: self.to_world(other.centre) }
    }

    /// A point in camera coordinates in the world.
    #[must_use]
    pub fn to_world(&self, camera: DVec3) -> DVec3 {
        self.rotation * camera + self.centre
    }
}

/// What one depth camera saw at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    intrinsics: Intrinsics,
    pose: CameraPose,
    depths_m: Vec<f32>,
}

impl DepthImage {
    /// Joins an image and its camera. Depths run along z, not along the ray, in metres, row after row from
    /// the top. A depth that is not a positive finite number is no reading and becomes 0.
    ///
    /// # Errors
    /// [`DepthError::Intrinsics`] and [`DepthError::ImageSize`].
    pub fn new(intrinsics: Intrinsics, pose: CameraPose, mut depths_m: Vec<f32>) -> Result<Self, DepthError> {
        intrinsics.validate()?;
        if depths_m.len() != intrinsics.pixels() {
            let Intrinsics { width, height, .. } = intrinsics;
            return Err(DepthError::ImageSize { pixels: depths_m.len(), width, height });
        }
        for depth in &mut depths_m {
            if !(depth.is_finite() && *depth > 0.0) {
                *depth = 0.0;
            }
        }
        Ok(Self { intrinsics, pose, depths_m })
    }

    /// The lens.
    #[must_use]
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Pose in which the camera stood.
    #[must_use]
    pub fn pose(&self) -> &CameraPose {
        &self.pose
    }

    /// All depths in metres, row after row; 0 where there is no reading.
    #[must_use]
    pub fn depths_m(&self) -> &[f32] {
        &self.depths_m
    }

    /// The depth at a column and row, if there is a reading.
    #[must_use]
    pub fn depth_m(&self, column: u32, row: u32) -> Option<f32> {
        let depth = self.depths_m[row as usize * self.intrinsics.width as usize + column as usize];
        (depth > 0.0).then_some(depth)
    }

    /// The image with its camera turned about the world's origin by a rotation.
    #[must_use]
    pub fn turned(mut self, rotation: DMat3) -> Self {
        self.pose = self.pose.turned(rotation);
        self
    }

    /// How many pixels have a reading.
    #[must_use]
    pub fn readings(&self) -> usize {
        self.depths_m.iter().filter(|depth| **depth > 0.0).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Intrinsics =
        Intrinsics { width: 4, height: 3, focal: DVec2::new(5.0, 6.0), principal: DVec2::new(1.5, 1.0) };

    #[test]
    fn projection_and_pose_invert() {
        let pixel = DVec2::new(3.0, 0.25);
        assert!(LENS.project(LENS.unproject(pixel, 2.0)).abs_diff_eq(pixel, 1e-12));
        let turn =
            DMat4::from_rotation_translation(glam::DQuat::from_rotation_y(0.7), DVec3::new(1.0, 2.0, 3.0));
        let pose = CameraPose::from_matrix(turn).unwrap();
        let p = DVec3::new(0.3, -0.2, 4.0);
        assert!(pose.to_world(p).abs_diff_eq(turn.transform_point3(p), 1e-12));
        assert!(pose.to_camera(pose.to_world(p)).abs_diff_eq(p, 1e-12));
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let scaled = DMat4::from_scale(DVec3::splat(1.02));
        let mirrored = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let projective = DMat4::from_cols_array(&[1.; 16]);
        let broken = DMat4::IDENTITY * f64::NAN;
        for matrix in [scaled, mirrored, projective, broken] {
            assert!(matches!(CameraPose::from_matrix(matrix), Err(DepthError::Pose { .. })), "{matrix}");
        }
    }

    #[test]
    fn readings_are_positive_and_images_fit_their_camera() {
        let pose = CameraPose::from_matrix(DMat4::IDENTITY).unwrap();
        let mut depths = vec![1.0; 12];
        depths[..4].copy_from_slice(&[f32::NAN, -1.0, f32::INFINITY, 0.0]);
        let image = DepthImage::new(LENS, pose, depths).unwrap();
        assert_eq!(image.readings(), 8);
        assert_eq!((image.depth_m(3, 0), image.depth_m(0, 1)), (None, Some(1.0)));
        let short = DepthImage::new(LENS, pose, vec![1.0; 11]);
        assert_eq!(short, Err(DepthError::ImageSize { pixels: 11, width: 4, height: 3 }));
        let upwards = Intrinsics { focal: DVec2::new(5.0, -6.0), ..LENS };
        assert_eq!(
            upwards.validate().unwrap_err().to_string(),
            "fy is -6: give 6 and turn the y and z axes of the poses over, as image rows run downwards and z forward here"
        );
        let flat = Intrinsics { focal: DVec2::new(5.0, 0.0), ..LENS };
        assert!(matches!(DepthImage::new(flat, pose, vec![1.0; 12]), Err(DepthError::Intrinsics { .. })));
    }
}
