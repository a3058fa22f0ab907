//! The file formats of meshes and points.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use thiserror::Error;

/// A file format of frames. What it can hold differs: [`Self::writes_mesh`], [`Self::writes_points`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stanford PLY; written as binary little-endian with `float` coordinates.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// STL, text or binary; written as binary.
    Stl,
    /// OFF as text; read only.
    Off,
    /// Binary glTF 2.0, one file.
    Glb,
    /// glTF 2.0 as JSON, with its buffers beside it or inside; read only.
    Gltf,
    /// Points of the Point Cloud Library; written as version 0.7, binary.
    Pcd,
    /// Points as text, `x y z` or `x y z nx ny nz` a line.
    Xyz,
    /// Lidar points, ASPRS LAS 1.0 to 1.4; read only.
    Las,
    /// LAS, compressed by LASzip; read only.
    Laz,
    /// Scans, ASTM E2807; read only.
    E57,
}

/// A format name that is none of those in [`Format`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("file format `{}` is not one of {}", name.escape_debug(), Format::names(Format::ALL, ""))]
pub struct ParseFormatError {
    /// The name given.
    pub name: String,
}

impl Format {
    /// All formats.
    pub const ALL: &[Self] = &[
        Self::Ply,
        Self::Obj,
        Self::Stl,
        Self::Off,
        Self::Glb,
        Self::Gltf,
        Self::Pcd,
        Self::Xyz,
        Self::Las,
        Self::Laz,
        Self::E57,
    ];

    /// The file extension, lower case and without the dot; also the name users write.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Off => "off",
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Pcd => "pcd",
            Self::Xyz => "xyz",
            Self::Las => "las",
            Self::Laz => "laz",
            Self::E57 => "e57",
        }
    }

    /// The format that a path's extension stands for, upper or lower case; `None` if it is none of ours.
    #[must_use]
    pub fn of_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::ALL.iter().copied().find(|format| extension.eq_ignore_ascii_case(format.extension()))
    }

    /// Whether meshes can be written in this format.
    #[must_use]
    pub fn writes_mesh(self) -> bool {
        match self {
            Self::Ply => true,
            Self::Obj => true,
            Self::Stl => true,
            Self::Off => false,
            Self::Glb => true,
            Self::Gltf => false,
            Self::Pcd => false,
            Self::Xyz => false,
            Self::Las => false,
            Self::Laz => false,
            Self::E57 => false,
        }
    }

    /// Whether points can be written in this format.
    #[must_use]
    pub fn writes_points(self) -> bool {
        match self {
            Self::Ply => true,
            Self::Obj => false,
            Self::Stl => false,
            Self::Off => false,
            Self::Glb => false,
            Self::Gltf => false,
            Self::Pcd => true,
            Self::Xyz => true,
            Self::Las => false,
            Self::Laz => false,
            Self::E57 => false,
        }
    }

    /// Whether one file of this format may hold a whole [`Animation`](crate::Animation).
    #[must_use]
    pub fn may_be_animated(self) -> bool {
        matches!(self, Self::Glb | Self::Gltf)
    }

    /// The names of formats for a message, each after `prefix`: `ply, obj`.
    #[must_use]
    pub fn names(formats: &[Self], prefix: &str) -> String {
        let names: Vec<_> = formats.iter().map(|format| format!("{prefix}{format}")).collect();
        names.join(", ")
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
            .iter()
            .copied()
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
            assert_eq!(format.to_string().parse(), Ok(*format));
        }
        assert!("doc".parse::<Format>().is_err());
    }
}
