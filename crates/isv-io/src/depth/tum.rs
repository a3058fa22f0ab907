//! The layout of the TUM RGB-D benchmark: `depth.txt` and `groundtruth.txt`.

use super::camera_json::{Lens, read_json};
use super::error::{DepthFileError, io_error};
use super::image::Units;
use super::{Camera, DepthSequence, Poses};
use crate::inside::inside;
use crate::regular_file;
use crate::text;
use glam::{DMat3, DQuat, DVec2, DVec3};
use isv_volume::{CameraPose, Intrinsics};
use std::path::{Path, PathBuf};

/// The lens where the folder has neither `camera.json` nor `calibration.txt`: the benchmark's default.
pub const TUM_INTRINSICS: Intrinsics = Intrinsics {
    width: 640,
    height: 480,
    focal: DVec2::new(525.0, 525.0),
    principal: DVec2::new(319.5, 239.5),
};

/// Metres to one unit of a depth image, unless `camera.json` says otherwise: 5000 units are a metre.
pub const TUM_DEPTH_SCALE_M: f64 = 1.0 / 5000.0;

/// How far, in seconds, the pose nearest in time may be from an image's time stamp; images without such a pose are left out.
pub const TUM_TIME_LIMIT_S: f64 = 0.05;

/// Opens a folder by its `depth.txt`.
pub(crate) fn open(folder: &Path, file: &Path) -> Result<DepthSequence, DepthFileError> {
    let images = read_images(folder, file)?;
    let trajectory = Trajectory::read(&folder.join("groundtruth.txt"))?;
    let (intrinsics, units) = read_lens(folder)?;
    let (mut times, mut poses, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    let listed = images.len();
    for (time, path) in images {
        if let Some(pose) = trajectory.at(time) {
            times.push(time);
            poses.push(pose);
            paths.push(path);
        }
    }
    if paths.is_empty() {
        let limit_s = TUM_TIME_LIMIT_S;
        return Err(DepthFileError::NoPose { path: folder.join("groundtruth.txt"), images: listed, limit_s });
    }
    let skipped = listed - paths.len();
    let camera = Camera { intrinsics, units, poses: Poses::Moving(poses), paths };
    Ok(DepthSequence { skipped, ..DepthSequence::new(folder, vec![camera], median_rate(&times)) })
}

/// `depth.txt`: a time stamp and a file name a line.
fn read_images(folder: &Path, file: &Path) -> Result<Vec<(f64, PathBuf)>, DepthFileError> {
    let mut images = Vec::new();
    for_each_line(file, |words| {
        let [time, name] = words[..] else {
            return Err("a time stamp and a file name are expected".to_owned());
        };
        let path = inside(folder, name).ok_or("an image lies in another folder")?;
        images.push((number(time)?, path));
        Ok(())
    })?;
    if images.is_empty() {
        return Err(DepthFileError::NoImages { path: file.to_owned() });
    }
    images.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(images)
}

/// `camera.json` without poses, or `calibration.txt` with `fx fy cx cy` and possibly `width height`, or the defaults.
fn read_lens(folder: &Path) -> Result<(Intrinsics, Units), DepthFileError> {
    let (json, text) = (folder.join("camera.json"), folder.join("calibration.txt"));
    if json.is_file() {
        return read_json::<Lens>(&json)?.check(&json, None);
    }
    let mut intrinsics = TUM_INTRINSICS;
    if text.is_file() {
        for_each_line(&text, |words| {
            let numbers = words.iter().map(|word| number(word)).collect::<Result<Vec<_>, _>>()?;
            let (lens, size) = match numbers[..] {
                [fx, fy, cx, cy] => ([fx, fy, cx, cy], None),
                [fx, fy, cx, cy, width, height] => ([fx, fy, cx, cy], Some([width, height])),
                _ => return Err("fx fy cx cy and possibly width height are expected".to_owned()),
            };
            intrinsics.focal = DVec2::new(lens[0], lens[1]);
            intrinsics.principal = DVec2::new(lens[2], lens[3]);
            if let Some(size) = size {
                [intrinsics.width, intrinsics.height] = size.map(|pixels| pixels as u32);
            }
            Ok(())
        })?;
    }
    let cause = |cause| DepthFileError::Camera { path: text.clone(), camera: None, cause };
    intrinsics.validate().map_err(cause)?;
    Ok((intrinsics, Units { depth_scale_m: TUM_DEPTH_SCALE_M, invalid: vec![0] }))
}

/// Poses in order of time.
struct Trajectory(Vec<(f64, DQuat, DVec3)>);

impl Trajectory {
    /// `groundtruth.txt`: time stamp, translation, and a quaternion whose last number is its real part, a line.
    fn read(file: &Path) -> Result<Self, DepthFileError> {
        let mut poses = Vec::new();
        for_each_line(file, |words| {
            let numbers = words.iter().map(|word| number(word)).collect::<Result<Vec<_>, _>>()?;
            let [time, tx, ty, tz, qx, qy, qz, qw] = numbers[..] else {
                return Err("a time stamp, tx ty tz and qx qy qz qw are expected".to_owned());
            };
            let turn = DQuat::from_xyzw(qx, qy, qz, qw);
            if (turn.length() - 1.0).abs() > 0.01 {
                return Err(format!("the quaternion has length {}, not 1", turn.length()));
            }
            poses.push((time, turn.normalize(), DVec3::new(tx, ty, tz)));
            Ok(())
        })?;
        poses.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(Self(poses))
    }

    /// The pose at a time, on the way from the pose before to the pose after, if the nearer of them is near enough.
    fn at(&self, time: f64) -> Option<CameraPose> {
        let after = self.0.partition_point(|(t, ..)| *t < time);
        let before = self.0[after.saturating_sub(1)..].first()?;
        let after = self.0.get(after).unwrap_or(before);
        let apart = (time - before.0).abs().min((after.0 - time).abs());
        if apart > TUM_TIME_LIMIT_S {
            return None;
        }
        let span = after.0 - before.0;
        let share = if span > 0.0 { ((time - before.0) / span).clamp(0.0, 1.0) } else { 0.0 };
        let rotation = DMat3::from_quat(before.1.slerp(after.1, share));
        Some(CameraPose { rotation, centre: before.2.lerp(after.2, share) })
    }
}

/// One over the median distance of time stamps.
fn median_rate(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).map(|step| 1.0 / step)
}

/// Hands the words of each line to a function; empty lines and those that start with `#` are passed over.
fn for_each_line(
    file: &Path,
    mut line: impl FnMut(Vec<&str>) -> Result<(), String>,
) -> Result<(), DepthFileError> {
    let bytes = regular_file::read(file).map_err(io_error(file))?;
    let bytes = text::decode(&bytes);
    for (number, line_text) in text::lines(&bytes).enumerate() {
        let text = String::from_utf8_lossy(line_text);
        if text.trim_start().starts_with('#') {
            continue;
        }
        let words: Vec<&str> = text.split_whitespace().collect();
        if !words.is_empty() {
            let named = |why| DepthFileError::Line { path: file.to_owned(), line: number + 1, why };
            line(words).map_err(named)?;
        }
    }
    Ok(())
}

fn number(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("`{}` is not a number", crate::error::quote(word.as_bytes())))
}
