//! The frames that an input names.

use crate::wildcard::{has_wildcard, matches};
use crate::{Format, FrameTimes, NameOrder, OrderedNames};
use std::ffi::{OsStr, OsString};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The files of a sequence, one frame each, in frame order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSequence {
    input: String,
    paths: Vec<PathBuf>,
    times: FrameTimes,
    notes: Vec<String>,
}

/// An input that names no sequence of frames.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SequenceError {
    /// Nothing of that name.
    #[error("{input}: no such file or folder")]
    NotFound {
        /// The input as given.
        input: String,
    },
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// A `*` or `?` before the last part of the path.
    #[error("{input}: wildcards are understood in the last part of a path only")]
    WildcardInFolder {
        /// The input as given.
        input: String,
    },
    /// A folder or pattern without a file of meshes or points, or a file that is none.
    #[error(
        "{input}: no files of meshes or points here; frames must be one of {}",
        Format::names(Format::ALL, ".")
    )]
    NoFrames {
        /// The input as given.
        input: String,
    },
    /// More than one kind of file.
    #[error(
        "{input}: files of more than one kind ({} and {}); name one kind with a pattern such as *.{extension}",
        first.display(), other.display()
    )]
    MixedFormats {
        /// The input as given.
        input: String,
        /// The first file.
        first: PathBuf,
        /// One of another kind.
        other: PathBuf,
        /// Extension of the first file's format.
        extension: &'static str,
    },
    /// A range of frames that is empty or leaves the sequence.
    #[error(
        "{input}: frames {}..{} asked for, but there are {frames} (0..{frames}) and a range holds at least one",
        asked.start, asked.end
    )]
    OutOfRange {
        /// The input as given.
        input: String,
        /// The range asked for.
        asked: Range<usize>,
        /// How many frames there are.
        frames: usize,
    },
}

impl FrameSequence {
    /// Finds the frames that an input names:
    ///
    /// - a folder: all files of meshes or points in it, by extension;
    /// - a pattern, `*` and `?` in the last part of the path: those whose names match;
    /// - a file: itself.
    ///
    /// Files of other kinds, sub-folders and names that start with a dot are passed over. Frames come in
    /// [natural order](NameOrder). A name that exists is never taken for a pattern.
    ///
    /// # Errors
    /// See [`SequenceError`]. Files are listed, not opened.
    pub fn open(input: impl AsRef<Path>) -> Result<Self, SequenceError> {
        let path = input.as_ref();
        let input = path.display().to_string();
        let (paths, note) = if path.is_dir() {
            frame_files(path, |_| true)?
        } else if path.exists() {
            (Format::of_path(path).map(|_| path.to_owned()).into_iter().collect(), None)
        } else if has_wildcard(path.as_os_str().as_encoded_bytes()) {
            matching_files(path)?
        } else {
            return Err(SequenceError::NotFound { input });
        };
        Self::of_one_format(input, paths, note)
    }

    /// Refuses lists that are empty or mixed.
    fn of_one_format(
        input: String,
        paths: Vec<PathBuf>,
        order_note: Option<String>,
    ) -> Result<Self, SequenceError> {
        let Some(first) = paths.first() else {
            return Err(SequenceError::NoFrames { input });
        };
        let format = Format::of_path(first);
        if let Some(other) = paths.iter().find(|path| Format::of_path(path) != format) {
            let (first, other) = (first.clone(), other.clone());
            let extension = format.map_or("", Format::extension);
            return Err(SequenceError::MixedFormats { input, first, other, extension });
        }
        let stems: Option<Vec<&str>> = paths.iter().map(|path| path.file_stem()?.to_str()).collect();
        let bytes: Vec<&[u8]> =
            paths.iter().map(|path| path.file_name().unwrap_or_default().as_encoded_bytes()).collect();
        let (times, note) = stems
            .map_or_else(Default::default, |stems| FrameTimes::from_names(&stems, NameOrder::of(&bytes)));
        let notes = order_note.into_iter().chain(note).collect();
        Ok(Self { input, paths, times, notes })
    }

    /// When frames were taken, as far as their names say.
    #[must_use]
    pub fn times(&self) -> &FrameTimes {
        &self.times
    }

    /// Sentences on what was decided by the names, where they can be read in several ways.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The files in frame order; at least one.
    #[must_use]
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Frames `range.start` up to but not including `range.end`, counted from 0.
    ///
    /// # Errors
    /// [`SequenceError::OutOfRange`] if the range is empty or ends past the last frame.
    pub fn select(&self, range: Range<usize>) -> Result<Self, SequenceError> {
        match self.paths.get(range.clone()) {
            Some(paths) if !paths.is_empty() => {
                let times = self.times.part(range);
                Ok(Self {
                    input: self.input.clone(),
                    paths: paths.to_vec(),
                    times,
                    notes: self.notes.clone(),
                })
            }
            _ => Err(SequenceError::OutOfRange {
                input: self.input.clone(),
                asked: range,
                frames: self.paths.len(),
            }),
        }
    }
}

/// A name that is ordered by its bytes.
struct EncodedName(OsString);

impl AsRef<[u8]> for EncodedName {
    fn as_ref(&self) -> &[u8] {
        self.0.as_encoded_bytes()
    }
}

fn matching_files(path: &Path) -> Result<Listed, SequenceError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| has_wildcard(folder.as_os_str().as_encoded_bytes())) {
        return Err(SequenceError::WildcardInFolder { input: path.display().to_string() });
    }
    let pattern = path.file_name().unwrap_or_default().as_encoded_bytes();
    let (mut files, note) =
        frame_files(folder.unwrap_or(Path::new(".")), |name| matches(pattern, name.as_encoded_bytes()))?;
    if folder.is_none() {
        // Messages name files as the user would: without the "./" of the folder that was listed.
        files.iter_mut().for_each(|file| *file = file.file_name().map(PathBuf::from).unwrap_or_default());
    }
    Ok((files, note))
}

/// Files in order, and a sentence on the order where their names can be read in several ways.
type Listed = (Vec<PathBuf>, Option<String>);

/// The frames of a folder whose names are wanted, in natural order.
fn frame_files(folder: &Path, wanted: impl Fn(&OsStr) -> bool) -> Result<Listed, SequenceError> {
    let io_error = |cause| SequenceError::Io { path: folder.to_owned(), cause };
    let mut names = Vec::new();
    for entry in folder.read_dir().map_err(io_error)? {
        let name = entry.map_err(io_error)?.file_name();
        let hidden = name.as_encoded_bytes().starts_with(b".");
        let path = folder.join(&name);
        // A link to nothing is a frame that cannot be read, not one that was never there.
        if !hidden && Format::of_path(&path).is_some() && wanted(&name) && !path.is_dir() {
            names.push(EncodedName(name));
        }
    }
    let OrderedNames { names, note, .. } = NameOrder::sort(names);
    Ok((names.iter().map(|name| folder.join(&name.0)).collect(), note))
}
