//! What can go wrong in a study.

use isv::raw::decode::DecodeError;
use isv::raw::format::FormatError;
use isv::raw::ingest::IngestError;
use isv::raw::io::OutputError;
use isv::raw::metrics::CompareError;
use isv_baseline::{DracoError, ProgramError, SimplifyError, TangError, ToolError, TrainingError};
use std::io;
use thiserror::Error;

/// A point that could not be measured, or a report that could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A frame of the take cannot be read; the cause names it.
    #[error("{0:#}")]
    Take(#[source] crate::TakeError),
    /// A take without frames.
    #[error("{take}: no frames to study")]
    NoFrames {
        /// Name of the take.
        take: String,
    },
    /// A codec needs other takes to be trained on, and there are none.
    #[error("a transform trained on other takes needs some: name them with --train")]
    NoTraining,
    /// A frame that does not become a volume.
    #[error("frame {frame}: {cause}")]
    Ingest {
        /// Number of the frame in the take.
        frame: usize,
        /// What is wrong with it.
        cause: IngestError,
    },
    /// A step that the quantizer does not have.
    #[error("a step of {metres} m is not possible at voxels of {voxel_m} m")]
    Step {
        /// The step.
        metres: f64,
        /// Edge of a voxel.
        voxel_m: f64,
    },
    /// A stream of our own that cannot be written or read.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A packet of our own that cannot be decoded.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A transform that cannot be trained.
    #[error("{take}: {cause}")]
    Training {
        /// The first take of those trained on.
        take: String,
        /// Why.
        cause: TrainingError,
    },
    /// A frame of a trained transform's stream that cannot be decoded.
    #[error(transparent)]
    Tang(#[from] TangError),
    /// Draco failed.
    #[error("frame {frame}: {cause}")]
    Draco {
        /// Number of the frame in the take.
        frame: usize,
        /// What it says.
        cause: DracoError,
    },
    /// A frame without a texture, for a codec of textures.
    #[error("frame {frame}: it has no texture, or several; this codec needs exactly one")]
    NoTexture {
        /// Number of the frame in the take.
        frame: usize,
    },
    /// The program of another codec failed at a frame.
    #[error("frame {frame}: {cause}")]
    Tool {
        /// Number of the frame in the take.
        frame: usize,
        /// Why.
        cause: ToolError,
    },
    /// The program of another codec failed at the take, or cannot be used at all.
    #[error(transparent)]
    ToolOfTake(#[from] ToolError),
    /// A mesh that cannot be simplified.
    #[error("frame {frame}: {cause}")]
    Simplify {
        /// Number of the frame in the take.
        frame: usize,
        /// Why.
        cause: SimplifyError,
    },
    /// A decoded frame that cannot be compared with what went in.
    #[error("frame {frame}: {cause}")]
    Compare {
        /// Number of the frame in the take.
        frame: usize,
        /// Why.
        cause: CompareError,
    },
    /// A codec gave back another number of frames than it was given.
    #[error("{decoded} frames came back of {encoded}")]
    FrameCount {
        /// Frames that went in.
        encoded: usize,
        /// Frames that came out.
        decoded: usize,
    },
    /// A folder in which something else is.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file of the report; the cause names it.
    #[error(transparent)]
    File(#[from] io::Error),
    /// A chart that cannot be drawn.
    #[error("a chart cannot be drawn: {0}")]
    Chart(String),
}

impl StudyError {
    /// Whether the codec would fail in the same way at its other points.
    #[must_use]
    pub fn is_of_all_points(&self) -> bool {
        match self {
            Self::Take(_) | Self::NoFrames { .. } | Self::NoTraining | Self::Training { .. } => true,
            Self::Ingest { .. } | Self::Simplify { .. } | Self::NoTexture { .. } => true,
            Self::Draco { cause, .. } => {
                matches!(cause, DracoError::Program(ProgramError::Run { .. } | ProgramError::TooLong { .. }))
            }
            Self::Tool { cause, .. } | Self::ToolOfTake(cause) => cause.is_of_all_settings(),
            _ => false,
        }
    }
}
