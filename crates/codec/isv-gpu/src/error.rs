//! What can go wrong with a GPU.

use isv_decode::BackendError;
use isv_fusion::FusionError;
use std::fmt::Display;
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

impl GpuError {
    /// An error of the driver.
    pub(crate) fn refused(error: &dyn Display) -> Self {
        Self::Refused(one_line(error))
    }
}

/// What a driver says in several lines, in one.
pub(crate) fn one_line(error: &dyn Display) -> String {
    let text = error.to_string();
    let parts =
        text.lines().map(|line| line.trim().trim_end_matches([':', '.'])).filter(|line| !line.is_empty());
    parts.collect::<Vec<_>>().join(": ")
}

impl From<GpuError> for BackendError {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::OutOfMemory { .. } | GpuError::TooLarge { .. } => Self::OutOfMemory(error.to_string()),
            GpuError::Unsupported(what) => Self::Unsupported(what),
            other => Self::DeviceFailed(other.to_string()),
        }
    }
}

impl From<GpuError> for FusionError {
    fn from(error: GpuError) -> Self {
        Self::Backend(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_is_quoted_in_one_line() {
        let text =
            "Validation Error\n\nCaused by:\n  In Device::create_buffer\n    Not enough memory left.\n";
        let expected = "Validation Error: Caused by: In Device::create_buffer: Not enough memory left";
        assert_eq!(one_line(&text), expected);
    }

    /// What the user reads is one sentence, whoever passes it on.
    #[test]
    fn a_backends_errors_read_as_the_gpus() {
        let memory = GpuError::OutOfMemory { what: "samples", bytes: 1 << 30 };
        let large = GpuError::TooLarge { what: "levels", bytes: 1 << 30, limit: 1 << 27 };
        for error in [GpuError::Lost("unplugged".to_owned()), memory, large] {
            assert_eq!(BackendError::from(error.clone()).to_string(), error.to_string());
        }
    }
}
