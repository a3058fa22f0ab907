//! Streams to files of meshes, points or volumes: the mirror image of `encode`.

mod error;
mod files;
mod format;
mod job;
mod options;
mod placement;
mod product;
mod reduction;

pub use error::{DecodeOptionsError, DecodeTakeError, PlacementOption, ProductError};
pub use format::{Form, OutputFormat};
pub use job::{DecodedFrameReport, DecodedReport, Job, Unfinished};
pub use options::DecodeOptions;
pub use reduction::Reductions;

use crate::Length;
use std::fmt;
use std::path::PathBuf;

/// A decision of decoding to files that its user may want to know.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum DecodeEvent {
    /// Coordinates of a glTF file are not in metres and Y up, which other programs take them for.
    NotGltf {
        /// Unit of the coordinates.
        unit: isv_io::Unit,
        /// Axis that points up.
        up: crate::Up,
    },
    /// Coordinates are rounded to single precision, the only one that a format has.
    Rounded {
        /// Name of the format.
        format: &'static str,
        /// Distance of neighbouring numbers there.
        spacing: Length,
    },
    /// Frames from before are left in the folder: who reads it as a take reads them too.
    LeftOver {
        /// The folder.
        folder: PathBuf,
        /// Number of frames.
        frames: usize,
        /// Name of the first one.
        first: String,
    },
}

impl fmt::Display for DecodeEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotGltf { unit, up } => write!(
                f,
                "glTF means metres and Y up: other programs will take {unit} and {} up for these",
                up.name()
            ),
            Self::Rounded { format, spacing } => {
                write!(
                    f,
                    "{format} holds single precision, which is good for {spacing} here: ply and obj hold more"
                )
            }
            Self::LeftOver { folder, frames, first } => write!(
                f,
                "{}: {frames} {} from before are left in it, from {first} on",
                folder.display(),
                if *frames == 1 { "frame" } else { "frames" }
            ),
        }
    }
}
