//! What keeps a capture from becoming a stream.

use crate::{DeviceError, FrameRangeError, Length, MemoryError, StreamError};
use isv_decode::BackendError;
use isv_format::FormatError;
use isv_fusion::FusionError;
use isv_ingest::IngestError;
use isv_io::{DepthFileError, FrameStreamError, ReadError, ScaleError, SequenceError, Unit, VolumeError};
use isv_metrics::CompareError;
use isv_volume::{BlockEdge, GridError};
use std::io;
use thiserror::Error;

/// An input in which no frames can be found.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// Files of meshes or points.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// Neither files of meshes or points, nor anything else.
    #[error(
        "{0}; or a folder of depth images, with a camera.json, rig.json or depth.txt, or of volumes, with a coords.npy and a \
         tsdf.npy, or dense fields as .npy or .npz"
    )]
    NoFrames(SequenceError),
    /// An animated file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Depth images.
    #[error(transparent)]
    Depth(#[from] DepthFileError),
    /// Volumes.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A stream.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// A named pipe that ends in `.isv`, which cannot be opened more than once.
    #[error("{name}: no regular file")]
    NoRegularFile {
        /// Name of the input.
        name: String,
    },
    /// A pipe on which no frames come.
    #[error("{name}: {cause}")]
    Pipe {
        /// Name of the input.
        name: String,
        /// What is wrong.
        cause: Box<FrameStreamError>,
    },
    /// A pipe that cannot be read.
    #[error("{name}: {cause}")]
    Io {
        /// Name of the input.
        name: String,
        /// What is wrong.
        cause: io::Error,
    },
    /// An animation that the file does not have.
    #[error("{name}: no animation {asked}: it has {others}")]
    NoSuchAnimation {
        /// Name of the input.
        name: String,
        /// What was asked for.
        asked: String,
        /// Names of those that it has.
        others: String,
    },
    /// An animation was asked for by name, of a capture that is no glTF file with animations.
    #[error("{name}: has no animations to choose from")]
    NotAnimated {
        /// Name of the input.
        name: String,
    },
    /// Frames that are not there.
    #[error("{name}: {cause}")]
    Range {
        /// Name of the input.
        name: String,
        /// What is wrong.
        cause: FrameRangeError,
    },
    /// Two captures of different numbers of frames, which cannot be compared.
    #[error("{name} has {frames} frames but {reference} has {in_reference}")]
    Unequal {
        /// Name of the one.
        name: String,
        /// Number of its frames.
        frames: usize,
        /// Name of the other, which is the reference.
        reference: String,
        /// Number of its frames.
        in_reference: usize,
    },
    /// A pipe where the number of frames must be known, or the input is read more than once.
    #[error("{name}: a pipe cannot be used here: name a file or folder")]
    Uncounted {
        /// Name of the input.
        name: String,
    },
}

/// A frame that cannot be read or used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FrameError {
    /// File of the frame.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Scale of the frame, which is that of another unit.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// Depth images of the frame.
    #[error(transparent)]
    Depth(#[from] DepthFileError),
    /// Arrays of the frame.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The stream that it is of.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The pipe that it came from.
    #[error("{name}: {cause}")]
    Pipe {
        /// Name of the input.
        name: String,
        /// What is wrong.
        cause: Box<FrameStreamError>,
    },
    /// A pipe that ended before the frames asked for.
    #[error("{name}: {cause}")]
    Range {
        /// Name of the input.
        name: String,
        /// What is wrong.
        cause: FrameRangeError,
    },
    /// Surface of the frame, which cannot become a volume.
    #[error("{name}: {cause}")]
    Ingest {
        /// Name of the frame.
        name: String,
        /// What is wrong.
        cause: IngestError,
        /// Edges of its bounding box (m), if it has one.
        extent_m: Option<[f64; 3]>,
        /// Unit that its coordinates were taken in.
        unit: Unit,
    },
    /// Depth images, which cannot become a volume.
    #[error("{name}: {cause}")]
    Fusion {
        /// Name of the frame.
        name: String,
        /// What is wrong.
        cause: FusionError,
    },
    /// A mesh among points.
    #[error("{name}: a mesh, but the frames before it are points: a capture is one or the other")]
    MeshAmongPoints {
        /// Name of the frame.
        name: String,
    },
    /// Points among meshes.
    #[error(
        "{name}: points and no faces, but the frames before it are meshes: a capture is one or the other"
    )]
    PointsAmongMeshes {
        /// Name of the frame.
        name: String,
    },
    /// More memory than decoders have.
    #[error("{name}: {cause}")]
    Memory {
        /// Name of the frame.
        name: String,
        /// What is wrong.
        cause: MemoryError,
    },
    /// The device that works on it.
    #[error("{name}: {cause}")]
    Device {
        /// Name of the frame.
        name: String,
        /// What is wrong.
        cause: DeviceError,
    },
    /// Points or depth images where a surface is needed.
    #[error("{name}: points and depth images have no surface before they are encoded")]
    NoSurfaceYet {
        /// Name of the frame.
        name: String,
    },
}

/// A choice that cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum OptionsError {
    /// Options of which only one can be met.
    #[error("{0} and {1}: only one of them can be met")]
    Conflict(OptionName, OptionName),
    /// Groups of pictures that are coded by themselves, and a setting that goes from one to the next.
    #[error("fixed-gop: {0} goes from one group of pictures to the next")]
    Carries(&'static str),
    /// An option that makes sense with another one alone.
    #[error("{0} needs {1}")]
    Needs(OptionName, OptionName),
    /// An option of profile `main` in profile `paper`.
    #[error("{0}: this is a setting of profile main, not of profile paper")]
    NotInPaper(OptionName),
    /// An option of profile `paper` in profile `main`. `chosen`: whether that profile was asked for.
    #[error("{option}: this is a setting of profile paper, not of profile main")]
    NotInMain {
        /// The option.
        option: OptionName,
        /// Whether the profile was asked for.
        chosen: bool,
    },
    /// Fitting voxels by trial in profile `paper`.
    #[error("voxel auto: this is for profile main, not for profile paper")]
    AutoVoxelInPaper,
    /// A voxel size out of range.
    #[error("voxel {0}: {1}")]
    Voxel(Length, GridError),
    /// A truncation out of range.
    #[error("truncation: {0}")]
    Truncation(GridError),
    /// A block edge out of range.
    #[error("block: {0}")]
    Block(GridError),
    /// A block edge that profile `main` does not have.
    #[error("block {edge}: profile main has blocks of 8^3 voxels")]
    BlockInMain {
        /// Edge asked for (voxels).
        edge: u32,
        /// Whether the profile was asked for.
        chosen: bool,
    },
    /// Coefficients that a block does not have.
    #[error("coefficients {asked}: a block of {edge}^3 voxels has 1 to {most} of them", edge = edge.voxels())]
    Coefficients {
        /// Number asked for.
        asked: u16,
        /// Edge of a block.
        edge: BlockEdge,
        /// Largest number.
        most: usize,
    },
    /// A quantizer step out of range.
    #[error("{option} {asked}: at voxels of {voxel} a step is between {least} and {most}")]
    Step {
        /// The option.
        option: OptionName,
        /// Step asked for.
        asked: Length,
        /// Voxel size.
        voxel: Length,
        /// Smallest step.
        least: Length,
        /// Largest step.
        most: Length,
    },
    /// A shell that would not fit into the truncation.
    #[error("offset {asked}: it must be above 0 and at most the truncation of {truncation} voxels")]
    Offset {
        /// Half the thickness asked for (voxels).
        asked: f64,
        /// Truncation (voxels).
        truncation: u32,
    },
    /// An option that needs the whole take before its first frame is coded.
    #[error("{0}: frames that come one by one cannot be coded twice")]
    NeedsTake(OptionName),
    /// A number that is not in its range.
    #[error("{option}: {what}")]
    Range {
        /// The option.
        option: OptionName,
        /// What the number must be.
        what: &'static str,
    },
}

/// Options that errors name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OptionName {
    /// Quality, 0 to 100.
    Quality,
    /// Quality of colour, 0 to 100.
    ColourQuality,
    /// Bit rate.
    Bitrate,
    /// Largest error.
    MaxError,
    /// Passes over the input.
    Passes,
    /// Work to take on.
    Preset,
    /// Recovery from losses.
    Refresh,
    /// Coding of unobserved voxels.
    Masks,
    /// Tools of profile `main` to leave out.
    Without,
    /// Prediction in profile `paper`.
    Motion,
    /// Transform coefficients of a block in profile `paper`.
    Coefficients,
    /// Quantizer step of means in profile `paper`.
    DcStep,
    /// Quantizer step of other coefficients in profile `paper`.
    AcStep,
    /// Frame rate.
    FrameRate,
    /// Voxel size by trial.
    AutoVoxel,
    /// Groups of pictures that are coded by themselves.
    FixedGop,
    /// Frame at which the stream's time begins.
    TimeOrigin,
    /// Largest depth that counts.
    MaxDepth,
    /// Title of the take.
    Title,
    /// What captured the take.
    Device,
}

impl std::fmt::Display for OptionName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Quality => "quality",
            Self::MaxDepth => "max-depth",
            Self::Title => "title",
            Self::Device => "capture-device",
            Self::ColourQuality => "colour-quality",
            Self::Bitrate => "bitrate",
            Self::MaxError => "max-error",
            Self::Passes => "passes",
            Self::Preset => "preset",
            Self::Refresh => "refresh",
            Self::Masks => "masks",
            Self::Without => "without",
            Self::Motion => "motion",
            Self::Coefficients => "coefficients",
            Self::DcStep => "dc-step",
            Self::AcStep => "ac-step",
            Self::FrameRate => "fps",
            Self::AutoVoxel => "voxel auto",
            Self::FixedGop => "fixed-gop",
            Self::TimeOrigin => "time-origin",
        })
    }
}

/// A take that could not be encoded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The options.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The input.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The device that does the arithmetic.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The output.
    #[error(transparent)]
    Write(#[from] FormatError),
    /// The comparison of sample frames that voxels are tried on.
    #[error("{name}: {cause}")]
    Compare {
        /// Name of the frame.
        name: String,
        /// What is wrong.
        cause: CompareError,
    },
    /// No sample frame with a surface to choose a voxel size by.
    #[error("{name}: no frame with a surface to choose a voxel size by")]
    NoSample {
        /// Name of the input.
        name: String,
    },
    /// An empty range of frames to choose a voxel size by.
    #[error("{name}: no frames to choose a voxel size by")]
    NoFramesToChooseBy {
        /// Name of the input.
        name: String,
    },
    /// Frames that voxels cannot be tried on.
    #[error("{name}: a voxel size is chosen by meshes alone")]
    NoMesh {
        /// Name of the frame.
        name: String,
    },
    /// No frame that could be used.
    #[error("{name}: no frame could be used{}", skipped_in_words(*.skipped))]
    NoFrames {
        /// Name of the input.
        name: String,
        /// Frames that were skipped, where that was counted.
        skipped: Option<usize>,
    },
    /// No frame with a surface.
    #[error("{name}: no surface in any frame")]
    NoSurface {
        /// Name of the input.
        name: String,
    },
    /// A stream whose sink failed before.
    #[error("the stream has ended with an error before")]
    Ended,
    /// Cancelled while the settings were looked for.
    #[error("interrupted before the last pass")]
    CancelledBeforeLastPass,
    /// Cancelled before anything was written.
    #[error("interrupted before the first frame")]
    CancelledBeforeFirstFrame,
}

fn skipped_in_words(count: Option<usize>) -> String {
    count.map_or_else(String::new, |count| {
        format!(", {count} {} skipped", if count == 1 { "frame" } else { "frames" })
    })
}

impl EncodeError {
    /// Whether a single frame is at fault, so that the others may be sound.
    #[must_use]
    pub fn is_frame(&self) -> bool {
        matches!(self, Self::Frame(_))
    }

    /// Whether it is a device that failed, and not what it was given.
    #[must_use]
    pub fn is_device(&self) -> bool {
        matches!(
            self,
            Self::Device(_)
                | Self::Frame(FrameError::Device { .. })
                | Self::Frame(FrameError::Fusion { cause: FusionError::Backend(_), .. })
        )
    }
}

impl From<BackendError> for EncodeError {
    fn from(error: BackendError) -> Self {
        Self::Device(DeviceError::new(error))
    }
}
