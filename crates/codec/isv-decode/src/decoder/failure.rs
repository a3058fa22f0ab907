//! What stops a frame once its header is read.

use super::sequence::Sequence;
use crate::shared::syntax::SyntaxError;
use crate::{BackendError, DecodeError};
use isv_format::Packet;

/// Symbols that no encoder writes, or arithmetic that could not be done.
#[derive(Debug)]
pub(crate) enum Failure {
    Syntax(SyntaxError),
    Backend(BackendError),
}

impl Failure {
    /// The failure of a packet's frame.
    pub(crate) fn of(self, packet: &Packet, sequence: Sequence) -> DecodeError {
        match self {
            Self::Syntax(SyntaxError(what)) => sequence.malformed(packet, what),
            Self::Backend(error) => error.into(),
        }
    }
}

impl From<SyntaxError> for Failure {
    fn from(error: SyntaxError) -> Self {
        Self::Syntax(error)
    }
}

impl From<BackendError> for Failure {
    fn from(error: BackendError) -> Self {
        Self::Backend(error)
    }
}
