//! What can be wrong with bytes that claim to be an `.isv` stream.

use crate::RefusalClass;
use thiserror::Error;

/// A stream that cannot be read further. Offsets count bytes from the start of the stream.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The first bytes are not the magic.
    #[error("not an .isv stream: it does not begin with the .isv magic")]
    NotIsv,
    /// A format version that this build does not know.
    #[error("format version {found}, but this build reads versions 1 to {supported}: use a newer isv")]
    Version {
        /// The version the stream states.
        found: u16,
        /// The newest version this build reads.
        supported: u16,
    },
    /// A profile that this build does not know.
    #[error("profile {found} is not known: use a newer isv")]
    Profile {
        /// The profile that the stream states.
        found: u8,
    },
    /// A packet whose type this build does not know, and which must not be skipped.
    #[error("packet type {found} at byte {at} is not known: use a newer isv")]
    PacketType {
        /// The type that the packet states.
        found: u8,
        /// Offset of the packet's header in the stream.
        at: u64,
    },
    /// The bytes break the format.
    #[error("{what} at byte {at}")]
    Malformed {
        /// Offset of the offending structure in the stream (bytes).
        at: u64,
        /// What is wrong.
        what: String,
    },
    /// The bytes end inside a structure.
    #[error("cut off at byte {at}, inside {inside}")]
    Truncated {
        /// Offset at which the bytes end.
        at: u64,
        /// What was being read.
        inside: &'static str,
    },
    /// A checksum does not match: the bytes were damaged.
    #[error("damaged: checksum of {what} at byte {at} does not match")]
    Checksum {
        /// Offset of the structure in the stream (bytes).
        at: u64,
        /// What was checked.
        what: &'static str,
    },
    /// Valid, but above a bound on memory.
    #[error("{what}: {asked}, above the limit of {allowed}, at byte {at}")]
    LimitExceeded {
        /// Offset of the structure in the stream (bytes).
        at: u64,
        /// What is too large.
        what: &'static str,
        /// What the stream asks for.
        asked: u64,
        /// The limit.
        allowed: u64,
    },
    /// The source could not be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl FormatError {
    /// A [`FormatError::Malformed`].
    pub(crate) fn malformed(at: u64, what: impl Into<String>) -> Self {
        Self::Malformed { at, what: what.into() }
    }

    /// A packet at byte `at` whose payload has more bytes than are allowed.
    pub(crate) fn payload_above(asked: u64, allowed: u32, at: u64) -> Self {
        Self::LimitExceeded { at, what: "packet payload bytes", asked, allowed: allowed.into() }
    }

    /// The class of the refusal; `None` if the source is at fault and not its bytes.
    #[must_use]
    pub fn class(&self) -> Option<RefusalClass> {
        match self {
            Self::NotIsv => Some(RefusalClass::Foreign),
            Self::Version { .. } | Self::Profile { .. } | Self::PacketType { .. } => {
                Some(RefusalClass::Unsupported)
            }
            Self::Malformed { .. } => Some(RefusalClass::Malformed),
            Self::Truncated { .. } => Some(RefusalClass::Cut),
            Self::Checksum { .. } => Some(RefusalClass::Damaged),
            Self::LimitExceeded { .. } => Some(RefusalClass::Limit),
            Self::Io(_) => None,
        }
    }
}
