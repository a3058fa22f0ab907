//! What can stop a session.

use isv_decode::DecodeError;
use isv_format::{FormatError, RefusalClass};
use isv_surface::TooManyVertices;
use thiserror::Error;

/// A call that could not be done. What it says is for people.
#[derive(Debug, Error)]
pub(crate) enum SessionError {
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error(transparent)]
    Decode(#[from] DecodeError),
    #[error(transparent)]
    Surface(#[from] TooManyVertices),
    /// More input than is allowed.
    #[error("{bytes} bytes of input, above the limit of {limit}")]
    Input { bytes: usize, limit: usize },
    /// Input that is not as long as what it holds.
    #[error("{found} bytes where {what} of {expected} bytes should be")]
    Length { what: &'static str, expected: usize, found: usize },
    /// Something else where an index should be.
    #[error("the packet at byte {at} is no index")]
    NoIndex { at: u64 },
    /// A call that needs another before it; which.
    #[error("{0}")]
    Order(&'static str),
}

/// What an error means to the player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Status {
    Done = 0,
    /// Bytes that break the format.
    Malformed = 1,
    /// Above a limit.
    Limit = 2,
    /// The frame predicts from one that was not decoded.
    NeedsKeyframe = 3,
    /// A call too early.
    Order = 4,
    /// A version, a profile or a type of packet that is not known.
    Unsupported = 5,
}

impl Status {
    /// Error of bytes that are refused.
    fn of_refusal(class: Option<RefusalClass>) -> Self {
        match class {
            Some(RefusalClass::Limit) => Self::Limit,
            Some(RefusalClass::Missing) => Self::NeedsKeyframe,
            Some(RefusalClass::Unsupported) => Self::Unsupported,
            _ => Self::Malformed,
        }
    }
}

impl SessionError {
    /// Blocks of a frame that was refused because it has too many; 0 of any other error.
    pub(crate) fn refused_blocks(&self) -> usize {
        match self {
            Self::Decode(
                DecodeError::TooManyBlocks { blocks, .. } | DecodeError::TooFewBytes { blocks, .. },
            ) => *blocks,
            _ => 0,
        }
    }

    pub(crate) fn status(&self) -> Status {
        match self {
            Self::Format(error) => Status::of_refusal(error.class()),
            Self::Decode(error) => Status::of_refusal(error.class()),
            Self::Surface(_) | Self::Input { .. } => Status::Limit,
            Self::Order(_) => Status::Order,
            Self::Length { .. } | Self::NoIndex { .. } => Status::Malformed,
        }
    }
}
