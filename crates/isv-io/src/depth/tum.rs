//! The layout of the TUM RGB-D benchmark: `depth.txt` and `groundtruth.txt`.

use super::camera_json::{Lens, median_rate, read_json};
use super::error::{DepthFileError, io_error};
use super::image::Units;
use super::{Camera, DepthSequence, Optics, Poses};
use crate::inside::inside;
use crate::regular_file;
use crate::text::{self, parse_billionths, parse_float};
use glam::{DMat3, DQuat, DVec2, DVec3};
use isv_volume::{CameraPose, DepthError, Intrinsics};
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
    let unit = TimeUnit::of(&images);
    let trajectory = Trajectory::read(&folder.join("groundtruth.txt"), unit)?;
    let optics = read_lens(folder)?;
    let (mut times, mut poses, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    let listed = images.len();
    for (time, path) in images {
        let time_ns = unit.nanoseconds(time);
        if let Some(pose) = trajectory.at(time_ns) {
            times.push(time_ns);
            poses.push(pose);
            paths.push(path);
        }
    }
    let Some(&first) = times.first() else {
        let limit_s = TUM_TIME_LIMIT_S;
        return Err(DepthFileError::NoPose { path: folder.join("groundtruth.txt"), images: listed, limit_s });
    };
    let times_ns: Vec<u64> =
        times.iter().map(|time| u64::try_from(time - first).unwrap_or(u64::MAX)).collect();
    let fps = median_rate(&times_ns);
    let poses = Poses::Moving { file: folder.join("groundtruth.txt"), poses };
    let sequence = DepthSequence::new(folder, vec![Camera { optics, poses, paths }], fps);
    Ok(DepthSequence {
        skipped: listed - times.len(),
        times_ns: Some(times_ns),
        time_unit: unit.name(),
        ..sequence
    })
}

/// A time as a list has it, in billionths of its unit: exact, where a number of seconds since 1970 has no room for nanoseconds in `f64`.
type Time = i128;

/// What the time stamps of lists count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TimeUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
}

impl TimeUnit {
    /// The unit of a list's times: by their size, if they are times since 1970; else, if all are whole numbers and seconds would make
    /// fewer than one frame in two seconds, the largest unit that makes one a second or more.
    fn of(images: &[(Time, PathBuf)]) -> Self {
        const UNIT: Time = 1_000_000_000;
        let largest = images.last().map_or(0, |(time, _)| *time / UNIT);
        match largest {
            100_000_000_000..100_000_000_000_000 => return Self::Milliseconds,
            100_000_000_000_000..100_000_000_000_000_000 => return Self::Microseconds,
            100_000_000_000_000_000.. => return Self::Nanoseconds,
            _ => {}
        }
        let mut steps: Vec<Time> = images.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        steps.retain(|step| *step > 0);
        steps.sort_unstable();
        let Some(step) = steps.get(steps.len() / 2) else { return Self::Seconds };
        let whole = images.iter().all(|(time, _)| time % UNIT == 0);
        if !whole || *step <= 2 * UNIT {
            return Self::Seconds;
        }
        let units = [Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];
        units.into_iter().find(|unit| unit.nanoseconds(*step) <= UNIT).unwrap_or(Self::Seconds)
    }

    /// A time in nanoseconds.
    fn nanoseconds(self, time: Time) -> i128 {
        time / match self {
            Self::Seconds => 1,
            Self::Milliseconds => 1_000,
            Self::Microseconds => 1_000_000,
            Self::Nanoseconds => 1_000_000_000,
        }
    }

    fn name(self) -> Option<&'static str> {
        match self {
            Self::Seconds => None,
            Self::Milliseconds => Some("milliseconds"),
            Self::Microseconds => Some("microseconds"),
            Self::Nanoseconds => Some("nanoseconds"),
        }
    }
}

/// A time stamp, exactly as it is written.
fn time(word: &str) -> Result<Time, String> {
    parse_billionths(word).ok_or_else(|| format!("`{}` is not a time", crate::error::quote(word.as_bytes())))
}

/// `depth.txt`: a time stamp and a file name a line.
fn read_images(folder: &Path, file: &Path) -> Result<Vec<(Time, PathBuf)>, DepthFileError> {
    let mut images = Vec::new();
    for_each_line(file, |words| {
        let [stamp, name] = words[..] else {
            return Err("a time stamp and a file name are expected".to_owned());
        };
        let path = inside(folder, name).ok_or("an image lies in another folder")?;
        images.push((time(stamp)?, path));
        Ok(())
    })?;
    if images.is_empty() {
        return Err(DepthFileError::NoImages { path: file.to_owned() });
    }
    images.sort_by_key(|image| image.0);
    Ok(images)
}

/// `camera.json` without poses, or `calibration.txt` with `fx fy cx cy` and possibly `width height`, or the defaults.
fn read_lens(folder: &Path) -> Result<Optics, DepthFileError> {
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
    Ok(Optics { intrinsics, units: Units::new(TUM_DEPTH_SCALE_M, None), distortion: None })
}

/// Poses in order of time, in nanoseconds; of a bad one what is wrong with it.
struct Trajectory(Vec<(i128, Result<Placed, DepthError>)>);

/// A turn and a place.
type Placed = (DQuat, DVec3);

impl Trajectory {
    /// `groundtruth.txt`: time stamp, translation, and a quaternion whose last number is its real part, a line. A pose that is none
    /// costs the images nearest to it, not the file.
    fn read(file: &Path, unit: TimeUnit) -> Result<Self, DepthFileError> {
        let mut poses = Vec::new();
        for_each_line(file, |words| {
            let [stamp, pose @ ..] = &words[..] else { return Ok(()) };
            poses.push((unit.nanoseconds(time(stamp)?), pose_of(pose)));
            Ok(())
        })?;
        poses.sort_by_key(|pose| pose.0);
        Ok(Self(poses))
    }

    /// The pose at a time, on the way from the pose before to the pose after, if the nearer of them is near enough.
    fn at(&self, time_ns: i128) -> Option<Result<CameraPose, DepthError>> {
        let after = self.0.partition_point(|(t, _)| *t < time_ns);
        let mut before = self.0[after.saturating_sub(1)..].first()?;
        let mut after = self.0.get(after).unwrap_or(before);
        let nearest = if (time_ns - before.0).abs() < (after.0 - time_ns).abs() { before } else { after };
        if (time_ns - nearest.0).abs() as f64 > TUM_TIME_LIMIT_S * 1e9 {
            return None;
        }
        if let Err(cause) = nearest.1 {
            return Some(Err(cause));
        }
        // A bad pose on the farther side says nothing.
        if before.1.is_err() || after.1.is_err() {
            (before, after) = (nearest, nearest);
        }
        let (Ok(start), Ok(end)) = (before.1, after.1) else { return None };
        let span = (after.0 - before.0) as f64;
        let share = if span > 0.0 { ((time_ns - before.0) as f64 / span).clamp(0.0, 1.0) } else { 0.0 };
        let rotation = DMat3::from_quat(start.0.slerp(end.0, share));
        Some(Ok(CameraPose { rotation, centre: start.1.lerp(end.1, share) }))
    }
}

/// The turn and the place that seven words say.
fn pose_of(words: &[&str]) -> Result<Placed, DepthError> {
    let fault = |why| Err(DepthError::Pose { why });
    let numbers: Option<Vec<f64>> = words.iter().map(|word| parse_float(word.as_bytes())).collect();
    let Some([tx, ty, tz, qx, qy, qz, qw]) = numbers.and_then(|numbers| <[f64; 7]>::try_from(numbers).ok())
    else {
        return fault("tx ty tz qx qy qz qw are expected");
    };
    let (turn, place) = (DQuat::from_xyzw(qx, qy, qz, qw), DVec3::new(tx, ty, tz));
    if !(turn.is_finite() && place.is_finite()) {
        return fault("a number is not finite");
    }
    if (turn.length() - 1.0).abs() > 0.01 {
        return fault("the quaternion has not length 1");
    }
    Ok((turn.normalize(), place))
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
