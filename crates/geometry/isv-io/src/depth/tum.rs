//! The layout of the TUM RGB-D benchmark: `depth.txt` and `groundtruth.txt`.

use super::camera_json::Lens;
use super::colour::{Beside, ColourCamera, ColourKey, ColourKeys};
use super::error::{DepthFileError, io_error};
use super::image::Units;
use super::json::read_json;
use super::times::{self, TimeUnit};
use super::{BadPose, Camera, DepthSequence, Optics, Poses};
use crate::Colours;
use crate::inside::inside;
use crate::regular_file;
use crate::text::{self, parse_billionths, parse_float};
use glam::{DMat3, DQuat, DVec2, DVec3};
use isv_volume::{CameraPose, Intrinsics};
use serde::Deserialize;
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

/// `camera.json` beside the lists.
#[derive(Debug, Deserialize)]
struct CameraFile {
    #[serde(flatten)]
    lens: Lens,
    time_unit: Option<TimeUnit>,
    /// The colour camera; its images are those of `rgb.txt`.
    #[serde(flatten)]
    colour: ColourKey,
}

/// The list of colour images.
const COLOURS: &str = "rgb.txt";

/// Description of the camera by its folder.
struct Given {
    optics: Optics,
    time_unit: Option<TimeUnit>,
    colour: Option<ColourKey>,
}

/// Opens a folder by its `depth.txt`.
pub(crate) fn open(folder: &Path, file: &Path, colours: Colours) -> Result<DepthSequence, DepthFileError> {
    let images = read_images(folder, file)?;
    if images.is_empty() {
        return Err(DepthFileError::NoImages { path: file.to_owned() });
    }
    let Given { optics, time_unit: given_unit, colour } = read_camera(folder)?;
    let stamps: Vec<Time> = images.iter().map(|image| image.0).collect();
    let unit = given_unit.unwrap_or_else(|| TimeUnit::from_stamps(&stamps));
    let list = folder.join("groundtruth.txt");
    let trajectory = Trajectory::read(&list, unit)?;
    let (mut times, mut poses, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    for (time, path) in images {
        let time_ns = unit.nanoseconds(time);
        if let Some(pose) = trajectory.at(time_ns) {
            times.push(time_ns);
            poses.push(pose);
            paths.push(path);
        }
    }
    if times.is_empty() {
        let limit_s = TUM_TIME_LIMIT_S;
        return Err(DepthFileError::NoPose { path: list, images: stamps.len(), limit_s });
    }
    let times_ns = times::since_first(&times, file)?;
    let fps = times::median_rate(&times_ns);
    let poses = Poses::Moving { file: list.clone(), poses };
    let colours = match (colours, folder.join(COLOURS)) {
        (Colours::Keep, file) if file.is_file() => {
            let depth = Some((0, &paths[..]));
            let beside = Beside { folder, file: &file, name: None, optics: &optics, poses: &poses, depth };
            let keys = colour.map(|key| key.keys(colours, false, &beside)).transpose()?.flatten();
            read_colours(&beside, keys, unit, &times, &trajectory, &list)?
        }
        _ => None,
    };
    let colours = colours.into_iter().collect();
    let sequence =
        DepthSequence::new(folder, vec![Camera { optics, poses, paths }], fps).with_colours(colours);
    Ok(DepthSequence {
        skipped: stamps.len() - times.len(),
        times_ns: Some(times_ns),
        time_unit: if given_unit.is_none() { unit.doubtful_name(&stamps) } else { None },
        ..sequence
    })
}

/// Time as a list has it, in billionths of its unit. It is exact, where a number of seconds since 1970 has no
/// room for nanoseconds in `f64`.
type Time = i128;

/// A time stamp, exactly as it is written.
fn time(word: &str) -> Result<Time, String> {
    parse_billionths(word).ok_or_else(|| format!("`{}` is not a time", crate::error::quote(word.as_bytes())))
}

/// `depth.txt` or `rgb.txt`: a time stamp and a file name a line.
fn read_images(folder: &Path, file: &Path) -> Result<Vec<(Time, PathBuf)>, DepthFileError> {
    let mut images = Vec::new();
    for_each_line(file, |_, words| {
        let [stamp, name] = words[..] else {
            return Err("a time stamp and a file name are expected".to_owned());
        };
        let path = inside(folder, name).ok_or("an image lies in another folder")?;
        images.push((time(stamp)?, path));
        Ok(())
    })?;
    images.sort_by_key(|image| image.0);
    Ok(images)
}

/// The colour image nearest in time to each depth image, from where the camera was when it was taken. None if no image is there.
fn read_colours(
    beside: &Beside,
    keys: Option<ColourKeys>,
    unit: TimeUnit,
    times_ns: &[i128],
    trajectory: &Trajectory,
    list: &Path,
) -> Result<Option<ColourCamera>, DepthFileError> {
    let images = read_images(beside.folder, beside.file)?;
    let images: Vec<(i128, PathBuf)> =
        images.into_iter().map(|(time, path)| (unit.nanoseconds(time), path)).collect();
    let limit_ns = (times::COLOUR_LIMIT_S * 1e9) as i128;
    let nearest = |time_ns: &i128| {
        let (shown_ns, path) = times::nearest(&images, *time_ns, limit_ns)?;
        let pose = trajectory.at(*shown_ns)?.ok()?;
        Some((pose, path.clone()))
    };
    let found: Vec<Option<(CameraPose, PathBuf)>> = times_ns.iter().map(nearest).collect();
    // A frame without an image needs no pose.
    let nowhere = CameraPose { rotation: DMat3::IDENTITY, centre: DVec3::ZERO };
    let poses = found.iter().map(|found| Ok(found.as_ref().map_or(nowhere, |(pose, _)| *pose))).collect();
    let poses = Poses::Moving { file: list.to_owned(), poses };
    let paths: Vec<Option<PathBuf>> = found.into_iter().map(|found| found.map(|(_, path)| path)).collect();
    // A list may have come without its images.
    if !paths.iter().flatten().any(|path| path.is_file()) {
        return Ok(None);
    }
    let beside = Beside { poses: &poses, ..*beside };
    match keys {
        Some(ColourKeys::Camera(keys)) => keys.camera(&beside, paths).map(Some),
        _ => Ok(Some(ColourCamera::registered(&beside, paths))),
    }
}

/// `camera.json` without poses, or `calibration.txt` with `fx fy cx cy` and possibly `width height`, or the defaults.
fn read_camera(folder: &Path) -> Result<Given, DepthFileError> {
    let (json, text) = (folder.join("camera.json"), folder.join("calibration.txt"));
    if json.is_file() {
        let CameraFile { lens, time_unit, colour } = read_json(&json)?;
        return Ok(Given { optics: lens.check(&json, None)?, time_unit, colour: Some(colour) });
    }
    let mut intrinsics = TUM_INTRINSICS;
    if text.is_file() {
        for_each_line(&text, |_, words| {
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
    let optics = Optics { intrinsics, units: Units::new(TUM_DEPTH_SCALE_M, None), distortion: None };
    Ok(Given { optics, time_unit: None, colour: None })
}

/// Poses in order of time, in nanoseconds.
struct Trajectory {
    poses: Vec<(i128, DQuat, DVec3)>,
    /// Times of lines without a pose, in order, and what is wrong with each.
    lost: Vec<(i128, BadPose)>,
}

impl Trajectory {
    /// `groundtruth.txt`: time stamp, translation, and a quaternion whose last number is its real part, a line. A line that holds no pose
    /// costs the images nearest to it in time, not the file.
    fn read(file: &Path, unit: TimeUnit) -> Result<Self, DepthFileError> {
        let mut lines = Vec::new();
        for_each_line(file, |line, words| {
            let stamp =
                words.first().ok_or("a time stamp is expected".to_owned()).and_then(|word| time(word));
            let pose =
                stamp.clone().and_then(|_| pose_of(&words[1..])).map_err(|why| BadPose::Line { line, why });
            lines.push((stamp.ok().map(|stamp| unit.nanoseconds(stamp)), pose));
            Ok(())
        })?;
        if let Some((_, Err(BadPose::Line { line, why }))) = lines.first()
            && lines.iter().all(|(_, pose)| pose.is_err())
        {
            return Err(DepthFileError::Line { path: file.to_owned(), line: *line, why: why.clone() });
        }
        let times: Vec<Option<i128>> = lines.iter().map(|line| line.0).collect();
        let (mut poses, mut lost) = (Vec::new(), Vec::new());
        for (time_ns, (_, pose)) in filled_in(&times).into_iter().zip(lines) {
            match pose {
                Ok((turn, place)) => poses.push((time_ns, turn, place)),
                Err(why) => lost.push((time_ns, why)),
            }
        }
        poses.sort_by_key(|pose| pose.0);
        lost.sort_by_key(|line| line.0);
        Ok(Self { poses, lost })
    }

    /// Pose at a time, on the way from the pose before to the pose after, if the nearer of them is near
    /// enough. An error if a line without a pose is nearer.
    fn at(&self, time_ns: i128) -> Option<Result<CameraPose, BadPose>> {
        let limit_ns = (TUM_TIME_LIMIT_S * 1e9) as i128;
        let after = self.poses.partition_point(|(t, ..)| *t < time_ns);
        let before = self.poses[after.saturating_sub(1)..].first()?;
        let after = self.poses.get(after).unwrap_or(before);
        let apart = (time_ns - before.0).abs().min((after.0 - time_ns).abs());
        let next_lost = self.lost.partition_point(|(t, _)| *t < time_ns);
        let lost = self.lost[next_lost.saturating_sub(1)..].iter().take(2);
        if let Some((t, why)) = lost.min_by_key(|(t, _)| (t - time_ns).abs())
            && (t - time_ns).abs() < apart.min(limit_ns + 1)
        {
            return Some(Err(why.clone()));
        }
        if apart > limit_ns {
            return None;
        }
        let span = (after.0 - before.0) as f64;
        let share = if span > 0.0 { ((time_ns - before.0) as f64 / span).clamp(0.0, 1.0) } else { 0.0 };
        let rotation = DMat3::from_quat(before.1.slerp(after.1, share));
        Some(Ok(CameraPose { rotation, centre: before.2.lerp(after.2, share) }))
    }
}

/// Times of all lines. Those that cannot be read lie evenly between their neighbours. Before the first and
/// after the last they are as far apart as times mostly are.
fn filled_in(times: &[Option<i128>]) -> Vec<i128> {
    let known: Vec<(usize, i128)> =
        times.iter().enumerate().filter_map(|(line, time)| Some((line, (*time)?))).collect();
    let mut steps: Vec<i128> =
        known.windows(2).map(|pair| pair[1].1 - pair[0].1).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    let step = steps.get(steps.len() / 2).copied().unwrap_or_default();
    let mut next = 0;
    let fill = |(line, time): (usize, &Option<i128>)| {
        while known.get(next).is_some_and(|(at, _)| *at < line) {
            next += 1;
        }
        let before = next.checked_sub(1).map(|last| known[last]);
        time.unwrap_or_else(|| match (before, known.get(next)) {
            (Some((from, start)), Some((to, end))) => {
                start + (end - start) * (line - from) as i128 / (to - from) as i128
            }
            (Some((from, start)), None) => start + step * (line - from) as i128,
            (None, Some((to, end))) => end - step * (to - line) as i128,
            (None, None) => 0,
        })
    };
    times.iter().enumerate().map(fill).collect()
}

/// The turn and the place that seven words say.
fn pose_of(words: &[&str]) -> Result<(DQuat, DVec3), String> {
    let numbers: Vec<f64> = words
        .iter()
        .map(|word| parse_float(word.as_bytes()).ok_or_else(|| not_a_number(word)))
        .collect::<Result<_, _>>()?;
    let [tx, ty, tz, qx, qy, qz, qw] = numbers[..] else {
        return Err("a time stamp, tx ty tz and qx qy qz qw are expected".to_owned());
    };
    let (turn, place) = (DQuat::from_xyzw(qx, qy, qz, qw), DVec3::new(tx, ty, tz));
    if !(turn.is_finite() && place.is_finite()) {
        return Err("a number is not finite".to_owned());
    }
    if (turn.length() - 1.0).abs() > 0.01 {
        return Err(format!("the quaternion has length {}, not 1", turn.length()));
    }
    Ok((turn.normalize(), place))
}

/// Hands each line's number, counted from 1, and its words to a function; empty lines and those that start with `#` are passed over.
fn for_each_line(
    file: &Path,
    mut line: impl FnMut(usize, Vec<&str>) -> Result<(), String>,
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
            line(number + 1, words).map_err(named)?;
        }
    }
    Ok(())
}

fn number(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| not_a_number(word))
}

fn not_a_number(word: &str) -> String {
    format!("`{}` is not a number", crate::error::quote(word.as_bytes()))
}
