//! What a job reads: something with a path, or standard input.

use std::path::{Path, PathBuf};

/// An input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// A file, a folder or a pattern.
    Path(PathBuf),
    /// Standard input.
    StandardInput,
}

impl Input {
    /// The input that an argument of a command line names: `-` is standard input.
    #[must_use]
    pub fn from_argument(argument: &Path) -> Self {
        if argument == Path::new("-") { Self::StandardInput } else { Self::Path(argument.to_owned()) }
    }

    /// Name in messages.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Path(path) => path.display().to_string(),
            Self::StandardInput => "standard input".to_owned(),
        }
    }

    /// Whether its bytes come once, as of standard input and of a pipe with a name. What is not there is no such thing.
    #[must_use]
    pub fn comes_once(&self) -> bool {
        match self {
            Self::StandardInput => true,
            Self::Path(path) => path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir()),
        }
    }

    /// The path, if it has one.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Path(path) => Some(path),
            Self::StandardInput => None,
        }
    }
}

impl<P: AsRef<Path>> From<P> for Input {
    fn from(path: P) -> Self {
        Self::Path(path.as_ref().to_owned())
    }
}
