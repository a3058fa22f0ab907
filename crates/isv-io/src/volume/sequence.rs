//! Volumes as frames.

use super::{COORDS, TSDF, VolumeError, read_volume, volume_grid};
use crate::natural_cmp;
use isv_volume::{Grid, SparseVolume, Truncation, VoxelSize};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The volumes of a sequence, in frame order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VolumeSequence {
    folders: Vec<PathBuf>,
}

/// Whether a path is a folder with arrays of a volume. If only one of the two that it needs is there, reading says so.
#[must_use]
pub fn is_volume_folder(path: &Path) -> bool {
    [COORDS, TSDF].iter().any(|name| path.join(name).is_file())
}

impl VolumeSequence {
    /// Finds the volumes that a folder names: its own, or one in each of its folders, in
    /// [natural order](crate::natural_cmp). Other folders, files and names that start with a dot are passed over.
    ///
    /// # Errors
    /// [`VolumeError::Io`], or [`VolumeError::NoVolumes`] if there are none. Arrays are not opened.
    pub fn open(folder: &Path) -> Result<Self, VolumeError> {
        if is_volume_folder(folder) {
            return Ok(Self { folders: vec![folder.to_owned()] });
        }
        let io_error = |cause| VolumeError::Io { path: folder.to_owned(), cause };
        let mut names = Vec::new();
        for entry in folder.read_dir().map_err(io_error)? {
            let name = entry.map_err(io_error)?.file_name();
            if !name.as_encoded_bytes().starts_with(b".") && is_volume_folder(&folder.join(&name)) {
                names.push(name);
            }
        }
        if names.is_empty() {
            return Err(VolumeError::NoVolumes { path: folder.to_owned() });
        }
        names.sort_by(|a, b| natural_cmp(a.as_encoded_bytes(), b.as_encoded_bytes()));
        Ok(Self { folders: names.iter().map(|name| folder.join(name)).collect() })
    }

    /// Number of frames; at least one.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a sequence is never empty")]
    pub fn len(&self) -> usize {
        self.folders.len()
    }

    /// The folders in frame order.
    #[must_use]
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Frames `range.start` up to but not including `range.end`, counted from 0; `None` if the range is empty or ends past
    /// the last frame.
    #[must_use]
    pub fn select(&self, range: Range<usize>) -> Option<Self> {
        let folders = self.folders.get(range).filter(|folders| !folders.is_empty())?;
        Some(Self { folders: folders.to_vec() })
    }

    /// The grid of a frame, as [`volume_grid`].
    ///
    /// # Errors
    /// As [`volume_grid`].
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn grid(
        &self,
        frame: usize,
        voxel_size: Option<VoxelSize>,
        truncation: Option<Truncation>,
    ) -> Result<Grid, VolumeError> {
        volume_grid(&self.folders[frame], voxel_size, truncation)
    }

    /// Reads a frame, as [`read_volume`].
    ///
    /// # Errors
    /// As [`read_volume`].
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn read(&self, frame: usize, grid: &Grid) -> Result<SparseVolume, VolumeError> {
        read_volume(&self.folders[frame], grid)
    }
}
