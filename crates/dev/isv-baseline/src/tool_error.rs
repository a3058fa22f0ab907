//! What can go wrong with the programs of other codecs.

use crate::ProgramError;
use isv_io::{ReadError, WriteError};
use isv_volume::MeshError;
use std::path::PathBuf;
use thiserror::Error;

/// A frame or a take that the program of another codec did not code or decode.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ToolError {
    /// Another program of the same name, or a version that does not say what it is.
    #[error("{}: does not call itself {mark:?}, so isv does not use it; it says: {says}", program.display())]
    Version {
        /// The program.
        program: PathBuf,
        /// The words that were looked for.
        mark: String,
        /// The beginning of what it says.
        says: String,
    },
    /// A program that needs files beside it which are not there.
    #[error("{}: needs {file}, which is in no folder cfg beside the program or up to 3 folders above", program.display())]
    Configuration {
        /// The program.
        program: PathBuf,
        /// The file, within the folder `cfg`.
        file: &'static str,
    },
    /// The mesh to encode cannot be worked with.
    #[error("the mesh to encode has {0}")]
    Mesh(#[from] MeshError),
    /// A surface that takes too many points at the density asked for.
    #[error(
        "the surface takes {samples:.0} samples at a step of {step_m} m, the limit is {limit:.0}; use fewer bits"
    )]
    TooManySamples {
        /// Samples that it takes.
        samples: f64,
        /// Step of the lattice, in metres.
        step_m: f64,
        /// Most samples.
        limit: f64,
    },
    /// A temporary file cannot be made, written or read.
    #[error("a temporary file: {0}")]
    Temporary(#[from] std::io::Error),
    /// The frame cannot be written for the program.
    #[error("the frame for the program: {0}")]
    Write(#[from] WriteError),
    /// The program failed.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// What the program wrote cannot be read.
    #[error("{}: its output cannot be read: {cause}", program.display())]
    Read {
        /// The program.
        program: PathBuf,
        /// What is wrong with it.
        cause: Box<ReadError>,
    },
    /// The program wrote a shape of another kind.
    #[error("{}: its output is not {expected}", program.display())]
    Kind {
        /// The program.
        program: PathBuf,
        /// What was expected.
        expected: &'static str,
    },
    /// A picture of another size than the first of its video.
    #[error("a texture of {} x {} pixels in a video of {} x {}", size[0], size[1], expected[0], expected[1])]
    PictureSize {
        /// Width and height of the picture in pixels.
        size: [u32; 2],
        /// Width and height of the video.
        expected: [u32; 2],
    },
}

impl ToolError {
    /// Whether the program would fail in the same way with other settings.
    #[must_use]
    pub fn is_of_all_settings(&self) -> bool {
        match self {
            Self::Version { .. } | Self::Configuration { .. } | Self::Mesh(_) | Self::PictureSize { .. } => {
                true
            }
            Self::Program(error) => {
                matches!(error, ProgramError::Run { .. } | ProgramError::TooLong { .. })
            }
            _ => false,
        }
    }
}
