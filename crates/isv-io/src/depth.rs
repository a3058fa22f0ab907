//! Folders of depth images with the cameras that took them.
//!
//! Three layouts are understood, told apart by the file that describes them (`docs/formats/depth.md` has examples):
//!
//! - `rig.json`: several cameras that stand still, one image each a frame;
//! - `depth.txt` and `groundtruth.txt`: the TUM RGB-D layout, a moving camera with time stamps;
//! - `camera.json` and a folder `depth`: a moving camera with a pose a frame.
//!
//! Images are 16-bit grey PNG, in units that the layout states, or EXR, in metres.

mod camera_json;
mod error;
mod exr_image;
mod image;
mod listing;
mod png_image;
mod rig;
mod tum;

pub use error::DepthFileError;
pub use tum::{TUM_DEPTH_SCALE_M, TUM_INTRINSICS, TUM_TIME_LIMIT_S};

use error::at_frame;
use image::{ImageFile, Units};
use isv_volume::{CameraPose, DepthImage, Intrinsics};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What the files that describe a folder of depth images are called, in the order in which they are looked for.
const RIG: &str = "rig.json";
const TUM: &str = "depth.txt";
const CAMERA: &str = "camera.json";

/// Whether a path is a folder with a file that describes depth images, `rig.json`, `depth.txt` or `camera.json`; or one
/// with a folder `depth`, for which such a file must have been meant.
#[must_use]
pub fn is_depth_folder(path: &Path) -> bool {
    [RIG, TUM, CAMERA].iter().any(|name| path.join(name).is_file()) || path.join("depth").is_dir()
}

/// Depth images of one or several cameras, frame after frame. Frames are read when they are asked for, one at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthSequence {
    folder: PathBuf,
    cameras: Vec<Camera>,
    selected: Range<usize>,
    fps: Option<f64>,
    skipped: usize,
}

/// The images of one camera.
#[derive(Clone, Debug, PartialEq)]
struct Camera {
    intrinsics: Intrinsics,
    units: Units,
    poses: Poses,
    /// One a frame.
    paths: Vec<PathBuf>,
}

/// Where a camera stands.
#[derive(Clone, Debug, PartialEq)]
enum Poses {
    Fixed(CameraPose),
    /// One a frame.
    Moving(Vec<CameraPose>),
}

impl DepthSequence {
    /// Reads what describes a folder of depth images, and lists the images. None is opened yet.
    ///
    /// # Errors
    /// See [`DepthFileError`].
    pub fn open(folder: &Path) -> Result<Self, DepthFileError> {
        if folder.join(RIG).is_file() {
            rig::open(folder, &folder.join(RIG))
        } else if folder.join(TUM).is_file() {
            tum::open(folder, &folder.join(TUM))
        } else if folder.join(CAMERA).is_file() {
            camera_json::open(folder, &folder.join(CAMERA))
        } else {
            Err(DepthFileError::NoCalibration { folder: folder.to_owned() })
        }
    }

    /// All frames of some cameras, which have equally many.
    fn new(folder: &Path, cameras: Vec<Camera>, fps: Option<f64>) -> Self {
        let frames = cameras.first().map_or(0, |camera| camera.paths.len());
        Self { folder: folder.to_owned(), cameras, selected: 0..frames, fps, skipped: 0 }
    }

    /// Number of frames; at least one.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.selected.len()
    }

    /// Number of images a frame; at least one.
    #[must_use]
    pub fn cameras(&self) -> usize {
        self.cameras.len()
    }

    /// Frames a second, if the folder tells: `fps` in the JSON files, the median distance of time stamps in `depth.txt`.
    #[must_use]
    pub fn fps(&self) -> Option<f64> {
        self.fps
    }

    /// Depth images that were left out because no pose is near enough in time ([`TUM_TIME_LIMIT_S`]).
    #[must_use]
    pub fn skipped(&self) -> usize {
        self.skipped
    }

    /// The files of a frame, one a camera.
    ///
    /// # Panics
    /// If there are not so many frames.
    #[must_use]
    pub fn paths(&self, frame: usize) -> Vec<&Path> {
        let frame = self.number(frame);
        self.cameras.iter().map(|camera| camera.paths[frame].as_path()).collect()
    }

    /// Reads a frame: one image a camera, in the order of the layout. Frames count from 0 within the selection; messages
    /// count in the whole sequence.
    ///
    /// # Errors
    /// See [`DepthFileError`]; memory for an image is taken only once its header states the camera's size. A frame of which
    /// no image has a reading is an error.
    ///
    /// # Panics
    /// If there are not so many frames.
    pub fn read(&self, frame: usize) -> Result<Vec<DepthImage>, DepthFileError> {
        let frame = self.number(frame);
        let images = self.cameras.iter().map(|camera| camera.read(frame)).collect::<Result<Vec<_>, _>>()?;
        if images.iter().all(|image| image.readings() == 0) {
            return Err(DepthFileError::NoReading { path: self.cameras[0].paths[frame].clone(), frame });
        }
        Ok(images)
    }

    /// Frames `range.start` up to but not including `range.end`, counted from 0.
    ///
    /// # Errors
    /// [`DepthFileError::OutOfRange`] if the range is empty or ends past the last frame.
    pub fn select(&self, range: Range<usize>) -> Result<Self, DepthFileError> {
        if range.is_empty() || range.end > self.frames() {
            let (folder, frames) = (self.folder.clone(), self.frames());
            return Err(DepthFileError::OutOfRange { folder, asked: range, frames });
        }
        let first = self.selected.start;
        Ok(Self { selected: first + range.start..first + range.end, ..self.clone() })
    }

    /// The images of a frame of the selection, one a camera.
    ///
    /// # Panics
    /// If there are not so many frames.
    pub fn image_paths(&self, frame: usize) -> impl Iterator<Item = &Path> {
        let frame = self.number(frame);
        self.cameras.iter().map(move |camera| camera.paths[frame].as_path())
    }

    /// Number in the whole sequence of a frame of the selection.
    fn number(&self, frame: usize) -> usize {
        assert!(frame < self.frames(), "frame {frame} of {}", self.frames());
        self.selected.start + frame
    }
}

impl Camera {
    fn read(&self, frame: usize) -> Result<DepthImage, DepthFileError> {
        let path = &self.paths[frame];
        let file = ImageFile { path, frame, size: [self.intrinsics.width, self.intrinsics.height] };
        let depths = image::read(&file, &self.units)?;
        let pose = match &self.poses {
            Poses::Fixed(pose) => *pose,
            Poses::Moving(poses) => poses[frame],
        };
        DepthImage::new(self.intrinsics, pose, depths).map_err(|cause| at_frame(path, frame, cause))
    }
}
