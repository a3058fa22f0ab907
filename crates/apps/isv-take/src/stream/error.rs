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
    /// The MP4 file around the stream.
    #[cfg(feature = "io")]
    #[error(transparent)]
    Mp4(#[from] isv_mp4::Mp4Error),
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
    /// A frame that is to be the first of a stream, and is no keyframe.
    #[error("frame {frame} is no keyframe: {}", keyframes_around(*.before, *.after))]
    NotAKeyframe {
        /// Number of the frame.
        frame: usize,
        /// The last keyframe before it.
        before: Option<usize>,
        /// The first keyframe behind it.
        after: Option<usize>,
    },
    /// A frame that the index calls a keyframe, and that is none.
    #[error("its index calls frame {frame} a keyframe, but it is none")]
    FalseKeyframe {
        /// Number of the frame.
        frame: usize,
    },
    /// A stream whose first frame is no keyframe.
    #[error("does not begin with a keyframe")]
    NoFirstKeyframe,
    /// A stream that has fewer frames than its index says.
    #[error("ends before frame {frame}")]
    EndsBefore {
        /// Number of the first frame that is missing.
        frame: usize,
    },
    /// A stream that cannot be joined to another one.
    #[error("has another {what} than {from}")]
    Differs {
        /// Property that differs.
        what: &'static str,
        /// Name of the other stream.
        from: String,
    },
    /// A stream that was written to while it was read.
    #[error("has changed while streams were joined")]
    Changed,
    /// A stream header that is damaged.
    #[error(transparent)]
    Header(FormatError),
    /// A stream whose own header is sound, and another than the one given for it.
    #[error("its own header is sound, and not the one given for it")]
    OtherHeader,
    /// A stream without any frame that can be decoded.
    #[error("no frame in it can be decoded{}", damage_in_words(.damage))]
    NothingDecodes {
        /// Places that are damaged: the first byte and the number of bytes of each.
        damage: Vec<(u64, u64)>,
    },
    /// A stream that ends without its index.
    #[error("ends without an index, so frames may be missing")]
    NoIndex,
    /// An index that is wrong.
    #[error("its index does not say where its frames are")]
    FalseIndex,
    /// Bytes behind the end of a stream.
    #[error("bytes follow the end of the stream, from byte {at} on")]
    BytesBehindEnd {
        /// Place of the first one.
        at: u64,
    },
}

/// A stream that cannot be copied.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EditError {
    /// The stream that is read.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The stream that is written.
    #[error(transparent)]
    Write(#[from] FormatError),
    /// The file that is written.
    #[error(transparent)]
    Create(#[from] io::Error),
}

/// Frames to cut at in place of a frame that is no keyframe.
fn keyframes_around(before: Option<usize>, after: Option<usize>) -> String {
    match (before, after) {
        (Some(before), Some(after)) => format!("cut from {before} or {after} on"),
        (Some(keyframe), None) | (None, Some(keyframe)) => format!("cut from {keyframe} on"),
        (None, None) => "there is none".to_owned(),
    }
}

/// Damage as the end of a sentence; nothing without any.
#[must_use]
pub fn damage_in_words(damage: &[(u64, u64)]) -> String {
    let bytes: u64 = damage.iter().map(|(_, bytes)| bytes).sum();
    match damage {
        [] => String::new(),
        [(at, _)] => format!(", {bytes} bytes are damaged from byte {at} on"),
        [(at, _), ..] => {
            format!(", {bytes} bytes are damaged in {} places from byte {at} on", damage.len())
        }
    }
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
