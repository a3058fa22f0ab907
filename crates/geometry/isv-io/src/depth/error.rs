//! What can go wrong with depth images and their cameras. Every message is one sentence that starts with a file's name.

use crate::image::ImageFault;
use isv_volume::DepthError;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A folder of depth images, or an image in it, that cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DepthFileError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// An image that the operating system refused.
    #[error("{}: frame {frame}: {cause}", path.display())]
    ImageIo {
        /// The image.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// What the operating system said.
        cause: io::Error,
    },
    /// Nothing describes the cameras.
    #[error("{}: no depth images here: there is neither rig.json nor depth.txt nor camera.json", folder.display())]
    NoCalibration {
        /// The folder.
        folder: PathBuf,
    },
    /// A JSON file that is none, lacks a key or has a wrong value.
    #[error("{}: {why}{}", path.display(), if why.to_string().starts_with("invalid escape") { ": write / in names of files" } else { "" })]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column.
        why: serde_json::Error,
    },
    /// Images that are said to lie outside of the capture's folder.
    #[error("{}: `{name}` leads out of its folder; images must lie in it", path.display())]
    Outside {
        /// The file that says so.
        path: PathBuf,
        /// What it says.
        name: String,
    },
    /// A line of a text file that is not understood.
    #[error("{}: {why} (line {line})", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        why: String,
    },
    /// A camera that cannot be.
    #[error("{}: {}{cause}", path.display(), camera.as_ref().map(|name| format!("camera {name}: ")).unwrap_or_default())]
    Camera {
        /// The file that describes it.
        path: PathBuf,
        /// Name of the camera, if cameras have names.
        camera: Option<String>,
        /// What is wrong with it.
        cause: DepthError,
    },
    /// A lens that distorts in a way that is not understood, or a colour camera whose keys contradict each other.
    #[error("{}: {}{why}", path.display(), camera.as_ref().map(|name| format!("camera {name}: ")).unwrap_or_default())]
    Distortion {
        /// The file that describes it.
        path: PathBuf,
        /// Name of the camera, if cameras have names.
        camera: Option<String>,
        /// Reason, as the end of a sentence.
        why: String,
    },
    /// A pose of a moving camera that is none, or an image that does not fit its camera.
    #[error("{}: frame {frame}: {cause}", path.display())]
    Frame {
        /// The file that holds it.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// What is wrong with it.
        cause: DepthError,
    },
    /// A line of a list of poses that holds none.
    #[error("{}: frame {frame}: the pose is no rotation and translation: {why} (line {line})", path.display())]
    PoseLine {
        /// The list.
        path: PathBuf,
        /// The frame whose pose it is, counted from 0.
        frame: usize,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        why: String,
    },
    /// A time stamp that cannot be.
    #[error("{}: frame {frame}: {why}", path.display())]
    Time {
        /// The file that holds it.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// What is wrong.
        why: &'static str,
    },
    /// A number beside the lens and the pose that cannot be.
    #[error("{}: {name} is {value}; it must be above 0 and at most 1000000", path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// What the number is called.
        name: &'static str,
        /// Value of the setting.
        value: f64,
    },
    /// No images where they should be.
    #[error("{}: no depth images here; frames must be .png or .exr", path.display())]
    NoImages {
        /// The folder or pattern.
        path: PathBuf,
    },
    /// Two kinds of image in one place.
    #[error("{}: both .png and .exr images; name one kind with a pattern, or move the others away", path.display())]
    MixedImages {
        /// The folder or pattern.
        path: PathBuf,
    },
    /// A file with another number of frames than another.
    #[error("{}: {found} {what}, but {expected} {expected_what}", path.display())]
    Count {
        /// The file or folder.
        path: PathBuf,
        /// How many it has.
        found: usize,
        /// What these are.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// What tells so.
        expected_what: String,
    },
    /// Images of a frame whose numbers tell that they were not taken together.
    #[error(
        "{}: frame {frame}: {} and {} are no pair by their numbers: a camera has dropped an image. Move away those whose partners are missing",
        path.display(), names[0], names[1]
    )]
    Unpaired {
        /// The file that describes the cameras.
        path: PathBuf,
        /// The first such frame, counted from 0.
        frame: usize,
        /// An image of the first camera, and one of another.
        names: [String; 2],
    },
    /// More cameras, or larger ones, than a frame may have: the images of all cameras of a frame are in memory together.
    #[error("{}: {found} {what}; at most {limit} are read", path.display())]
    TooLarge {
        /// The file that describes the cameras.
        path: PathBuf,
        /// How many it has; of pixels, as many as were counted before the limit was passed.
        found: u64,
        /// What these are.
        what: &'static str,
        /// The most that are read.
        limit: u64,
    },
    /// No depth image has a pose near it in time.
    #[error(
        "{}: none of {images} depth images has a pose within {limit_s} s of its time stamp: look whether both lists have times of the same \
         clock and unit",
        path.display()
    )]
    NoPose {
        /// The file of poses.
        path: PathBuf,
        /// How many images there are.
        images: usize,
        /// The limit, in seconds.
        limit_s: f64,
    },
    /// An image of another size than its camera's.
    #[error(
        "{}: frame {frame}: an image of {} x {} pixels for a camera of {} x {}",
        path.display(), found[0], found[1], expected[0], expected[1]
    )]
    ImageSize {
        /// The image.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// Columns and rows of the image.
        found: [u64; 2],
        /// The camera's.
        expected: [u32; 2],
    },
    /// An image that is damaged, or of a kind that holds no depths.
    #[error("{}: frame {frame}: {why}", path.display())]
    Image {
        /// The image.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// What is wrong.
        why: String,
    },
    /// No colour images where the capture says they are.
    #[error("{}: no colour images here; they must be .png, .jpg or .webp", path.display())]
    NoColourImages {
        /// The folder or pattern.
        path: PathBuf,
    },
    /// A capture without colour images, where they are all that is wanted.
    #[error("{}: no camera has colour images with a calibration: name them under `colour`", path.display())]
    NoColour {
        /// The folder or file.
        path: PathBuf,
    },
    /// A colour image that is not there, damaged or too large.
    #[error("{}: frame {frame}: {cause}", path.display())]
    ColourImage {
        /// The image.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// Cause of the failure.
        cause: ImageFault,
    },
    /// A colour image of another shape than its camera's.
    #[error(
        "{}: frame {frame}: a colour image of {} x {} pixels has another shape than its camera, {} x {}",
        path.display(), found[0], found[1], expected[0], expected[1]
    )]
    ColourShape {
        /// The image.
        path: PathBuf,
        /// Frame, counted from 0.
        frame: usize,
        /// Columns and rows of the image.
        found: [u32; 2],
        /// Columns and rows of the camera.
        expected: [u32; 2],
    },
    /// No pixel of a frame has a depth.
    #[error("{}: frame {frame}: no pixel has a depth", path.display())]
    NoReading {
        /// The first image of the frame.
        path: PathBuf,
        /// The frame, counted from 0.
        frame: usize,
    },
    /// A range of frames that is empty or leaves the sequence.
    #[error(
        "{}: frames {}..{} asked for, but there are {frames} (0..{frames}) and a range holds at least one",
        folder.display(), asked.start, asked.end
    )]
    OutOfRange {
        /// The folder.
        folder: PathBuf,
        /// The range asked for.
        asked: Range<usize>,
        /// How many frames there are.
        frames: usize,
    },
}

/// Names the file and frame of an unusable pose or image.
pub(crate) fn at_frame(path: &Path, frame: usize, cause: DepthError) -> DepthFileError {
    DepthFileError::Frame { path: path.to_owned(), frame, cause }
}

/// Names the file that the operating system refused.
pub(crate) fn io_error(path: &Path) -> impl Fn(io::Error) -> DepthFileError + '_ {
    |cause| DepthFileError::Io { path: path.to_owned(), cause }
}
