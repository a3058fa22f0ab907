//! The frames that an input names.

use crate::wildcard::{has_wildcard, matches};
use crate::{Format, FrameTimes, NameOrder, OrderedNames, is_volume_folder};
use std::ffi::{OsStr, OsString};
use std::io;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
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
    /// Sub-folders, one a frame, of which one holds more than a frame.
    #[error(
        "{}: {files} files of meshes or points, where each folder of the take holds one frame; name the file with a pattern such as \
         take/*/mesh.obj", folder.display()
    )]
    ManyInFolder {
        /// The sub-folder.
        folder: PathBuf,
        /// How many files it has.
        files: usize,
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
    /// - a folder: all files of meshes or points in it, by extension; if it has none, those in its sub-folders, one in each;
    /// - a pattern, `*` and `?` in any part of the path: those whose names match;
    /// - a file: itself.
    ///
    /// Files of other kinds and names that start with a dot are passed over. Frames come in
    /// [natural order](NameOrder). A name that exists is never taken for a pattern.
    ///
    /// # Errors
    /// See [`SequenceError`]. Files are listed, not opened.
    pub fn open(input: impl AsRef<Path>) -> Result<Self, SequenceError> {
        let path = input.as_ref();
        let input = path.display().to_string();
        let files = if path.is_dir() {
            match frame_files(path, |_| true)? {
                files if files.is_empty() => files_of_sub_folders(path)?,
                files => files,
            }
        } else if path.exists() {
            Format::of_path(path).map(|_| File::new(OsString::new(), path.to_owned())).into_iter().collect()
        } else if has_wildcard(path.as_os_str().as_encoded_bytes()) {
            matching_files(path)?
        } else {
            return Err(SequenceError::NotFound { input });
        };
        Self::of_one_format(input, files)
    }

    /// Puts files in order. Refuses lists that are empty or mixed.
    fn of_one_format(input: String, files: Vec<File>) -> Result<Self, SequenceError> {
        let OrderedNames { names: files, order, note: order_note } = NameOrder::sort(files);
        let names: Option<Vec<&str>> = files.iter().map(|file| file.time_name.as_deref()).collect();
        let (times, note) =
            names.map_or_else(Default::default, |names| FrameTimes::from_names(&names, order));
        let notes = order_note.into_iter().chain(note).collect();
        let paths: Vec<PathBuf> = files.into_iter().map(|file| file.path).collect();
        let Some(first) = paths.first() else {
            return Err(SequenceError::NoFrames { input });
        };
        let format = Format::of_path(first);
        if let Some(other) = paths.iter().find(|path| Format::of_path(path) != format) {
            let (first, other) = (first.clone(), other.clone());
            let extension = format.map_or("", Format::extension);
            return Err(SequenceError::MixedFormats { input, first, other, extension });
        }
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

/// A file, and the name that puts it in order: its own, or with its folders where these differ.
struct File {
    name: OsString,
    /// Name that tells when the frame was taken, without an extension; `None` if it is no text.
    time_name: Option<String>,
    path: PathBuf,
}

impl File {
    /// A file of a folder, by its own name.
    fn new(name: OsString, path: PathBuf) -> Self {
        let time_name = path.file_stem().and_then(OsStr::to_str).map(str::to_owned);
        Self { name, time_name, path }
    }

    /// A file that is the only one of its folder, which numbers it.
    fn of_folder(folder: &OsStr, file: Self) -> Self {
        let time_name = folder.to_str().map(str::to_owned);
        Self { name: joined(folder, &file.name), time_name, path: file.path }
    }
}

impl AsRef<[u8]> for File {
    fn as_ref(&self) -> &[u8] {
        self.name.as_encoded_bytes()
    }
}

/// The files that a path with wildcards in some of its parts names.
fn matching_files(path: &Path) -> Result<Vec<File>, SequenceError> {
    let mut parts = path.components().peekable();
    let mut folder = PathBuf::new();
    let is_plain = |part: &Component| !has_wildcard(part.as_os_str().as_encoded_bytes());
    while let Some(part) = parts.next_if(is_plain) {
        folder.push(part);
    }
    let mut folders = vec![(OsString::new(), folder)];
    let mut pattern = parts.next().map(|part| part.as_os_str().to_owned()).unwrap_or_default();
    for part in parts {
        let mut inner = Vec::new();
        for (name, folder) in folders {
            for found in
                names_in(&folder, |name| matches(pattern.as_encoded_bytes(), name.as_encoded_bytes()))?
            {
                let path = folder.join(&found);
                if path.is_dir() {
                    inner.push((joined(&name, &found), path));
                }
            }
        }
        folders = inner;
        pattern = part.as_os_str().to_owned();
    }
    let wanted = |name: &OsStr| matches(pattern.as_encoded_bytes(), name.as_encoded_bytes());
    let mut files = Vec::new();
    for (name, folder) in folders {
        let mut found = frame_files(&folder, wanted)?;
        if let (true, [_]) = (!name.is_empty(), &found[..]) {
            files.extend(found.pop().map(|file| File::of_folder(&name, file)));
        } else {
            files.extend(found.into_iter().map(|file| File { name: joined(&name, &file.name), ..file }));
        }
    }
    Ok(files)
}

/// The files of a folder's sub-folders, one in each. They are a take if the sub-folders have numbers or hold files of one name; else
/// there are none. A numbered sub-folder without its file is a frame that cannot be read; others without a file are passed over.
fn files_of_sub_folders(folder: &Path) -> Result<Vec<File>, SequenceError> {
    let (mut files, mut without) = (Vec::new(), Vec::new());
    for name in names_in(folder, |_| true)? {
        let inner = folder.join(&name);
        if !inner.is_dir() || is_volume_folder(&inner) {
            continue;
        }
        let mut found = frame_files(&inner, |_| true)?;
        if found.len() > 1 {
            return Err(SequenceError::ManyInFolder { folder: inner, files: found.len() });
        }
        match found.pop() {
            Some(file) => files.push((name, file)),
            None => without.push(name),
        }
    }
    let is_numbered = |name: &OsStr| name.as_encoded_bytes().iter().any(u8::is_ascii_digit);
    let Some((_, first)) = files.first() else { return Ok(Vec::new()) };
    let file_name = first.name.clone();
    let same_name = files.iter().all(|(_, file)| file.name == file_name);
    let all_numbered = files.iter().all(|(name, _)| is_numbered(name));
    if !same_name && !all_numbered {
        return Ok(Vec::new());
    }
    if all_numbered {
        let lost = without.into_iter().filter(|name| is_numbered(name));
        files.extend(lost.map(|name| {
            let path = folder.join(&name).join(&file_name);
            (name, File::new(file_name.clone(), path))
        }));
    }
    Ok(files.into_iter().map(|(name, file)| File::of_folder(&name, file)).collect())
}

/// A path of two names, which sorts as one name.
fn joined(folder: &OsStr, name: &OsStr) -> OsString {
    let mut joined = folder.to_owned();
    if !folder.is_empty() {
        joined.push("/");
    }
    joined.push(name);
    joined
}

/// The names in a folder that are wanted, without those that start with a dot. The folder may be empty: where the program runs.
fn names_in(folder: &Path, wanted: impl Fn(&OsStr) -> bool) -> Result<Vec<OsString>, SequenceError> {
    let place = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let io_error = |cause| SequenceError::Io { path: place.to_owned(), cause };
    let mut names = Vec::new();
    for entry in place.read_dir().map_err(io_error)? {
        let name = entry.map_err(io_error)?.file_name();
        if !name.as_encoded_bytes().starts_with(b".") && wanted(&name) {
            names.push(name);
        }
    }
    Ok(names)
}

/// The frames of a folder whose names are wanted.
fn frame_files(folder: &Path, wanted: impl Fn(&OsStr) -> bool) -> Result<Vec<File>, SequenceError> {
    let files = names_in(folder, wanted)?.into_iter().map(|name| {
        let path = folder.join(&name);
        File::new(name, path)
    });
    // A link to nothing is a frame that cannot be read, not one that was never there.
    Ok(files.filter(|file| Format::of_path(&file.path).is_some() && !file.path.is_dir()).collect())
}
