//! What can go wrong.

use std::fmt;
use std::io;

/// A failure, in one sentence that names the file, the frame or the option.
#[derive(Debug)]
pub struct Error {
    kind: ErrorKind,
    why: String,
}

/// What a caller can do about an [`Error`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// An option, or a combination of options, that cannot be.
    Options,
    /// An input that cannot be read, or that holds no frames.
    Input,
    /// One frame that cannot be read or used. Others may be sound.
    Frame,
    /// A stream that is damaged, cut, or of a newer version.
    Stream,
    /// More memory than is allowed.
    Memory,
    /// A GPU that is not there, or that failed.
    Device,
    /// An output that cannot be written.
    Output,
    /// The job was cancelled before it had a result.
    Cancelled,
}

impl Error {
    pub(crate) fn new(kind: ErrorKind, why: impl fmt::Display) -> Self {
        Self { kind, why: why.to_string() }
    }

    /// What can be done about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)
    }
}

impl std::error::Error for Error {}

impl From<io::Error> for Error {
    fn from(error: io::Error) -> Self {
        Self::new(ErrorKind::Output, error)
    }
}

impl From<isv_take::StreamError> for Error {
    fn from(error: isv_take::StreamError) -> Self {
        use isv_take::StreamFault;
        let kind = match &error.fault {
            _ if error.is_beyond_memory() => ErrorKind::Memory,
            StreamFault::Format(isv_format::FormatError::LimitExceeded { .. }) => ErrorKind::Memory,
            StreamFault::Io(_) | StreamFault::Folder | StreamFault::NoFile => ErrorKind::Input,
            StreamFault::Format(isv_format::FormatError::Io(_)) => ErrorKind::Input,
            StreamFault::Range(_) | StreamFault::Lod(_) => ErrorKind::Options,
            StreamFault::Device(_) => ErrorKind::Device,
            _ => ErrorKind::Stream,
        };
        Self::new(kind, error)
    }
}

impl From<isv_take::stream::EditError> for Error {
    fn from(error: isv_take::stream::EditError) -> Self {
        match error {
            isv_take::stream::EditError::Stream(error) => error.into(),
            other => Self::new(ErrorKind::Output, other),
        }
    }
}

impl From<isv_take::MemoryError> for Error {
    fn from(error: isv_take::MemoryError) -> Self {
        Self::new(ErrorKind::Memory, error)
    }
}

impl From<isv_take::DeviceError> for Error {
    fn from(error: isv_take::DeviceError) -> Self {
        Self::new(ErrorKind::Device, error)
    }
}

#[cfg(feature = "io")]
impl From<isv_take::decode::DecodeTakeError> for Error {
    fn from(error: isv_take::decode::DecodeTakeError) -> Self {
        use isv_take::decode::{DecodeTakeError, ProductError};
        let kind = match error {
            DecodeTakeError::Stream(error) => return error.into(),
            DecodeTakeError::Options(_) | DecodeTakeError::Output(_) | DecodeTakeError::OneFrame { .. } => {
                ErrorKind::Options
            }
            DecodeTakeError::Device(_) | DecodeTakeError::Frame { cause: ProductError::Device(_), .. } => {
                ErrorKind::Device
            }
            DecodeTakeError::Frame {
                cause: ProductError::Memory(_) | ProductError::Distances(_), ..
            } => ErrorKind::Memory,
            DecodeTakeError::Frame { .. } => ErrorKind::Frame,
            DecodeTakeError::NoFrames { .. } => ErrorKind::Stream,
            DecodeTakeError::CancelledBeforeFirstFrame { .. } => ErrorKind::Cancelled,
            _ => ErrorKind::Output,
        };
        Self::new(kind, error)
    }
}

#[cfg(feature = "encode")]
impl From<isv_take::encode::OptionsError> for Error {
    fn from(error: isv_take::encode::OptionsError) -> Self {
        Self::new(ErrorKind::Options, error)
    }
}

#[cfg(feature = "encode")]
impl From<isv_take::encode::EncodeError> for Error {
    fn from(error: isv_take::encode::EncodeError) -> Self {
        use isv_take::encode::{EncodeError, FrameError};
        let kind = match &error {
            _ if error.is_device() => ErrorKind::Device,
            EncodeError::Options(_) => ErrorKind::Options,
            EncodeError::Frame(FrameError::Memory { .. }) => ErrorKind::Memory,
            EncodeError::Frame(_) | EncodeError::NoMesh { .. } | EncodeError::Compare { .. } => {
                ErrorKind::Frame
            }
            EncodeError::Write(_) | EncodeError::Ended => ErrorKind::Output,
            EncodeError::CancelledBeforeFirstFrame | EncodeError::CancelledBeforeLastPass => {
                ErrorKind::Cancelled
            }
            _ => ErrorKind::Input,
        };
        Self::new(kind, error)
    }
}

#[cfg(feature = "io")]
impl From<isv_io::WriteError> for Error {
    fn from(error: isv_io::WriteError) -> Self {
        Self::new(ErrorKind::Output, error)
    }
}
