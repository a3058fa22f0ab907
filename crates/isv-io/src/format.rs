//! The mesh file formats.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use thiserror::Error;

/// A mesh file format that is both read and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stanford PLY; written as binary little-endian with `float` coordinates.
    Ply,
    /// Wavefront OBJ.
    Obj,
}

/// A format name that is none of those in [`Format`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("mesh format `{}` is not one of ply, obj", name.escape_debug())]
pub struct ParseFormatError {
    /// The name given.
    pub name: String,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 2] = [Self::Ply, Self::Obj];

    /// The file extension, lower case and without the dot; also the name users write.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
        }
    }

    /// The format that a path's extension stands for, upper or lower case; `None` if it is none of ours.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::ALL.into_iter().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.extension())
    }
}

impl FromStr for Format {
    type Err = ParseFormatError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|format| format.extension() == name)
            .ok_or_else(|| ParseFormatError { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_decides_in_either_case() {
        assert_eq!(Format::of_path(Path::new("a/b.c.PLY")), Some(Format::Ply));
        assert_eq!(Format::of_path(Path::new("b.obj")), Some(Format::Obj));
        assert_eq!(Format::of_path(Path::new("ply")), None);
        assert_eq!(Format::of_path(Path::new("b.ply.gz")), None);
    }

    #[test]
    fn names_parse_back_to_their_format() {
        for format in Format::ALL {
            assert_eq!(format.to_string().parse(), Ok(format));
        }
        assert!("stl".parse::<Format>().is_err());
    }
}
