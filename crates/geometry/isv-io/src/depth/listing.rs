//! The depth images that a folder or a pattern names.

use super::error::{DepthFileError, io_error};
use crate::natural_cmp;
use crate::wildcard::{has_wildcard, matches};
use std::path::{Path, PathBuf};

/// The depth images in a folder, or those whose names match a pattern, in [natural order](natural_cmp). The last part of the path
/// may have `*` and `?`. Files of other kinds and names that start with a dot are passed over.
pub(crate) fn list_images(place: &Path) -> Result<Vec<PathBuf>, DepthFileError> {
    let images = list_files(place, |name| ImageKind::from_path(name).is_some())?;
    let kinds = |kind| images.iter().any(|image| ImageKind::from_path(image) == Some(kind));
    match (kinds(ImageKind::Png), kinds(ImageKind::Exr)) {
        (false, false) => Err(DepthFileError::NoImages { path: place.to_owned() }),
        (true, true) => Err(DepthFileError::MixedImages { path: place.to_owned() }),
        _ => Ok(images),
    }
}

/// The files in a folder, or those whose names match a pattern, that are wanted by their names, as [`list_images`] lists them.
pub(super) fn list_files(
    place: &Path,
    is_wanted: impl Fn(&Path) -> bool,
) -> Result<Vec<PathBuf>, DepthFileError> {
    let name = place.file_name().unwrap_or_default().as_encoded_bytes();
    let (folder, pattern) = match place.parent() {
        Some(parent) if has_wildcard(name) && !place.is_dir() => (parent, name),
        _ => (place, &b"*"[..]),
    };
    let mut names = Vec::new();
    for entry in folder.read_dir().map_err(io_error(folder))? {
        let name = entry.map_err(io_error(folder))?.file_name();
        let bytes = name.as_encoded_bytes();
        if !bytes.starts_with(b".") && is_wanted(Path::new(&name)) && matches(pattern, bytes) {
            names.push(name);
        }
    }
    names.sort_by(|a, b| natural_cmp(a.as_encoded_bytes(), b.as_encoded_bytes()));
    Ok(names.iter().map(|name| folder.join(name)).collect())
}

/// How a depth image is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ImageKind {
    Png,
    Exr,
}

impl ImageKind {
    /// By the extension, in any case.
    pub(crate) fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_ascii_lowercase().to_str()? {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            _ => None,
        }
    }
}
