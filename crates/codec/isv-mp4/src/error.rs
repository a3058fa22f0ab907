//! What can be wrong with an MP4 file, or with sound for one.

use isv_format::FormatError;
use thiserror::Error;

/// A file that cannot be read, or a track that cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Mp4Error {
    /// The first bytes are not those of an MP4 file.
    #[error("not an MP4 file: it does not begin with a box of type ftyp")]
    NotMp4,
    /// An MP4 file that describes no tracks.
    #[error("the MP4 file has no moov box: it may have been cut off before it was finished")]
    NoMovie,
    /// An MP4 file without a track of geometry.
    #[error("the MP4 file has no track of geometry (isv1): isv mux writes one")]
    NoGeometry,
    /// An MP4 file with more than one track of geometry.
    #[error("the MP4 file has {0} tracks of geometry, and one is read")]
    SeveralGeometries(usize),
    /// A file without a track of the kind that was asked for.
    #[error("no track of {0} is in it")]
    NoTrack(&'static str),
    /// The boxes break the format.
    #[error("the MP4 file is damaged at byte {at}: {what}")]
    Malformed {
        /// Offset in the file.
        at: u64,
        /// What is wrong.
        what: String,
    },
    /// Valid, but above a bound on memory.
    #[error("the MP4 file has {what}: {asked}, above the limit of {allowed}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// What the file asks for.
        asked: u64,
        /// The limit.
        allowed: u64,
    },
    /// A track that no MP4 of ours can hold.
    #[error("{0}")]
    Unsupported(String),
    /// More tracks than a file may have beside geometry.
    #[error("{0} tracks of sound and picture, and a file may have 15")]
    TooManyTracks(usize),
    /// A stream that cannot be read.
    #[error(transparent)]
    Stream(#[from] FormatError),
    /// The source or the sink failed.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl Mp4Error {
    /// A [`Mp4Error::Malformed`].
    pub(crate) fn malformed(at: u64, what: impl Into<String>) -> Self {
        Self::Malformed { at, what: what.into() }
    }
}
