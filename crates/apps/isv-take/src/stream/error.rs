//! What can go wrong with a stream.

use crate::{DeviceError, FrameRangeError, MemoryError};
use isv_decode::DecodeError;
use isv_format::{FormatError, StreamHeader};
use isv_volume::GridError;
use std::io;
use thiserror::Error;

/// A stream that cannot be used, by name.
#[derive(Debug, Error)]
#[error("{name}: {fault}")]
pub struct StreamError {
    /// Name of the stream.
    pub name: String,
    /// What is wrong.
    pub fault: StreamFault,
}

/// What is wrong with a stream.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StreamFault {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A folder in place of a file.
    #[error("a folder, where an .isv file should be")]
    Folder,
    /// A pipe in place of a file.
    #[error("this command needs a file, which it can seek in")]
    NoFile,
    /// Packets of the stream.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A frame. Frames in the error are counted from the stream's start.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// A level of detail that its voxels are too large for.
    #[error(transparent)]
    Lod(#[from] GridError),
    /// A surface that there is no memory for.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The device that decodes it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Frames that it does not have.
    #[error(transparent)]
    Range(#[from] FrameRangeError),
    /// A frame that nothing leads to.
    #[error("no keyframe at or before frame {frame}")]
    NoKeyframe {
        /// Number of the frame.
        frame: usize,
    },
}

impl StreamFault {
    /// The error of a stream by this name.
    #[must_use]
    pub fn in_stream(self, name: &str) -> StreamError {
        StreamError { name: name.to_owned(), fault: self }
    }

    /// A decoder's error, its frame counted from the stream's start. `first` is the number of the frame that the decoder began with.
    pub(crate) fn decoding(first: usize, error: DecodeError) -> Self {
        let first = first as u64;
        Self::Decode(match error {
            DecodeError::Malformed { frame, at, what } => {
                DecodeError::Malformed { frame: first + frame, at, what }
            }
            DecodeError::HashMismatch { frame, stated, found } => {
                DecodeError::HashMismatch { frame: first + frame, stated, found }
            }
            other => other,
        })
    }
}

impl StreamError {
    /// Whether bytes were damaged or lost, so that others of the stream may be sound.
    #[must_use]
    pub fn is_loss(&self) -> bool {
        let header_bytes = StreamHeader::BYTES as u64;
        match &self.fault {
            StreamFault::Format(error) | StreamFault::Decode(DecodeError::Format(error)) => match error {
                FormatError::Checksum { at, .. } => *at > 0,
                FormatError::Truncated { at, .. } => *at > header_bytes,
                FormatError::Malformed { at, .. } => *at >= header_bytes,
                _ => false,
            },
            _ => self.is_missing_frame(),
        }
    }

    /// Whether a frame is not there that another one needs.
    #[must_use]
    pub fn is_missing_frame(&self) -> bool {
        matches!(
            self.fault,
            StreamFault::Decode(DecodeError::NoReference { .. } | DecodeError::MissingFrame { .. })
        )
    }

    /// Whether bytes end too early: nothing comes behind.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        matches!(
            self.fault,
            StreamFault::Format(FormatError::Truncated { .. })
                | StreamFault::Decode(DecodeError::Format(FormatError::Truncated { .. }))
        )
    }

    /// Whether more memory would help.
    #[must_use]
    pub fn is_beyond_memory(&self) -> bool {
        matches!(
            self.fault,
            StreamFault::Decode(DecodeError::TooManyBlocks { .. } | DecodeError::TooFewBytes { .. })
                | StreamFault::Memory(_)
        )
    }
}
