//! The layout of several cameras that stand still: `rig.json`.

use super::camera_json::{Lens, check_fps};
use super::colour::{Beside, ColourKey};
use super::error::DepthFileError;
use super::json::{Number, WrittenPose, read_json};
use super::listing::list_images;
use super::{Camera, ColourCamera, DepthSequence, Poses};
use crate::Colours;
use crate::inside::inside;
use isv_volume::MAX_PIXELS;
use serde::Deserialize;
use std::path::Path;

/// Most cameras of a rig. The largest capture stages have about a hundred.
const MAX_CAMERAS: usize = 256;

/// `rig.json`.
#[derive(Debug, Deserialize)]
struct RigFile {
    fps: Option<Number>,
    cameras: Vec<RigCamera>,
}

#[derive(Debug, Deserialize)]
struct RigCamera {
    name: String,
    #[serde(flatten)]
    lens: Lens,
    camera_to_world: WrittenPose,
    /// Depth images: a folder or a pattern, from the folder of `rig.json`. None of a camera that sees colours alone.
    images: Option<String>,
    #[serde(flatten)]
    colour: ColourKey,
}

/// Opens a folder by its `rig.json`. There may be no camera with depth images, if one has colour images that are kept.
pub(crate) fn open(folder: &Path, file: &Path, keep: Colours) -> Result<DepthSequence, DepthFileError> {
    let RigFile { fps, cameras } = read_json(file)?;
    let fps = check_fps(fps, file)?;
    let (mut opened, mut colours): (Vec<Camera>, Vec<ColourCamera>) = Default::default();
    let mut first: Option<String> = None;
    let too_large =
        |found, what, limit| DepthFileError::TooLarge { path: file.to_owned(), found, what, limit };
    if cameras.len() > MAX_CAMERAS {
        return Err(too_large(cameras.len() as u64, "cameras", MAX_CAMERAS as u64));
    }
    // One small file may serve all cameras, and all images of a frame are held at once: together they get no more room
    // than one image may have.
    let mut pixels = 0u64;
    for RigCamera { name, lens, camera_to_world, images, colour } in cameras {
        let optics = lens.check(file, Some(&name))?;
        if images.is_none() && !colour.is_given() {
            let why = "it names neither images nor colour".to_owned();
            return Err(DepthFileError::Distortion { path: file.to_owned(), camera: Some(name), why });
        }
        let pose = camera_to_world.pose().map_err(|cause| DepthFileError::Camera {
            path: file.to_owned(),
            camera: Some(name.clone()),
            cause,
        })?;
        let poses = Poses::Fixed(pose);
        let Some(images) = images else {
            let (optics, poses) = (&optics, &poses);
            let beside = Beside { folder, file, name: Some(&name), optics, poses, depth: None };
            if let Some(keys) = colour.keys(keep, true, &beside)? {
                colours.push(keys.open(&beside)?);
            }
            continue;
        };
        pixels += optics.intrinsics.pixels() as u64;
        if pixels > MAX_PIXELS {
            return Err(too_large(pixels, "pixels in the images of a frame", MAX_PIXELS));
        }
        let images = inside(folder, &images)
            .ok_or_else(|| DepthFileError::Outside { path: file.to_owned(), name: images.clone() })?;
        let paths = list_images(&images)?;
        let depth = Some((opened.len(), &paths[..]));
        let beside = Beside { folder, file, name: Some(&name), optics: &optics, poses: &poses, depth };
        if let Some(keys) = colour.keys(keep, true, &beside)? {
            colours.push(keys.open(&beside)?);
        }
        let first = first.get_or_insert(name);
        let expected = opened.first().map_or(paths.len(), |camera| camera.paths.len());
        if paths.len() != expected {
            return Err(DepthFileError::Count {
                path: images,
                found: paths.len(),
                what: "images",
                expected,
                expected_what: format!("of camera {first}; all cameras of a rig must have equally many"),
            });
        }
        opened.push(Camera { optics, poses, paths });
    }
    if opened.is_empty() && colours.is_empty() {
        return Err(no_cameras(file));
    }
    check_pairs(file, &opened)?;
    let frames = opened.first().map(|camera| camera.paths.len());
    let frames = frames.or_else(|| colours.first().map(|camera| camera.paths.len())).unwrap_or_default();
    if let Some(other) = colours.iter().find(|camera| camera.paths.len() != frames) {
        return Err(DepthFileError::Count {
            path: file.to_owned(),
            found: other.paths.len(),
            what: "colour images of a camera",
            expected: frames,
            expected_what: "frames; all cameras of a rig must have equally many".to_owned(),
        });
    }
    Ok(DepthSequence::new(folder, opened, fps).with_colours(colours))
}

/// The error of a rig without cameras of the kind that is wanted.
pub(crate) fn no_cameras(file: &Path) -> DepthFileError {
    DepthFileError::Count {
        path: file.to_owned(),
        found: 0,
        what: "cameras with depth images",
        expected: 1,
        expected_what: "at least is needed".to_owned(),
    }
}

/// Looks whether images of a frame were taken together, where their names say so. Numbers at the ends of
/// names must count images, each camera's from a number of its own. Numbers of which none is one more than
/// the last, such as times, say nothing.
fn check_pairs(file: &Path, cameras: &[Camera]) -> Result<(), DepthFileError> {
    let numbers =
        |camera: &Camera| camera.paths.iter().map(|path| number_of(path)).collect::<Option<Vec<_>>>();
    let Some(numbers) = cameras.iter().map(numbers).collect::<Option<Vec<Vec<u64>>>>() else { return Ok(()) };
    let counts = |numbers: &Vec<u64>| numbers.windows(2).any(|pair| pair[0].checked_add(1) == Some(pair[1]));
    if numbers.is_empty() || !numbers.iter().all(counts) {
        return Ok(());
    }
    let since_first = |camera: usize, frame: usize| numbers[camera][frame].wrapping_sub(numbers[camera][0]);
    for frame in 0..numbers[0].len() {
        if let Some(other) =
            (1..cameras.len()).find(|other| since_first(*other, frame) != since_first(0, frame))
        {
            let name = |camera: usize| {
                cameras[camera].paths[frame].file_name().unwrap_or_default().display().to_string()
            };
            return Err(DepthFileError::Unpaired {
                path: file.to_owned(),
                frame,
                names: [name(0), name(other)],
            });
        }
    }
    Ok(())
}

/// The number that the name of a file ends with, before its extension.
fn number_of(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_str()?;
    let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[stem.len() - digits..].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A rig of `cameras` cameras of a size, all of which see the same file. It is no image, so that only who reads it
    /// notices.
    fn rig(cameras: usize, [width, height]: [u32; 2]) -> (tempfile::TempDir, Result<DepthSequence, String>) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("all")).unwrap();
        std::fs::write(folder.path().join("all/0.png"), "no image").unwrap();
        let camera = json!({
            "name": "a", "width": width, "height": height, "fx": 1, "fy": 1, "cx": 0, "cy": 0,
            "camera_to_world": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "images": "all",
        });
        let file = folder.path().join("rig.json");
        let rig = json!({ "cameras": Value::Array(vec![camera; cameras]) });
        std::fs::write(&file, rig.to_string()).unwrap();
        let opened = open(folder.path(), &file, Colours::Drop);
        let opened = opened.map_err(|error| error.to_string().replace(file.to_str().unwrap(), "rig.json"));
        (folder, opened)
    }

    #[test]
    fn cameras_that_are_too_many_are_refused_before_an_image_is_read() {
        assert_eq!(rig(MAX_CAMERAS, [8, 8]).1.unwrap().cameras(), 256);
        assert_eq!(
            rig(MAX_CAMERAS + 1, [8, 8]).1.unwrap_err(),
            "rig.json: 257 cameras; at most 256 are read"
        );
    }

    #[test]
    fn the_images_of_a_frame_are_together_no_larger_than_one_may_be() {
        assert_eq!(rig(1, [1 << 14, 1 << 14]).1.unwrap().cameras(), 1);
        assert_eq!(rig(4, [1 << 13, 1 << 13]).1.unwrap().cameras(), 4);
        let expected = "rig.json: 335544320 pixels in the images of a frame; at most 268435456 are read";
        assert_eq!(rig(5, [1 << 13, 1 << 13]).1.unwrap_err(), expected);
    }
}
