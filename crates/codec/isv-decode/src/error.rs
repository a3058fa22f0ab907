//! What can stop a decoder.

use crate::colour::ColourError;
use isv_format::{FormatError, RefusalClass};
use thiserror::Error;

/// What keeps a [`crate::backend::Backend`] from its work. No fault of the stream.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BackendError {
    /// The device is gone or failed, and what it held with it. The sentence is the backend's.
    #[error("{0}")]
    DeviceFailed(String),
    /// Memory ran out. The sentence is the backend's.
    #[error("{0}")]
    OutOfMemory(String),
    /// It never does this; what.
    #[error("{0}: not done by this backend")]
    Unsupported(&'static str),
}

/// A frame that cannot be decoded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The arithmetic could not be done.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The container is at fault.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The packet's checksum is right, yet its contents break the format.
    #[error("frame {frame}, packet at byte {at}: {what}")]
    Malformed {
        /// Frames decoded before this one.
        frame: u64,
        /// Offset of the packet in the stream (bytes).
        at: u64,
        /// What is wrong.
        what: &'static str,
    },
    /// The frame predicts from one that was not decoded.
    #[error("packet at byte {at} predicts from a frame that was not decoded: begin at a keyframe")]
    NoReference {
        /// Offset of the packet in the stream (bytes).
        at: u64,
    },
    /// A frame between this one and the last keyframe was not decoded.
    #[error(
        "packet at byte {at} is frame {found} of its GOP, where frame {expected} should be: a packet is missing"
    )]
    MissingFrame {
        /// Offset of the packet in the stream (bytes).
        at: u64,
        /// Frames since the keyframe that the next packet should have, modulo `2^16`.
        expected: u16,
        /// Frames since the keyframe that it has.
        found: u16,
    },
    /// More blocks than the caller allows.
    #[error("packet at byte {at} has {blocks} blocks, above the limit of {limit}")]
    TooManyBlocks {
        /// Offset of the packet in the stream (bytes).
        at: u64,
        /// Blocks the frame states.
        blocks: usize,
        /// The caller's limit.
        limit: usize,
    },
    /// More blocks than so few bytes are trusted with: [`crate::Limits::voxels_per_byte`].
    #[error(
        "packet at byte {at} makes {blocks} blocks of the {bytes} bytes since its keyframe, above the limit of {limit} for so few"
    )]
    TooFewBytes {
        /// Offset of the packet in the stream (bytes).
        at: u64,
        /// Blocks of the frame.
        blocks: usize,
        /// Bytes of its GOP so far.
        bytes: u64,
        /// Blocks that these may have.
        limit: usize,
    },
    /// The frame's colour cannot be decoded; its geometry can.
    #[error("frame {frame}, packet at byte {at}: {cause}")]
    Colour {
        /// Frames decoded before this one.
        frame: u64,
        /// Offset of the packet in the stream.
        at: u64,
        /// Fault of the colour part.
        cause: ColourError,
    },
    /// The decoded volume is not the one that was encoded.
    #[error("frame {frame}: the decoded volume's hash is {found:016x}, but the stream says {stated:016x}")]
    HashMismatch {
        /// Frames decoded before this one.
        frame: u64,
        /// Hash in the stream.
        stated: u64,
        /// Hash of what was decoded.
        found: u64,
    },
}

impl DecodeError {
    /// The class of the refusal; `None` if the arithmetic or the source is at fault and not the stream.
    #[must_use]
    pub fn class(&self) -> Option<RefusalClass> {
        match self {
            Self::Backend(_) => None,
            Self::Format(error) => error.class(),
            Self::Colour { cause, .. } => cause.class(),
            Self::Malformed { .. } => Some(RefusalClass::Malformed),
            Self::NoReference { .. } | Self::MissingFrame { .. } => Some(RefusalClass::Missing),
            Self::TooManyBlocks { .. } | Self::TooFewBytes { .. } => Some(RefusalClass::Limit),
            Self::HashMismatch { .. } => Some(RefusalClass::Damaged),
        }
    }
}
