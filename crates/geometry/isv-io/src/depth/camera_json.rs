//! The layout of one moving camera: `camera.json` and a folder `depth`.

use super::colour::{Beside, ColourKey, unnamed};
use super::distortion::{Distortion, DistortionKeys};
use super::error::DepthFileError;
use super::image::Units;
use super::json::{Number, WrittenPose, read_json};
use super::listing::list_images;
use super::times::{self, TimeUnit, WrittenStamp};
use super::{BadPose, Camera, DepthSequence, Optics, Poses};
use crate::Colours;
use glam::DVec2;
use isv_volume::Intrinsics;
use serde::Deserialize;
use std::path::Path;

/// What `camera.json` and the cameras of `rig.json` have in common. Keys that are not named here are passed over.
#[derive(Debug, Deserialize)]
pub(crate) struct Lens {
    width: u32,
    height: u32,
    fx: Number,
    fy: Number,
    cx: Number,
    cy: Number,
    #[serde(default = "millimetre")]
    depth_scale_m: Number,
    invalid_values: Option<Vec<u16>>,
    #[serde(flatten)]
    distortion: DistortionKeys,
}

/// `camera.json` of one moving camera.
#[derive(Debug, Deserialize)]
struct CameraFile {
    #[serde(flatten)]
    lens: Lens,
    fps: Option<Number>,
    /// A matrix a frame.
    poses: Vec<WrittenPose>,
    /// When each image was taken.
    timestamps: Option<Vec<WrittenStamp>>,
    time_unit: Option<TimeUnit>,
    #[serde(flatten)]
    colour: ColourKey,
}

fn millimetre() -> Number {
    Number(0.001)
}

/// Opens a folder by its `camera.json`.
pub(crate) fn open(folder: &Path, file: &Path, colours: Colours) -> Result<DepthSequence, DepthFileError> {
    let CameraFile { lens, fps, poses, timestamps, time_unit, colour } = read_json(file)?;
    let optics = lens.check(file, None)?;
    let images = folder.join("depth");
    let paths = list_images(&images)?;
    let expected = paths.len();
    let count = |found, what, advice| match found == expected {
        true => Ok(()),
        false => Err(DepthFileError::Count {
            path: file.to_owned(),
            found,
            what,
            expected,
            expected_what: format!("images in {}; {advice}", images.display()),
        }),
    };
    count(poses.len(), "poses", "give a pose for each image, null where none is known")?;
    let poses = poses.iter().map(|pose| pose.pose().map_err(BadPose::Matrix)).collect();
    let poses = Poses::Moving { file: file.to_owned(), poses };
    let fps = check_fps(fps, file)?;
    let depth = Some((0, &paths[..]));
    let beside = Beside { folder, file, name: None, optics: &optics, poses: &poses, depth };
    let colour = match (colours, colour.keys(colours, true, &beside)?) {
        (Colours::Drop, _) => None,
        (Colours::Keep, Some(keys)) => Some(keys.open(&beside)?),
        (Colours::Keep, None) => unnamed(&beside),
    };
    let colours = colour.into_iter().collect();
    let sequence =
        DepthSequence::new(folder, vec![Camera { optics, poses, paths }], fps).with_colours(colours);
    let Some(stamps) = timestamps else { return Ok(sequence) };
    count(stamps.len(), "timestamps", "give one for each image, or none at all")?;
    let stamps = stamps_in_order(file, &stamps)?;
    let unit = time_unit.unwrap_or_else(|| TimeUnit::from_stamps(&stamps));
    let times_ns: Vec<_> = stamps.iter().map(|stamp| unit.nanoseconds(*stamp)).collect();
    let times_ns = times::since_first(&times_ns, file)?;
    Ok(DepthSequence {
        fps: fps.or_else(|| times::median_rate(&times_ns)),
        times_ns: Some(times_ns),
        time_unit: if time_unit.is_none() { unit.doubtful_name(&stamps) } else { None },
        ..sequence
    })
}

/// Time stamps that are numbers and do not fall, as images follow each other by their names.
fn stamps_in_order(file: &Path, stamps: &[WrittenStamp]) -> Result<Vec<i128>, DepthFileError> {
    let mut last = i128::MIN;
    let check = |(frame, stamp): (usize, &WrittenStamp)| {
        let fault = |why| times::time_error(file, frame, why);
        let stamp = stamp.0.ok_or_else(|| fault("its entry in timestamps is no number"))?;
        if stamp < last {
            return Err(fault("its entry in timestamps is before that of the frame before it"));
        }
        last = stamp;
        Ok(stamp)
    };
    stamps.iter().enumerate().map(check).collect()
}

/// No frame rate and no unit of depth is larger.
const LARGEST_NUMBER: f64 = 1e6;

/// A frame rate, if there is one, that is one.
pub(crate) fn check_fps(fps: Option<Number>, file: &Path) -> Result<Option<f64>, DepthFileError> {
    fps.map(|fps| positive("fps", fps.0, file)).transpose()
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
            focal: DVec2::new(self.fx.0, self.fy.0),
            principal: DVec2::new(self.cx.0, self.cy.0),
        };
        let distortion = lens_of(intrinsics, &self.distortion, file, camera)?;
        let depth_scale_m = positive("depth_scale_m", self.depth_scale_m.0, file)?;
        let units = Units::new(depth_scale_m, self.invalid_values);
        Ok(Optics { intrinsics, units, distortion })
    }
}

/// Checks a lens, and gives its distortion. `camera`: its name, if it has one.
pub(crate) fn lens_of(
    intrinsics: Intrinsics,
    distortion: &DistortionKeys,
    file: &Path,
    camera: Option<&str>,
) -> Result<Option<Distortion>, DepthFileError> {
    let camera = || camera.map(str::to_owned);
    let named = |cause| DepthFileError::Camera { path: file.to_owned(), camera: camera(), cause };
    intrinsics.validate().map_err(named)?;
    let named = |why| DepthFileError::Distortion { path: file.to_owned(), camera: camera(), why };
    distortion.check().map_err(named)
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
        let optics = lens.check(Path::new("camera.json"), None).unwrap();
        assert_eq!(optics.units.invalid, [0, 7, 900, 65_535]);
    }
}
