//! What can go wrong with a GPU.

use isv_decode::BackendError;
use thiserror::Error;

/// A GPU that cannot do what was asked of it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is none, or none by that name.
    #[error("no GPU: {0}")]
    NoAdapter(String),
    /// The driver gave no device.
    #[error("the GPU \"{adapter}\" could not be opened: {reason}")]
    NotOpened {
        /// The adapter's name.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The GPU can do less than is needed.
    #[error("the GPU \"{adapter}\" allows {found} {what}, where {needed} are needed")]
    TooSmall {
        /// The adapter's name.
        adapter: String,
        /// What is bounded.
        what: &'static str,
        /// The GPU's bound.
        found: u64,
        /// What is needed.
        needed: u64,
    },
    /// The GPU's memory is not enough.
    #[error("the GPU is out of memory: {bytes} bytes for {what} are too many")]
    OutOfMemory {
        /// What it was for.
        what: &'static str,
        /// Bytes asked for.
        bytes: u64,
    },
    /// More than a buffer may hold.
    #[error("{bytes} bytes for {what} are more than the {limit} that a buffer of this GPU may hold")]
    TooLarge {
        /// What it was for.
        what: &'static str,
        /// Bytes asked for.
        bytes: u64,
        /// Bytes of the largest buffer.
        limit: u64,
    },
    /// The device is gone: reset, unplugged, or its driver failed.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// It is never done on a GPU; what.
    #[error("{0}: not on a GPU")]
    Unsupported(&'static str),
    /// A shader or a command that the driver refuses: a fault of this program or of the driver.
    #[error("the GPU's driver refused a command: {0}")]
    Refused(String),
}

impl From<GpuError> for BackendError {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::OutOfMemory { .. } | GpuError::TooLarge { .. } => Self::OutOfMemory(error.to_string()),
            GpuError::Unsupported(what) => Self::Unsupported(what),
            other => Self::DeviceLost(other.to_string()),
        }
    }
}
