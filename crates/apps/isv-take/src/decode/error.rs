//! Errors of decoding a stream to files.

use super::{Form, OutputFormat};
use crate::distances::DistancesError;
use crate::{DeviceError, MemoryError, StreamError, TextureTooSmall};
use isv_io::{OutputError, WriteError};
use isv_simplify::SimplifyError;
use isv_surface::SamplingError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Options of decoding that do not go together.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DecodeOptionsError {
    /// A number or a spacing of points, but no points.
    #[error("a number of points and a spacing are for points")]
    NoPoints,
    /// An encoding of GLB files, but no such file.
    #[error("an encoding of GLB files needs an output of that format")]
    NoGlb,
    /// Normals to leave out, but no meshes.
    #[error("normals are left out of meshes alone")]
    NoMeshNormals,
    /// A texture, but no meshes.
    #[error("a texture is for meshes: leave out --texture, or decode --as mesh")]
    NoTexturedMesh,
    /// A texture, but no colour.
    #[error("a texture is the colour of a mesh, which --no-colour leaves out: drop one of the two")]
    DroppedTexture,
    /// A texture in a format that holds none.
    #[error("{format} files hold no texture: use glb or obj")]
    NoTextureInFormat {
        /// The format.
        format: OutputFormat,
    },
    /// A texture of an OBJ file on standard output.
    #[error("an OBJ file with a texture is three files: name a folder or a file, or use --format glb")]
    TexturedPipe,
    /// A USD file with an axis up that USD does not have.
    #[error("USD files have y or z up, not {up}")]
    NoUsdAxis {
        /// Name of the axis.
        up: &'static str,
    },
    /// A USD file on standard output.
    #[error("a USD file is not written to standard output: name a file")]
    UsdPipe,
    /// Fewer faces, but no meshes.
    #[error("a number of faces and an error of simplifying are for meshes")]
    NoMeshFaces,
    /// A format and a name of another one.
    #[error("format {format} does not fit the output's name, {name}")]
    FormatAndName {
        /// The format asked for.
        format: OutputFormat,
        /// Name of the output.
        name: String,
    },
    /// A format that does not hold the form.
    #[error("{}{format} files are not written of {}: use one of {formats}",
        .name.as_ref().map_or(String::new(), |name| format!("{name}: ")), form.name())]
    FormatAndForm {
        /// Name of the output, if it tells the format.
        name: Option<String>,
        /// The format.
        format: OutputFormat,
        /// The form.
        form: Form,
        /// Formats that hold the form.
        formats: String,
    },
    /// A file for a volume as NumPy arrays.
    #[error("{name}: a volume as NumPy arrays is several files: name a folder")]
    ArraysInFile {
        /// Name of the output.
        name: String,
    },
    /// Another unit, origin or up axis for a volume, which keeps its own.
    #[error("{option}: a volume keeps its axes: decode a mesh or points, or turn it later")]
    VolumePlaced {
        /// The option.
        option: PlacementOption,
    },
    /// An option that places or scales the output, with NumPy volumes.
    #[error("{option}: NumPy volumes are in metres, Y up: decode a mesh, points or --format vdb")]
    ArraysPlaced {
        /// The option.
        option: PlacementOption,
    },
}

/// Options of where the output lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlacementOption {
    /// Unit of the coordinates.
    Unit,
    /// Place of the stream's origin.
    Origin,
    /// Axis that points up.
    Up,
}

impl std::fmt::Display for PlacementOption {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Unit => "units",
            Self::Origin => "origin",
            Self::Up => "up",
        })
    }
}

/// A stream that could not be decoded to files.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DecodeTakeError {
    /// The options.
    #[error(transparent)]
    Options(#[from] DecodeOptionsError),
    /// The stream.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The device that does the arithmetic.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A frame that cannot become what was asked for.
    #[error("frame {frame}: {cause}")]
    Frame {
        /// Number of the frame.
        frame: usize,
        /// Cause of the failure.
        cause: ProductError,
    },
    /// An output that is refused.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A sink that fails.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A folder that cannot be made, as there is none to make it in.
    #[error("{}: cannot make this folder: there is no {}", .folder.display(), .parent.display())]
    NoParent {
        /// The folder.
        folder: PathBuf,
        /// The folder that it would be in.
        parent: PathBuf,
    },
    /// A folder that cannot be made.
    #[error("{}: cannot make this folder: {cause}", .folder.display())]
    NoFolder {
        /// The folder.
        folder: PathBuf,
        /// Cause of the failure.
        cause: io::Error,
    },
    /// Frames that do not fit into one file.
    #[error("{}: takes one frame, but there are more: name a folder, or one frame as in --frames 0..1", .file.display())]
    OneFrame {
        /// The file.
        file: PathBuf,
    },
    /// A texture of a stream without colour.
    #[error("{name}: no colour in this stream to make a texture of: leave out --texture")]
    NoColour {
        /// Name of the stream.
        name: String,
    },
    /// A stream without frames.
    #[error("{name}: no frames in this stream")]
    NoFrames {
        /// Name of the stream.
        name: String,
    },
    /// Cancelled before anything was written.
    #[error("{name}: interrupted before the first frame")]
    CancelledBeforeFirstFrame {
        /// Name of the stream.
        name: String,
    },
}

/// A frame that cannot become what was asked for.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProductError {
    /// A surface that there is no memory for.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A volume that cannot be given distances.
    #[error(transparent)]
    Distances(#[from] DistancesError),
    /// A surface that cannot be sampled.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// A mesh that cannot be simplified.
    #[error(transparent)]
    Simplify(#[from] SimplifyError),
    /// A surface that does not fit into its texture.
    #[error(transparent)]
    Texture(#[from] TextureTooSmall),
    /// A device that fails.
    #[error(transparent)]
    Device(#[from] DeviceError),
}
