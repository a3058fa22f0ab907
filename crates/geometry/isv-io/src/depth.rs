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
mod colour;
mod distortion;
mod error;
mod exr_image;
mod image;
mod json;
mod listing;
mod png_image;
mod rig;
mod times;
mod tum;

pub use colour::ColourSequence;
pub use error::DepthFileError;
pub(crate) use times::{TimeUnit, median_rate};
pub use tum::{TUM_DEPTH_SCALE_M, TUM_INTRINSICS, TUM_TIME_LIMIT_S};

use crate::Colours;
use colour::{ColourCamera, read_views};
use distortion::Distortion;
use error::at_frame;
use image::{ImageFile, Units};
use isv_volume::{CameraPose, ColourView, DepthError, DepthImage, Intrinsics};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What the files that describe a folder of depth images are called, in the order in which they are looked for.
const RIG: &str = "rig.json";
const TUM: &str = "depth.txt";
const CAMERA: &str = "camera.json";

/// Whether a path is a folder of depth images. It has a file that describes them, `rig.json`, `depth.txt` or
/// `camera.json`; or a folder `depth`, for which such a file must have been meant.
#[must_use]
pub fn is_depth_folder(path: &Path) -> bool {
    [RIG, TUM, CAMERA].iter().any(|name| path.join(name).is_file()) || path.join("depth").is_dir()
}

/// Depth images of one or several cameras, frame after frame. Frames are read when they are asked for, one at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthSequence {
    folder: PathBuf,
    cameras: Vec<Camera>,
    colours: Vec<ColourCamera>,
    selected: Range<usize>,
    fps: Option<f64>,
    skipped: usize,
    /// When each frame was taken, in nanoseconds after the first, where the folder says.
    times_ns: Option<Vec<u64>>,
    /// How times in lists were taken, where that was not clear.
    time_unit: Option<&'static str>,
}

/// The images of one camera.
#[derive(Clone, Debug, PartialEq)]
struct Camera {
    optics: Optics,
    poses: Poses,
    /// One a frame.
    paths: Vec<PathBuf>,
}

/// What a camera's pixels mean.
#[derive(Clone, Debug, PartialEq)]
struct Optics {
    intrinsics: Intrinsics,
    units: Units,
    distortion: Option<Distortion>,
}

/// Most images that [`DepthSequence::saturation`] looks into.
const MOST_LOOKED_INTO: usize = 64;

/// Pixels of a value that most captures mean as "no reading", in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Saturation {
    /// The image.
    pub path: PathBuf,
    /// What the pixels hold.
    pub value: u16,
    /// Share of the image's pixels.
    pub share: f64,
    /// Whether they count as readings, as the capture's `invalid_values` leave them out.
    pub is_reading: bool,
    /// Depth that they stand for then, in metres.
    pub depth_m: f64,
}

/// Poses of a camera.
#[derive(Clone, Debug, PartialEq)]
enum Poses {
    Fixed(CameraPose),
    /// One a frame, or what is wrong with it.
    Moving {
        /// The file that says so.
        file: PathBuf,
        poses: Vec<Result<CameraPose, BadPose>>,
    },
}

/// Why a frame has no pose.
#[derive(Clone, Debug, PartialEq)]
enum BadPose {
    /// A matrix that is no pose.
    Matrix(DepthError),
    /// A line of a list, counted from 1.
    Line { line: usize, why: String },
}

impl BadPose {
    /// Names the frame and the file that should have said where its camera stood.
    fn at_frame(&self, file: &Path, frame: usize) -> DepthFileError {
        match self {
            Self::Matrix(cause) => at_frame(file, frame, *cause),
            Self::Line { line, why } => {
                DepthFileError::PoseLine { path: file.to_owned(), frame, line: *line, why: why.clone() }
            }
        }
    }
}

impl DepthSequence {
    /// Reads what describes a folder of depth images, and lists the images. None is opened yet. Colour images are passed over.
    ///
    /// # Errors
    /// See [`DepthFileError`].
    pub fn open(folder: &Path) -> Result<Self, DepthFileError> {
        Self::open_with(folder, Colours::Drop)
    }

    /// Reads what describes a folder of depth images, and lists the images, those of colours too if they are kept. None is opened yet.
    ///
    /// # Errors
    /// See [`DepthFileError`].
    pub fn open_with(folder: &Path, colours: Colours) -> Result<Self, DepthFileError> {
        if folder.join(RIG).is_file() {
            let file = folder.join(RIG);
            let sequence = rig::open(folder, &file, colours)?;
            match sequence.cameras.is_empty() {
                true => Err(rig::no_cameras(&file)),
                false => Ok(sequence),
            }
        } else if folder.join(TUM).is_file() {
            tum::open(folder, &folder.join(TUM), colours)
        } else if folder.join(CAMERA).is_file() {
            camera_json::open(folder, &folder.join(CAMERA), colours)
        } else {
            Err(DepthFileError::NoCalibration { folder: folder.to_owned() })
        }
    }

    /// All frames of some cameras, which have equally many.
    fn new(folder: &Path, cameras: Vec<Camera>, fps: Option<f64>) -> Self {
        let frames = cameras.first().map_or(0, |camera| camera.paths.len());
        Self {
            folder: folder.to_owned(),
            cameras,
            colours: Vec::new(),
            selected: 0..frames,
            fps,
            skipped: 0,
            times_ns: None,
            time_unit: None,
        }
    }

    /// The frames with colour images of some cameras, which have an entry for each frame. Without depth images they say how many frames
    /// there are.
    fn with_colours(self, colours: Vec<ColourCamera>) -> Self {
        let selected = match colours.first().filter(|_| self.cameras.is_empty()) {
            Some(camera) => 0..camera.paths.len(),
            None => self.selected,
        };
        Self { colours, selected, ..self }
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

    /// Number of cameras with colour images; 0 if these are passed over.
    #[must_use]
    pub fn colour_cameras(&self) -> usize {
        self.colours.len()
    }

    /// Whether colour images came without a calibration, so that one was assumed.
    #[must_use]
    pub fn colours_are_uncalibrated(&self) -> bool {
        self.colours.iter().any(|camera| camera.is_rough)
    }

    /// Number of frames of the selection without any colour image, though cameras have some.
    #[must_use]
    pub fn frames_without_colour(&self) -> usize {
        let is_bare =
            |frame: &usize| self.colours.iter().all(|camera| camera.paths[self.number(*frame)].is_none());
        if self.colours.is_empty() { 0 } else { (0..self.frames()).filter(is_bare).count() }
    }

    /// Reads the colour images of a frame: one a colour camera that has one, in the order of the layout.
    ///
    /// # Errors
    /// See [`DepthFileError`]; sizes are checked before anything is decoded.
    ///
    /// # Panics
    /// If there are not so many frames.
    pub fn read_colours(&self, frame: usize) -> Result<Vec<ColourView>, DepthFileError> {
        read_views(&self.colours, self.number(frame))
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

    /// Time at which a frame was taken, in nanoseconds after the first frame of the folder. The time stamps
    /// of `depth.txt` or of `camera.json` tell it, where the folder has them.
    ///
    /// # Panics
    /// If there are not so many frames.
    #[must_use]
    pub fn timestamp_ns(&self, frame: usize) -> Option<u64> {
        let frame = self.number(frame);
        self.times_ns.as_ref().map(|times| times[frame])
    }

    /// Whether any camera's lens distorts, so that its images are undistorted as they are read.
    #[must_use]
    pub fn is_undistorted(&self) -> bool {
        self.cameras.iter().any(|camera| camera.optics.distortion.is_some())
    }

    /// Unit that time stamps were taken to have, if the folder does not say and it is not clear. That is a
    /// unit other than seconds, or seconds that make less than a frame a second.
    #[must_use]
    pub fn time_unit(&self) -> Option<&'static str> {
        self.time_unit
    }

    /// Frames of the selection without a usable pose, as their numbers in it. [`Self::read`] says what is wrong with each.
    #[must_use]
    pub fn frames_without_pose(&self) -> Vec<usize> {
        let is_lost = |frame: &usize| {
            let number = self.number(*frame);
            self.cameras.iter().any(|camera| match &camera.poses {
                Poses::Fixed(_) => false,
                Poses::Moving { poses, .. } => poses[number].is_err(),
            })
        };
        (0..self.frames()).filter(is_lost).collect()
    }

    /// First image in which many pixels hold a value that may stand for "no reading", such as 65535. The
    /// capture does not say that it does. Looks into images of the first frame, the last and the one between.
    #[must_use]
    pub fn saturation(&self) -> Option<Saturation> {
        let Range { start, end } = self.selected;
        let frames = [start, start + (end - start) / 2, end - 1];
        let images =
            frames.into_iter().flat_map(|frame| self.cameras.iter().map(move |camera| (camera, frame)));
        images.take(MOST_LOOKED_INTO).find_map(|(camera, frame)| {
            let units = &camera.optics.units;
            let (value, share) = image::suspect(&camera.file(frame), units)?;
            Some(Saturation {
                path: camera.paths[frame].clone(),
                value,
                share,
                is_reading: !units.is_invalid(value),
                depth_m: f64::from(value) * units.depth_scale_m,
            })
        })
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

    /// The images of a frame of the selection: of depths, one a camera, then those of colours.
    ///
    /// # Panics
    /// If there are not so many frames.
    pub fn image_paths(&self, frame: usize) -> impl Iterator<Item = &Path> {
        let frame = self.number(frame);
        let colours = self.colours.iter().filter_map(move |camera| camera.paths[frame].as_deref());
        self.cameras.iter().map(move |camera| camera.paths[frame].as_path()).chain(colours)
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
        let pose = self.poses.at(frame)?;
        let Optics { intrinsics, units, distortion } = &self.optics;
        let mut depths = image::read(&self.file(frame), units)?;
        if let Some(distortion) = distortion {
            depths = distortion.undistort(intrinsics, &depths);
        }
        DepthImage::new(*intrinsics, pose, depths).map_err(|cause| at_frame(path, frame, cause))
    }

    fn file(&self, frame: usize) -> ImageFile<'_> {
        let Intrinsics { width, height, .. } = self.optics.intrinsics;
        ImageFile { path: &self.paths[frame], frame, size: [width, height] }
    }
}
