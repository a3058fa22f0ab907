//! The layout of one moving camera: `camera.json` and a folder `depth`.

use super::distortion::DistortionKeys;
use super::error::{DepthFileError, io_error};
use super::image::Units;
use super::listing::list_images;
use super::{Camera, DepthSequence, Optics, Poses};
use crate::regular_file;
use crate::text::{self, parse_float};
use glam::{DMat4, DVec2};
use isv_volume::{CameraPose, DepthError, Intrinsics};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use serde_json::value::RawValue;
use std::path::Path;

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
    invalid_values: Option<Vec<u16>>,
    #[serde(flatten)]
    distortion: DistortionKeys,
}

/// `camera.json`, beside its lens.
#[derive(Debug, Deserialize)]
struct CameraFile<'a> {
    fps: Option<f64>,
    /// A matrix a frame. Each is parsed by itself, so that a bad one costs its frame alone.
    #[serde(borrow)]
    poses: Vec<&'a RawValue>,
    /// When each image was taken, in seconds.
    timestamps: Option<Vec<f64>>,
}

fn millimetre() -> f64 {
    0.001
}

/// Opens a folder by its `camera.json`.
pub(crate) fn open(folder: &Path, file: &Path) -> Result<DepthSequence, DepthFileError> {
    let text = read_text(file)?;
    let json_error = |why| DepthFileError::Json { path: file.to_owned(), why };
    let CameraFile { fps, poses, timestamps } = serde_json::from_slice(&text).map_err(json_error)?;
    let lens: Lens = serde_json::from_slice(&text).map_err(json_error)?;
    let optics = lens.check(file, None)?;
    let images = folder.join("depth");
    let paths = list_images(&images)?;
    let count = |found, what| match found == paths.len() {
        true => Ok(()),
        false => Err(DepthFileError::Count {
            path: file.to_owned(),
            found,
            what,
            expected: paths.len(),
            expected_what: format!("images in {}", images.display()),
        }),
    };
    count(poses.len(), "poses")?;
    if let Some(timestamps) = &timestamps {
        count(timestamps.len(), "timestamps")?;
    }
    let pose = |raw: &&RawValue| pose(&serde_json::from_str(raw.get()).unwrap_or_default());
    let poses = Poses::Moving { file: file.to_owned(), poses: poses.iter().map(pose).collect() };
    let fps = check_fps(fps, file)?;
    let times_ns = timestamps.map(|seconds| {
        let first = seconds[0];
        seconds.iter().map(|time| ((time - first) * 1e9).round().max(0.0) as u64).collect::<Vec<_>>()
    });
    let fps = fps.or_else(|| median_rate(times_ns.as_deref()?));
    let sequence = DepthSequence::new(folder, vec![Camera { optics, poses, paths }], fps);
    Ok(DepthSequence { times_ns, ..sequence })
}

/// No frame rate and no unit of depth is larger.
const LARGEST_NUMBER: f64 = 1e6;

/// Reads a JSON file.
pub(crate) fn read_json<T: DeserializeOwned>(file: &Path) -> Result<T, DepthFileError> {
    serde_json::from_slice(&read_text(file)?)
        .map_err(|why| DepthFileError::Json { path: file.to_owned(), why })
}

/// Reads the text of a JSON file. `NaN` and `Infinity`, which JSON has not and Python writes, become `null`.
fn read_text(file: &Path) -> Result<Vec<u8>, DepthFileError> {
    let bytes = regular_file::read(file).map_err(io_error(file))?;
    Ok(without_nan(&text::decode(&bytes)))
}

/// JSON with `null` in place of numbers that are none, outside of its strings.
fn without_nan(json: &[u8]) -> Vec<u8> {
    const NUMBERS: [&[u8]; 6] = [b"-Infinity", b"Infinity", b"-NaN", b"NaN", b"-nan", b"nan"];
    let mut out = Vec::with_capacity(json.len());
    let (mut at, mut in_string) = (0, false);
    while at < json.len() {
        let rest = &json[at..];
        if let Some(number) = NUMBERS.iter().find(|number| !in_string && rest.starts_with(number)) {
            out.extend(b"null");
            at += number.len();
            continue;
        }
        match json[at] {
            b'"' => in_string = !in_string,
            b'\\' if in_string => {
                out.push(b'\\');
                at += 1;
            }
            _ => {}
        }
        out.extend(json.get(at));
        at += 1;
    }
    out
}

/// A camera-to-world matrix, four rows of four numbers, as a pose.
pub(crate) fn pose(matrix: &Value) -> Result<CameraPose, DepthError> {
    let fault = DepthError::Pose { why: "it is not 4 rows of 4 numbers" };
    let rows = matrix.as_array().filter(|rows| rows.len() == 4).ok_or(fault)?;
    let mut numbers = [[0.0; 4]; 4];
    for (row, numbers) in rows.iter().zip(&mut numbers) {
        let row = row.as_array().filter(|row| row.len() == 4).ok_or(fault)?;
        for (value, number) in row.iter().zip(numbers) {
            *number = match value {
                // `null` and words such as "nan" stand for no number.
                Value::Null => f64::NAN,
                Value::String(word) => {
                    parse_float(word.as_bytes()).filter(|number| !number.is_finite()).ok_or(fault)?
                }
                value => value.as_f64().ok_or(fault)?,
            };
        }
    }
    CameraPose::from_matrix(DMat4::from_cols_array_2d(&numbers).transpose())
}

/// One over the median distance of times in nanoseconds, in frames a second.
pub(crate) fn median_rate(times_ns: &[u64]) -> Option<f64> {
    let mut steps: Vec<u64> = times_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    steps.retain(|step| *step > 0);
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|step| 1e9 / *step as f64)
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
    pub(crate) fn check(self, file: &Path, camera: Option<&str>) -> Result<Optics, DepthFileError> {
        let intrinsics = Intrinsics {
            width: self.width,
            height: self.height,
            focal: DVec2::new(self.fx, self.fy),
            principal: DVec2::new(self.cx, self.cy),
        };
        let camera = || camera.map(str::to_owned);
        let named = |cause| DepthFileError::Camera { path: file.to_owned(), camera: camera(), cause };
        intrinsics.validate().map_err(named)?;
        let depth_scale_m = positive("depth_scale_m", self.depth_scale_m, file)?;
        let units = Units::new(depth_scale_m, self.invalid_values);
        let distortion = self.distortion.check().map_err(|why| DepthFileError::Distortion {
            path: file.to_owned(),
            camera: camera(),
            why,
        })?;
        Ok(Optics { intrinsics, units, distortion })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use serde_json::json;

    #[test]
    fn invalid_values_are_kept_once_and_in_order() {
        let values: Vec<u16> = (0..100_000u32).map(|i| [900, 65_535, 0, 7][i as usize % 4]).collect();
        let lens = json!({
            "width": 4, "height": 3, "fx": 1, "fy": 1, "cx": 0, "cy": 0, "invalid_values": values,
        });
        let lens: Lens = serde_json::from_value(lens).unwrap();
        let optics = lens.check(Path::new("camera.json"), None).unwrap();
        assert_eq!(optics.units.invalid, [0, 7, 900, 65_535]);
    }

    #[test]
    fn what_python_writes_for_no_number_is_none() {
        let json = br#"{"a": [NaN, -Infinity, 1], "Infinity": "NaN \" -nan", "b": -NaN}"#;
        let value: Value = serde_json::from_slice(&without_nan(json)).unwrap();
        assert_eq!(value, json!({ "a": [null, null, 1], "Infinity": "NaN \" -nan", "b": null }));
    }

    #[test]
    fn a_pose_is_four_rows_of_four_numbers() {
        let row = [1.0, 0.0, 0.0, 0.0];
        let of = |last: Value| pose(&json!([[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], last]));
        assert_eq!(of(json!([0, 0, 0, 1])).unwrap().centre, DVec3::new(2.0, 0.0, 0.0));
        let why = |last: Value| of(last).unwrap_err().to_string();
        for wrong in
            [json!(null), json!([0, 0, 0]), json!([0, 0, 0, "x"]), json!([0, 0, 0, "1"]), json!([row])]
        {
            assert_eq!(why(wrong), "the pose is no rotation and translation: it is not 4 rows of 4 numbers");
        }
        for wrong in [json!([0, 0, 0, null]), json!([0, "nan", 0, 1]), json!(["-inf", 0, 0, 1])] {
            assert_eq!(why(wrong), "the pose is no rotation and translation: a number is not finite");
        }
    }
}
