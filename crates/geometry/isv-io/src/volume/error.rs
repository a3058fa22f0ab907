//! What can be wrong with a folder of arrays.

use super::TSDF;
use isv_volume::{COORD_LIMIT, GridError};
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// A volume that could not be read. Every message is one sentence that starts with the file's name.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The operating system refused.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// Neither a folder with the arrays of a volume nor a folder of such folders.
    #[error("{}: no volume here: neither a coords.npy with a {TSDF} beside it, nor folders that have them, nor dense fields as .npy or .npz", path.display())]
    NoVolumes {
        /// The folder.
        path: PathBuf,
    },
    /// A file that is no array, or no array that can be used here.
    #[error("{}: {why}", path.display())]
    Array {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: ArrayFlaw,
    },
    /// A `grid.json` that cannot be understood.
    #[error("{}: {why}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Nobody says how large a voxel is.
    #[error("{}: no voxel size is known: write a grid.json with \"voxel_size_m\", or give --voxel", path.display())]
    NoVoxelSize {
        /// The folder.
        path: PathBuf,
    },
    /// The folder's grid is not one that can be coded.
    #[error("{}: {cause}", path.display())]
    Grid {
        /// The folder.
        path: PathBuf,
        /// What is wrong with the grid.
        cause: GridError,
    },
    /// The folder's grid is not the one that was asked for.
    #[error("{}: {what} is {found}, but the grid asked for has {asked}", path.display())]
    OtherGrid {
        /// The folder.
        path: PathBuf,
        /// Which property differs.
        what: &'static str,
        /// What the folder has.
        found: String,
        /// What was asked for.
        asked: String,
    },
    /// An array that is no dense field.
    #[error("{}: {}shape {} is not a dense field of distances, which has three axes: {advice}", path.display(), of_member(member), tuple(shape))]
    NotDense {
        /// The file.
        path: PathBuf,
        /// Name of the array in an archive; empty for a file of one array.
        member: String,
        /// The array's shape.
        shape: Vec<usize>,
        /// What to do.
        advice: &'static str,
    },
    /// An archive of arrays that cannot be read.
    #[error("{}: {why}", path.display())]
    Archive {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// An archive of arrays without one that can be the distances.
    #[error("{}: no array of distances here: save it as `tsdf`; there are {members}", path.display())]
    NoField {
        /// The file.
        path: PathBuf,
        /// Names and shapes of the arrays.
        members: String,
    },
    /// An array of an archive that cannot be used.
    #[error("{}: `{member}`: {why}", path.display())]
    Member {
        /// The file.
        path: PathBuf,
        /// Name of the array.
        member: String,
        /// What is wrong with it.
        why: ArrayFlaw,
    },
    /// A number beside a dense field that makes no sense.
    #[error("{}: `{member}` is {found}, it must be {wanted}", path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Name of the array.
        member: String,
        /// What it holds.
        found: String,
        /// What is accepted.
        wanted: &'static str,
    },
    /// Nobody says what the distances of a dense field count, and it cannot be told from them.
    #[error("{}: cannot tell what the distances count: give --tsdf-scale, the length that a value of 1 stands for", path.display())]
    NoScale {
        /// The file.
        path: PathBuf,
    },
    /// A block too far from the origin.
    #[error("{}: block {row} lies at {coord:?}, the limit is {COORD_LIMIT} blocks along an axis", path.display())]
    OutOfRange {
        /// The file of coordinates.
        path: PathBuf,
        /// Row of the block.
        row: usize,
        /// Coordinates of the block.
        coord: [i64; 3],
    },
    /// Two blocks at one place.
    #[error("{}: blocks {} and {} both lie at {coord:?}", path.display(), rows[0], rows[1])]
    Duplicate {
        /// The file of coordinates.
        path: PathBuf,
        /// Rows of the two blocks.
        rows: [usize; 2],
        /// Coordinates of both blocks.
        coord: [i32; 3],
    },
}

/// `array `name` of `, or nothing for a file of one array.
fn of_member(name: &str) -> String {
    if name.is_empty() { String::new() } else { format!("`{name}` of ") }
}

/// A shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    let extents: Vec<String> = shape.iter().map(usize::to_string).collect();
    format!("({}{})", extents.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// How bytes are no array that can be used. Texts quoted from the file are shortened.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ArrayFlaw {
    /// The file does not start as NumPy's files do.
    #[error("not a NumPy file: it does not begin with \\x93NUMPY")]
    NotNpy,
    /// A version of the format that is not known.
    #[error("NumPy file format {major}.{minor} is not known, 1.0 to 3.0 are")]
    Version {
        /// Major version.
        major: u8,
        /// Minor version.
        minor: u8,
    },
    /// The file ends inside its header.
    #[error("truncated: the file ends inside its header")]
    HeaderEnd,
    /// The header is not a dictionary of `descr`, `fortran_order` and `shape`.
    #[error("header not understood: `{text}`")]
    Header {
        /// The header.
        text: String,
    },
    /// An element type that cannot be used here.
    #[error("elements of type `{found}` cannot be used here, it must be {wanted}")]
    Type {
        /// NumPy's name of the type.
        found: String,
        /// What is accepted.
        wanted: &'static str,
    },
    /// The first axis runs fastest.
    #[error("the array is in Fortran order: save numpy.ascontiguousarray(...) of it")]
    FortranOrder,
    /// A shape that does not fit.
    #[error("the shape is {found:?}, it must be {wanted}")]
    Shape {
        /// The array's shape.
        found: Vec<usize>,
        /// What is accepted.
        wanted: String,
    },
    /// More or fewer bytes than the shape takes.
    #[error("the shape takes {promised} bytes, but {found} follow the header")]
    Length {
        /// Bytes of an array of this shape and type.
        promised: u128,
        /// Bytes after the header.
        found: usize,
    },
}
