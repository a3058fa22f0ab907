//! The layout of one moving camera: `camera.json` and a folder `depth`.

use super::error::{DepthFileError, at_frame, io_error};
use super::image::Units;
use super::listing::list_images;
use super::{Camera, DepthSequence, Poses};
use crate::regular_file;
use crate::text;
use glam::{DMat4, DVec2};
use isv_volume::{CameraPose, DepthError, Intrinsics};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// A 4x4 matrix as nested lists, row after row.
pub(crate) type Rows = [[f64; 4]; 4];

/// What `camera.json` and the cameras of `rig.json` have in common. Keys that are not named here are passed over.
#[derive(Debug, Deserialize)]
pub(crate) struct Lens {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default = "millimetre")]
    depth_scale_m: f64,
    #[serde(default = "zero")]
    invalid_values: Vec<u16>,
}

/// `camera.json`.
#[derive(Debug, Deserialize)]
struct CameraFile {
    #[serde(flatten)]
    lens: Lens,
    fps: Option<f64>,
    poses: Vec<Rows>,
}

fn millimetre() -> f64 {
    0.001
}

fn zero() -> Vec<u16> {
    vec![0]
}

/// Opens a folder by its `camera.json`.
pub(crate) fn open(folder: &Path, file: &Path) -> Result<DepthSequence, DepthFileError> {
    let CameraFile { lens, fps, poses } = read_json(file)?;
    let (intrinsics, units) = lens.check(file, None)?;
    let images = folder.join("depth");
    let paths = list_images(&images)?;
    if poses.len() != paths.len() {
        return Err(DepthFileError::Count {
            path: file.to_owned(),
            found: poses.len(),
            what: "poses",
            expected: paths.len(),
            expected_what: format!("images in {}", images.display()),
        });
    }
    let pose = |(frame, rows): (usize, &Rows)| pose(rows).map_err(|cause| at_frame(file, frame, cause));
    let poses = Poses::Moving(poses.iter().enumerate().map(pose).collect::<Result<_, _>>()?);
    let fps = check_fps(fps, file)?;
    Ok(DepthSequence::new(folder, vec![Camera { intrinsics, units, poses, paths }], fps))
}

/// No frame rate and no unit of depth is larger.
const LARGEST_NUMBER: f64 = 1e6;

/// Reads a JSON file.
pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DepthFileError> {
    let bytes = regular_file::read(file).map_err(io_error(file))?;
    serde_json::from_slice(&text::decode(&bytes))
        .map_err(|why| DepthFileError::Json { path: file.to_owned(), why })
}

/// A camera-to-world matrix as a pose.
pub(crate) fn pose(rows: &Rows) -> Result<CameraPose, DepthError> {
    CameraPose::from_matrix(DMat4::from_cols_array_2d(rows).transpose())
}

/// A frame rate, if there is one, that is one.
pub(crate) fn check_fps(fps: Option<f64>, file: &Path) -> Result<Option<f64>, DepthFileError> {
    fps.map(|fps| positive("fps", fps, file)).transpose()
}

fn positive(name: &'static str, value: f64, file: &Path) -> Result<f64, DepthFileError> {
    if value > 0.0 && value <= LARGEST_NUMBER {
        return Ok(value);
    }
    Err(DepthFileError::Number { path: file.to_owned(), name, value })
}

impl Lens {
    /// The lens and the units of its images, if they can be.
    pub(crate) fn check(
        self,
        file: &Path,
        camera: Option<&str>,
    ) -> Result<(Intrinsics, Units), DepthFileError> {
        let intrinsics = Intrinsics {
            width: self.width,
            height: self.height,
            focal: DVec2::new(self.fx, self.fy),
            principal: DVec2::new(self.cx, self.cy),
        };
        let named = |cause| DepthFileError::Camera {
            path: file.to_owned(),
            camera: camera.map(str::to_owned),
            cause,
        };
        intrinsics.validate().map_err(named)?;
        let depth_scale_m = positive("depth_scale_m", self.depth_scale_m, file)?;
        let mut invalid = self.invalid_values;
        invalid.sort_unstable();
        invalid.dedup();
        Ok((intrinsics, Units { depth_scale_m, invalid }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn invalid_values_are_kept_once_and_in_order() {
        let values: Vec<u16> = (0..100_000u32).map(|i| [900, 65_535, 0, 7][i as usize % 4]).collect();
        let lens = json!({
            "width": 4, "height": 3, "fx": 1, "fy": 1, "cx": 0, "cy": 0, "invalid_values": values,
        });
        let lens: Lens = serde_json::from_value(lens).unwrap();
        let (_, units) = lens.check(Path::new("camera.json"), None).unwrap();
        assert_eq!(units.invalid, [0, 7, 900, 65_535]);
    }
}
