//! Frames from a pipe: a tar archive of frame files, or PLY files one after another.

mod ply_files;
mod tar_archive;

use crate::text::UTF8_MARK;
use crate::{Colours, Format, Geometry, InvalidPoints, ReadError, ReadOptions, Unit, parse_geometry_as};
use ply_files::PlyFiles;
use std::io::{self, Chain, Cursor, Read};
use std::path::PathBuf;
use tar_archive::TarArchive;
use thiserror::Error;

/// Most bytes of one frame in a pipe: 1 GiB, some 20 million triangles of binary PLY. Files have no such limit; a pipe
/// cannot be asked how much it holds.
pub const MAX_FRAME_BYTES: u64 = 1 << 30;

/// Bytes that tell a PLY file: a byte order mark, the first word and what ends it.
const PLY_BYTES: u64 = 7;

/// Bytes that tell a tar archive: its magic is the last of them.
const HEAD_BYTES: u64 = 262;

/// What the bytes looked at and those after them are read from.
type Joined<R> = Chain<Cursor<Vec<u8>>, R>;

/// Frames read one after another from anything that gives bytes, such as standard input.
///
/// The first bytes tell which of two things it is:
///
/// - a tar archive (ustar, GNU or pax): its files are the frames, in their order; names pick the format, as
///   [`read_geometry`](crate::read_geometry) does. Folders, links, files of other kinds and files whose name starts with a
///   dot are passed over;
/// - PLY files without anything but white space between them; they are named `frame_000000.ply` and so on.
///
/// An iterator over each frame's name and geometry, in metres. One frame is in memory at a time, and memory
/// grows with the bytes that arrive, not with what a header promises. After a frame that came whole and
/// cannot be used the next one follows. Every other error is the last item, and so is a PLY file that breaks
/// its format, as its end is not known.
///
/// ```
/// use isv_io::{FrameStream, Unit};
/// let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
/// let pipe = format!("{ply}1 2 3\n{ply}4 5 6\n");
/// let names: Vec<_> = FrameStream::new(pipe.as_bytes(), Unit::Metre)?.map(|frame| frame.unwrap().0).collect();
/// assert_eq!(names.len(), 2);
/// # Ok::<(), isv_io::FrameStreamError>(())
/// ```
pub struct FrameStream<R> {
    frames: Frames<Joined<R>>,
    options: ReadOptions,
    /// Whether the last item was given.
    ended: bool,
}

enum Frames<R> {
    Tar(TarArchive<R>),
    Ply(Box<PlyFiles<R>>),
}

/// A pipe that gives no frames, or no more.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FrameStreamError {
    /// The operating system refused.
    #[error("pipe: {cause}")]
    Io {
        /// What the operating system said.
        cause: io::Error,
    },
    /// Neither of the things that a pipe may hold.
    #[error(
        "pipe: neither a tar archive of frames nor PLY files one after another, which is what a pipe may hold"
    )]
    NotFrames,
    /// Nothing came.
    #[error("pipe: empty")]
    Empty,
    /// An archive without a frame in it.
    #[error(
        "pipe: no frames in the archive; they must be files of {}, not links (tar -h packs what they lead to)",
        Format::names(Format::ALL, ".")
    )]
    NoFrames,
    /// The archive ends inside a frame.
    #[error("{}: the pipe ends {missing} bytes before the end of this file", path.display())]
    CutFrame {
        /// The frame's name.
        path: PathBuf,
        /// Bytes that did not come.
        missing: u64,
    },
    /// The archive ends without the two empty blocks that end an archive, or inside a header.
    #[error("pipe: the archive has no end mark; frames may be missing")]
    CutArchive,
    /// A block of the archive that is no header.
    #[error("pipe: block {block} of the archive is damaged or of a kind that is not read")]
    DamagedArchive {
        /// Number of the block, from 0, in blocks of 512 bytes.
        block: u64,
    },
    /// A frame of more than [`MAX_FRAME_BYTES`].
    #[error("{}: larger than {MAX_FRAME_BYTES} bytes, the limit of a frame in a pipe", path.display())]
    TooLarge {
        /// The frame's name.
        path: PathBuf,
    },
    /// Frames of more than one kind.
    #[error("{}: the frames before are .{before} files; a pipe holds one kind of them", path.display())]
    MixedFormats {
        /// The first frame of another kind.
        path: PathBuf,
        /// The kind of those before.
        before: Format,
    },
    /// A frame that came whole and cannot be read.
    #[error(transparent)]
    Frame(#[from] ReadError),
}

impl From<io::Error> for FrameStreamError {
    fn from(cause: io::Error) -> Self {
        Self::Io { cause }
    }
}

impl<R: Read> FrameStream<R> {
    /// Looks at the first bytes to find out what comes. Coordinates are in `unit`. A reader whose start was looked at
    /// before must give those bytes again, as [`io::BufRead::fill_buf`] and [`Read::chain`] do.
    ///
    /// # Errors
    /// [`FrameStreamError::Empty`], [`FrameStreamError::NotFrames`], or [`FrameStreamError::Io`].
    pub fn new(mut reader: R, unit: Unit) -> Result<Self, FrameStreamError> {
        let mut head = Vec::new();
        reader.by_ref().take(PLY_BYTES).read_to_end(&mut head)?;
        let start = head.strip_prefix(UTF8_MARK).unwrap_or(&head);
        let is_ply = start.get(..3).is_some_and(|word| word.eq_ignore_ascii_case(b"ply"))
            && start.get(3).is_some_and(u8::is_ascii_whitespace);
        // The first frame may be smaller than the head of an archive, and the next one come later.
        if !is_ply {
            reader.by_ref().take(HEAD_BYTES - PLY_BYTES).read_to_end(&mut head)?;
        }
        let is_tar = head.ends_with(b"ustar") && head.len() as u64 == HEAD_BYTES;
        let is_empty = head.is_empty();
        let joined = Cursor::new(head).chain(reader);
        let frames = if is_ply {
            Frames::Ply(Box::new(PlyFiles::new(joined)))
        } else if is_tar {
            Frames::Tar(TarArchive::new(joined))
        } else if is_empty {
            return Err(FrameStreamError::Empty);
        } else {
            return Err(FrameStreamError::NotFrames);
        };
        Ok(Self { frames, options: ReadOptions::new(unit), ended: false })
    }

    /// Says what becomes of points that are nowhere.
    #[must_use]
    pub fn with_invalid_points(self, invalid: InvalidPoints) -> Self {
        Self { options: self.options.with_invalid_points(invalid), ..self }
    }

    /// Says what becomes of colours. Nothing lies beside a frame in a pipe: an image in another file is an error if colours are kept.
    #[must_use]
    pub fn with_colours(self, colours: Colours) -> Self {
        Self { options: self.options.with_colours(colours), ..self }
    }
}

impl<R: Read> Iterator for FrameStream<R> {
    type Item = Result<(PathBuf, Geometry), FrameStreamError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let frame = match &mut self.frames {
            Frames::Ply(files) => files.next_frame(self.options.colours).map(|frame| {
                frame.map(|(path, geometry)| {
                    geometry.checked(&path, &self.options).map(|geometry| (path, geometry))
                })
            }),
            Frames::Tar(archive) => archive.next_file().map(|file| {
                file.map(|(path, bytes)| {
                    parse_geometry_as(&path, &bytes, &self.options).map(|geometry| (path, geometry))
                })
            }),
        };
        self.ended = !matches!(frame, Ok(Some(_)));
        frame.transpose().map(|frame| frame?.map_err(FrameStreamError::Frame))
    }
}
