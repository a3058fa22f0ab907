//! Volumes as frames.

use super::dense::{Dense, DenseOptions, Scale, is_dense_folder, is_dense_name, is_weight_name};
use super::{COORDS, TSDF, VolumeError, read_volume, volume_grid};
use crate::natural_cmp;
use crate::wildcard::{has_wildcard, matches};
use isv_volume::{Grid, SparseVolume, Truncation, VoxelSize};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The volumes of a sequence, in frame order.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeSequence {
    /// Folders of blocks, or files of dense fields.
    paths: Vec<PathBuf>,
    /// How fields are read, if that is what they are.
    dense: Option<DenseOptions>,
    /// What their values count, once that was found out.
    scale: OnceLock<Scale>,
}

/// Whether a path is a folder with arrays of a volume. If only one of the two that it needs is there, reading says so.
#[must_use]
pub fn is_volume_folder(path: &Path) -> bool {
    [COORDS, TSDF].iter().any(|name| path.join(name).is_file())
}

impl VolumeSequence {
    /// Finds the volumes that an input names: those of [`Self::open_with`], dense fields with nothing said of them.
    ///
    /// # Errors
    /// As [`Self::open_with`].
    pub fn open(input: &Path) -> Result<Self, VolumeError> {
        Self::open_with(input, DenseOptions::default())
    }

    /// Finds the volumes that an input names, in [natural order](crate::natural_cmp):
    ///
    /// - a folder of blocks, or one with such folders in it;
    /// - a dense field, as `.npy` or `.npz`, a folder of them, or a pattern of `*` and `?` in the last part of the path.
    ///
    /// Other folders, files and names that start with a dot are passed over, and so are weights beside dense fields.
    ///
    /// # Errors
    /// [`VolumeError::Io`], or [`VolumeError::NoVolumes`] if there are none. Arrays are not opened.
    pub fn open_with(input: &Path, options: DenseOptions) -> Result<Self, VolumeError> {
        let blocks = |paths| Self { paths, dense: None, scale: OnceLock::new() };
        let fields = |paths| Self { paths, dense: Some(options), scale: OnceLock::new() };
        if input.is_file() && is_dense_name(input) {
            return Ok(fields(vec![input.to_owned()]));
        }
        let none = || VolumeError::NoVolumes { path: input.to_owned() };
        let pattern = input.file_name().map(std::ffi::OsStr::as_encoded_bytes).unwrap_or_default();
        if !input.exists() && has_wildcard(pattern) {
            let folder = input.parent().filter(|folder| !folder.as_os_str().is_empty());
            let paths = listed(folder.unwrap_or(Path::new(".")), |path| {
                matches(pattern, path.file_name().unwrap_or_default().as_encoded_bytes()) && is_frame(path)
            })?;
            return if paths.is_empty() { Err(none()) } else { Ok(fields(paths)) };
        }
        if is_dense_folder(input) {
            return Ok(fields(vec![input.join(TSDF)]));
        }
        if is_volume_folder(input) {
            return Ok(blocks(vec![input.to_owned()]));
        }
        let folders = listed(input, is_volume_folder)?;
        if !folders.is_empty() {
            let is_dense = |folder: &PathBuf| is_dense_folder(folder);
            return Ok(match folders.iter().all(is_dense) {
                true => fields(folders.iter().map(|folder| folder.join(TSDF)).collect()),
                false => blocks(folders),
            });
        }
        let files = listed(input, is_frame)?;
        if files.is_empty() { Err(none()) } else { Ok(fields(files)) }
    }

    /// Number of frames; at least one.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a sequence is never empty")]
    pub fn len(&self) -> usize {
        self.paths.len()
    }

    /// The folders of blocks, or files of dense fields, in frame order.
    #[must_use]
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Whether the frames are dense fields, for which [`DenseOptions`] matter.
    #[must_use]
    pub fn is_dense(&self) -> bool {
        self.dense.is_some()
    }

    /// Frames `range.start` up to but not including `range.end`, counted from 0; `None` if the range is empty or ends past
    /// the last frame.
    #[must_use]
    pub fn select(&self, range: Range<usize>) -> Option<Self> {
        let paths = self.paths.get(range).filter(|paths| !paths.is_empty())?;
        Some(Self { paths: paths.to_vec(), ..self.clone() })
    }

    /// The grid of a frame, as [`volume_grid`]. What the values of dense fields count is found out of the first one that is asked for,
    /// and holds for all.
    ///
    /// # Errors
    /// See [`VolumeError`]; [`VolumeError::NoVoxelSize`] if nobody knows it.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn grid(
        &self,
        frame: usize,
        voxel_size: Option<VoxelSize>,
        truncation: Option<Truncation>,
    ) -> Result<Grid, VolumeError> {
        let path = &self.paths[frame];
        let Some(options) = &self.dense else { return volume_grid(path, voxel_size, truncation) };
        let (grid, scale) = Dense::open(path, options.axes)?.grid(path, options, voxel_size, truncation)?;
        // Another thread's first frame is as good.
        let _ = self.scale.set(scale);
        Ok(grid)
    }

    /// Reads a frame, as [`read_volume`].
    ///
    /// # Errors
    /// As [`read_volume`].
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn read(&self, frame: usize, grid: &Grid) -> Result<SparseVolume, VolumeError> {
        let path = &self.paths[frame];
        let Some(options) = &self.dense else { return read_volume(path, grid) };
        let field = Dense::open(path, options.axes)?;
        let scale = match self.scale.get() {
            Some(scale) => *scale,
            None => field.grid(path, options, Some(grid.voxel_size), None)?.1,
        };
        field.read(path, options, grid, &scale)
    }

    /// Sentences on what was taken for granted of a frame that is a dense field.
    ///
    /// # Errors
    /// As [`Self::read`].
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn notes(&self, frame: usize, grid: &Grid) -> Result<Vec<String>, VolumeError> {
        let path = &self.paths[frame];
        let Some(options) = &self.dense else { return Ok(Vec::new()) };
        let field = Dense::open(path, options.axes)?;
        let mut notes = Vec::new();
        if let Some(scale) = self.scale.get().filter(|scale| scale.is_guess()) {
            notes.push(format!("{scale}; --tsdf-scale is another"));
        }
        if !field.has_weights() {
            notes.push(
                "has no weights: all but NaN, and jumps to the truncation, counts as observed".to_owned(),
            );
        }
        if field.is_interpolated(options.sample_at, grid.voxel_size.metres()) {
            notes.push("samples lie between the voxels' centres and are interpolated".to_owned());
        }
        Ok(notes)
    }
}

/// Whether a file is a frame by its name.
fn is_frame(path: &Path) -> bool {
    is_dense_name(path) && !is_weight_name(path) && path.is_file()
}

/// What a folder has that is wanted, in natural order.
fn listed(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Result<Vec<PathBuf>, VolumeError> {
    let io_error = |cause| VolumeError::Io { path: folder.to_owned(), cause };
    let mut names = Vec::new();
    for entry in folder.read_dir().map_err(io_error)? {
        let name = entry.map_err(io_error)?.file_name();
        if !name.as_encoded_bytes().starts_with(b".") && wanted(&folder.join(&name)) {
            names.push(name);
        }
    }
    names.sort_by(|a, b| natural_cmp(a.as_encoded_bytes(), b.as_encoded_bytes()));
    Ok(names.iter().map(|name| folder.join(name)).collect())
}
