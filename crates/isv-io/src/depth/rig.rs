//! The layout of several cameras that stand still: `rig.json`.

use super::camera_json::{Lens, Rows, check_fps, pose, read_json};
use super::error::DepthFileError;
use super::listing::list_images;
use super::{Camera, DepthSequence, Poses};
use crate::inside::inside;
use serde::Deserialize;
use std::path::Path;

/// `rig.json`.
#[derive(Debug, Deserialize)]
struct RigFile {
    fps: Option<f64>,
    cameras: Vec<RigCamera>,
}

#[derive(Debug, Deserialize)]
struct RigCamera {
    name: String,
    #[serde(flatten)]
    lens: Lens,
    camera_to_world: Rows,
    /// A folder or a pattern, from the folder of `rig.json`.
    images: String,
}

/// Opens a folder by its `rig.json`.
pub(crate) fn open(folder: &Path, file: &Path) -> Result<DepthSequence, DepthFileError> {
    let RigFile { fps, cameras } = read_json(file)?;
    let fps = check_fps(fps, file)?;
    let mut opened: Vec<Camera> = Vec::new();
    let mut first: Option<String> = None;
    for RigCamera { name, lens, camera_to_world, images } in cameras {
        let (intrinsics, units) = lens.check(file, Some(&name))?;
        let pose = pose(&camera_to_world).map_err(|cause| DepthFileError::Camera {
            path: file.to_owned(),
            camera: Some(name.clone()),
            cause,
        })?;
        let images = inside(folder, &images)
            .ok_or_else(|| DepthFileError::Outside { path: file.to_owned(), name: images.clone() })?;
        let paths = list_images(&images)?;
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
        opened.push(Camera { intrinsics, units, poses: Poses::Fixed(pose), paths });
    }
    if opened.is_empty() {
        return Err(DepthFileError::Count {
            path: file.to_owned(),
            found: 0,
            what: "cameras",
            expected: 1,
            expected_what: "at least is needed".to_owned(),
        });
    }
    Ok(DepthSequence::new(folder, opened, fps))
}
