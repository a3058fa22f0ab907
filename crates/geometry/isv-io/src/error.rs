//! What can go wrong with a file. Every message is one sentence that starts with the file's name.

use crate::{Format, GltfFault, ImageError, ImageFault};
use isv_volume::{MeshError, PointsError};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A frame that could not be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// The bytes break the file format.
    #[error("{}: {why} ({at})", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Position in the file.
        at: Position,
        /// What is wrong there.
        why: Malformation,
    },
    /// The file is well-formed, the mesh in it is not usable.
    #[error("{}: {cause}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with the mesh; its face numbers count triangles after polygons were split.
        cause: MeshError,
    },
    /// The file is well-formed, the points in it are not usable.
    #[error("{}: {cause}", path.display())]
    Points {
        /// The file.
        path: PathBuf,
        /// What is wrong with the points.
        cause: PointsError,
    },
    /// Points, where only a mesh will do.
    #[error("{}: points without faces, where a mesh is needed", path.display())]
    NotAMesh {
        /// The file.
        path: PathBuf,
    },
    /// A coordinate beyond [`MAX_COORDINATE_M`](crate::MAX_COORDINATE_M): almost always a wrong unit or a damaged file.
    #[error(
        "{}: vertex {vertex} lies {metres:e} m from the origin along an axis, the limit is {:e} m; check --units",
        path.display(), crate::MAX_COORDINATE_M
    )]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Index of the vertex.
        vertex: usize,
        /// Coordinate of largest magnitude, in metres.
        metres: f64,
    },
    /// No reader for files of this name.
    #[error(
        "{}: not a file of meshes or points that can be read: the extension must be one of {}",
        path.display(), Format::names(Format::ALL, ".")
    )]
    UnsupportedExtension {
        /// The file.
        path: PathBuf,
    },
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Bytes from the start of the file.
    Byte(u64),
    /// Line of a text file, counted from 1.
    Line(u64),
    /// An object of a file, such as `node 3` of glTF or `material 0` of OBJ.
    Object {
        /// Kind of the object.
        kind: &'static str,
        /// Place of the object among those of its kind, from 0.
        index: usize,
    },
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(at) => write!(f, "byte {at}"),
            Self::Line(at) => write!(f, "line {at}"),
            Self::Object { kind, index } => write!(f, "{kind} {index}"),
        }
    }
}

/// How bytes break a file format. Texts quoted from the file are shortened.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Malformation {
    /// The file does not start with the line `ply`.
    #[error("not a PLY file: its first line is not `ply`")]
    NotPly,
    /// The first bytes are not those that every file of its format starts with.
    #[error("no {format} file, as it does not start with `{magic}`")]
    Magic {
        /// The name of the format.
        format: &'static str,
        /// What such files start with.
        magic: &'static str,
    },
    /// What a format's own library, or a reader of a library's files, says of a file that it cannot read.
    #[error("not a readable {format} file: {why}")]
    Unreadable {
        /// The name of the format.
        format: &'static str,
        /// The reason, in one line.
        why: String,
    },
    /// Neither text that starts with `solid` nor a binary header of 84 bytes.
    #[error("not an STL file: it neither starts with `solid` nor has a binary header")]
    NotStl,
    /// A facet that is not a triangle.
    #[error("an STL facet has {corners} vertices, not 3")]
    FacetCorners {
        /// Number of vertices.
        corners: usize,
    },
    /// A word where a keyword of the format should be, or a keyword out of place.
    #[error("`{text}` is not what {format} has here")]
    Keyword {
        /// The name of the format.
        format: &'static str,
        /// The word.
        text: String,
    },
    /// The file ends before something that every whole file has.
    #[error("truncated: the file ends before its {what}")]
    EndsBefore {
        /// What is missing.
        what: &'static str,
    },
    /// Two places of a file tell the number of points differently.
    #[error("one place says {said} points, another {found}")]
    PointCount {
        /// The number declared first.
        said: u64,
        /// The number declared later, or found.
        found: u64,
    },
    /// More points than a compressed file of this size may hold.
    #[error("{points} points are compressed to {bytes} bytes, which may hold {limit}")]
    TooManyPoints {
        /// The number declared.
        points: u64,
        /// Bytes of the file.
        bytes: u64,
        /// The most that so many bytes may hold.
        limit: u64,
    },
    /// A polygon that is too large to be split into triangles, unless it is convex.
    #[error("a polygon of {corners} corners that is not convex; up to {limit} are split into triangles")]
    LargePolygon {
        /// Number of corners.
        corners: usize,
        /// Most that a polygon may have that is not convex.
        limit: usize,
    },
    /// The file does not start with `OFF`.
    #[error("not an OFF file: it does not start with `OFF`")]
    NotOff,
    /// A kind of OFF that is not read: binary, or of other than three dimensions.
    #[error(
        "`{text}` cannot be read: only OFF as text and in three dimensions can, so convert the file to that"
    )]
    OffVariant {
        /// How the file names its kind.
        text: String,
    },
    /// An image that the file names and that cannot be read.
    #[error(transparent)]
    Image(Box<ImageError>),
    /// A material library that the file names and that cannot be read, though it is there.
    #[error("material library `{name}`: {fault}")]
    Library {
        /// Name of the library, shortened.
        name: String,
        /// Reason why it cannot be read.
        fault: Box<ImageFault>,
    },
    /// More materials than a mesh can have.
    #[error("its faces have more than {limit} materials")]
    TooManyMaterials {
        /// The most that a mesh can have.
        limit: usize,
    },
    /// What only a glTF file can get wrong.
    #[error(transparent)]
    Gltf(#[from] GltfFault),
    /// The file ends inside its header.
    #[error("truncated: the header has no end_header line")]
    HeaderEnd,
    /// A header line that is none of PLY's, or stands in a wrong place.
    #[error("header line not understood: `{text}`")]
    HeaderLine {
        /// The line.
        text: String,
    },
    /// The format line is missing, or names an encoding or version that is not PLY 1.0's.
    #[error("no format line with ascii, binary_little_endian or binary_big_endian and version 1.0")]
    NoFormat,
    /// A property of a type that PLY does not know, or that does not fit its place.
    #[error("property type `{text}` cannot be used here")]
    PropertyType {
        /// The type as written.
        text: String,
    },
    /// An element or property was declared twice.
    #[error("`{name}` is declared twice")]
    Duplicate {
        /// Name of the thing.
        name: String,
    },
    /// More elements, or more properties in one element, than any real file has.
    #[error("the header declares more than {limit} elements or properties")]
    HeaderSize {
        /// The most that is accepted.
        limit: usize,
    },
    /// An element or property that a mesh needs.
    #[error("the header declares no {what}")]
    Missing {
        /// What is missing.
        what: &'static str,
    },
    /// The file ends before everything the header promised.
    #[error("truncated: header promises {promised} {rows}, data ends after {found}")]
    Truncated {
        /// What the rows are: `vertices`, `faces` or, say, `camera rows`.
        rows: String,
        /// How many the header declares.
        promised: u64,
        /// How many are there whole.
        found: u64,
    },
    /// A line of a text file with fewer or more values than its kind has.
    #[error("line has too {} values", if *.too_many { "many" } else { "few" })]
    LineLength {
        /// Whether there are more values than declared, not fewer.
        too_many: bool,
    },
    /// A text that is no number, or no number of the declared type.
    #[error("`{text}` is not a number that fits here")]
    Number {
        /// The text.
        text: String,
    },
    /// A list with a negative length.
    #[error("a list has length {length}")]
    ListLength {
        /// The length.
        length: i64,
    },
    /// A vertex index that cannot name any vertex.
    #[error("`{text}` does not name a vertex")]
    Index {
        /// The index as written.
        text: String,
    },
}

impl From<ImageError> for Malformation {
    fn from(error: ImageError) -> Self {
        Self::Image(Box::new(error))
    }
}

/// A text from a file, fit for a message: control characters escaped, at most 40 characters.
pub(crate) fn quote(text: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(&text[..text.len().min(4 * LONGEST)]);
    let mut quoted: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().count() > LONGEST {
        quoted.push_str("...");
    }
    quoted
}

/// What a library says of a file, fit for the end of a message: one line, at most 160 characters, no full stop.
pub(crate) fn library_text(error: &dyn fmt::Display) -> String {
    const LONGEST: usize = 160;
    let text = error.to_string();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.trim_end_matches('.').chars().take(LONGEST).flat_map(char::escape_debug).collect()
}

/// A malformation and its place, before the file's name is known.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Flaw {
    pub(crate) at: Position,
    pub(crate) why: Malformation,
}

impl Flaw {
    pub(crate) fn at_line(line: usize, why: Malformation) -> Self {
        Self { at: Position::Line(line as u64), why }
    }

    pub(crate) fn at_byte(byte: usize, why: Malformation) -> Self {
        Self { at: Position::Byte(byte as u64), why }
    }

    /// What a format's own library says of a file; `byte` is where the part that it read starts.
    pub(crate) fn unreadable(format: &'static str, byte: usize, why: &dyn fmt::Display) -> Self {
        Self::at_byte(byte, Malformation::Unreadable { format, why: library_text(why) })
    }

    /// A flaw of an object of a glTF file.
    pub(crate) fn in_object(kind: &'static str, index: usize, why: impl Into<Malformation>) -> Self {
        Self { at: Position::Object { kind, index }, why: why.into() }
    }

    pub(crate) fn in_file(self, path: &Path) -> ReadError {
        ReadError::Malformed { path: path.to_owned(), at: self.at, why: self.why }
    }
}

/// A file that could not be written.
#[derive(Debug, Error)]
#[error("{}: cannot write: {cause}", path.display())]
pub struct WriteError {
    /// The file, by its final name.
    pub path: PathBuf,
    /// What the operating system said.
    pub cause: io::Error,
}

impl WriteError {
    /// Names the file of an error; an error that is a `WriteError` inside already does.
    pub(crate) fn new(path: &Path, cause: io::Error) -> Self {
        cause.downcast::<Self>().unwrap_or_else(|cause| Self { path: path.to_owned(), cause })
    }
}

impl From<WriteError> for io::Error {
    fn from(error: WriteError) -> Self {
        Self::new(error.cause.kind(), error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_text_is_short_and_printable() {
        assert_eq!(quote(b"a\tb\xff"), "a\\tb\u{fffd}");
        assert_eq!(quote(&[b'x'; 1000]), format!("{}...", "x".repeat(40)));
    }
}
