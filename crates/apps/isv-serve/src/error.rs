//! What can be wrong before anything is served.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use thiserror::Error;

/// Why a server or a source does not start.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address cannot be listened at.
    #[error("cannot listen at {address}: {cause}: choose another address or port")]
    Bind {
        /// The address asked for.
        address: SocketAddr,
        /// Why not.
        cause: io::Error,
    },
    /// A file cannot be found or looked at.
    #[error("{}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why not.
        cause: io::Error,
    },
    /// A path without a last part that could be served under its name.
    #[error("{}: has no file name", path.display())]
    NoName {
        /// The path.
        path: PathBuf,
    },
}
