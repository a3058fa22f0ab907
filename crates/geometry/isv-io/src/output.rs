//! Outputs: a file that appears whole or not at all, or standard output. Files of others are not overwritten.

mod names;

use crate::{AtomicFile, WriteError, is_volume_folder, was_made_by_isv};
use std::fs::File;
use std::io::{self, BufWriter, Read, Stdout, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

pub use names::{check_file_name, check_folder_name, check_stream_name, is_folder};

/// Bytes of a file that are looked at before it is overwritten.
const CHECKED_BYTES: u64 = 256;

/// Reasons not to overwrite a file.
const FOREIGN: &str = "was not made by isv";

/// An output that is refused before any work.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OutputError {
    /// A file that is read as well.
    #[error("{name}: is what is read; name another file to write")]
    IsInput {
        /// Name of the output.
        name: String,
    },
    /// A file that something else may be lost with.
    #[error("{name}: is there and {why}, so it is not overwritten")]
    NotOurs {
        /// Name of the output.
        name: String,
        /// Cause of the failure.
        why: &'static str,
    },
    /// A folder that is named like a file of another program.
    #[error(
        "{name}: isv does not write .{ending} files, but {contents}: use a folder, or {name}/ for one of that name"
    )]
    FolderLikeFile {
        /// Name of the output.
        name: String,
        /// Ending of the name.
        ending: String,
        /// Contents of the folder.
        contents: String,
    },
    /// A stream that is named like another kind of file.
    #[error("{name}: what is written is an .isv stream, not a .{ending} file: name it {proposal}")]
    StreamLikeFile {
        /// Name of the output.
        name: String,
        /// Ending of the name.
        ending: String,
        /// A name for it.
        proposal: String,
    },
    /// A file that is named like one of another program.
    #[error("{name}: isv does not write .{ending} files: use {written}")]
    OtherFile {
        /// Name of the output.
        name: String,
        /// Ending of the name.
        ending: String,
        /// Names that do.
        written: String,
    },
    /// A file that cannot be looked at.
    #[error("{name}: {cause}")]
    Io {
        /// Name of the output.
        name: String,
        /// Cause of the failure.
        cause: io::Error,
    },
}

/// Whether a path stands for standard input or output: `-`.
#[must_use]
pub fn is_pipe(path: &Path) -> bool {
    path == Path::new("-")
}

/// Whether two paths lead to the same file, which need not be there yet.
#[must_use]
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        path.canonicalize().ok().or_else(|| Some(folder.canonicalize().ok()?.join(path.file_name()?)))
    };
    a == b || place(a).is_some_and(|a| place(b) == Some(a))
}

/// Refuses to write over one of the files that are read.
///
/// # Errors
/// [`OutputError::IsInput`].
pub fn check_not_input(inputs: &[&Path], output: &Path) -> Result<(), OutputError> {
    match inputs.iter().any(|input| is_same_file(input, output)) && output.is_file() {
        true => Err(OutputError::IsInput { name: output.display().to_string() }),
        false => Ok(()),
    }
}

/// Refuses to overwrite a file that has something in it, unless its first bytes are as they are to be. `otherwise`: what is wrong with it
/// then, behind "is there and".
///
/// # Errors
/// [`OutputError::NotOurs`], and [`OutputError::Io`] for a file that cannot be read.
pub fn check_overwriting(
    output: &Path,
    otherwise: &'static str,
    may_go: impl Fn(&[u8]) -> bool,
) -> Result<(), OutputError> {
    if is_pipe(output) || !output.is_file() {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = File::open(output).and_then(|file| file.take(CHECKED_BYTES).read_to_end(&mut start));
    let name = output.display().to_string();
    match read {
        Err(cause) => Err(OutputError::Io { name, cause }),
        Ok(0) => Ok(()),
        Ok(_) if may_go(&start) => Ok(()),
        Ok(_) => Err(OutputError::NotOurs { name, why: otherwise }),
    }
}

/// Refuses to write a frame over a file that isv did not write, by its first bytes: a capture may have the same names.
///
/// # Errors
/// As [`check_overwriting`].
pub fn check_frame_output(output: &Path) -> Result<(), OutputError> {
    check_overwriting(output, FOREIGN, was_made_by_isv)
}

/// Refuses the same of a volume's folder, whose arrays cannot say who made them: `grid.json` beside them does.
///
/// # Errors
/// As [`check_overwriting`].
pub fn check_volume_output(folder: &Path) -> Result<(), OutputError> {
    let description = folder.join("grid.json");
    if is_volume_folder(folder) && !description.exists() {
        return Err(OutputError::NotOurs { name: folder.display().to_string(), why: FOREIGN });
    }
    check_frame_output(&description)
}

/// A sink of bytes, to be [committed](Self::commit) once all are written. Its errors name it.
#[derive(Debug)]
pub struct Output {
    sink: Sink,
    bytes: u64,
}

#[derive(Debug)]
enum Sink {
    /// A file that takes its name when committed.
    File(AtomicFile),
    /// Standard output.
    Pipe(BufWriter<Stdout>),
}

impl Output {
    /// Opens a file, or standard output for `-`.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let sink = if is_pipe(path) {
            Sink::Pipe(BufWriter::new(io::stdout()))
        } else {
            Sink::File(AtomicFile::create(path)?)
        };
        Ok(Self { sink, bytes: 0 })
    }

    /// Keeps a file as [`AtomicFile::keep`] does.
    pub fn keep(&mut self) -> Option<PathBuf> {
        match &mut self.sink {
            Sink::File(file) => file.keep(),
            Sink::Pipe(_) => None,
        }
    }

    /// Writes out what is buffered and gives a file its name; returns how many bytes were written in all.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub fn commit(mut self) -> io::Result<u64> {
        self.flush()?;
        if let Sink::File(file) = self.sink {
            file.commit()?;
        }
        Ok(self.bytes)
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.sink {
            Sink::File(file) => file.write(bytes),
            Sink::Pipe(pipe) => named(pipe.write(bytes)),
        }?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::File(file) => file.flush(),
            Sink::Pipe(pipe) => named(pipe.flush()),
        }
    }
}

fn named<T>(result: io::Result<T>) -> io::Result<T> {
    result.map_err(|error| io::Error::new(error.kind(), format!("standard output: cannot write: {error}")))
}
