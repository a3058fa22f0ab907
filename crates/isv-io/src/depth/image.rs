//! One depth image.

use super::error::DepthFileError;
use super::listing::ImageKind;
use super::{exr_image, png_image};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What the whole numbers of a PNG mean.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Units {
    /// Metres to one unit.
    pub(crate) depth_scale_m: f64,
    /// Values that are no reading.
    pub(crate) invalid: Vec<u16>,
}

/// An image to be read, and what is expected of it.
pub(crate) struct ImageFile<'a> {
    pub(crate) path: &'a Path,
    pub(crate) frame: usize,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
}

/// The depths of an image in metres, row after row; 0 or not finite where there is no reading.
pub(crate) fn read(file: &ImageFile, units: &Units) -> Result<Vec<f32>, DepthFileError> {
    let io_error = |cause| DepthFileError::ImageIo { path: file.path.to_owned(), frame: file.frame, cause };
    let bytes = BufReader::new(File::open(file.path).map_err(io_error)?);
    match ImageKind::of(file.path) {
        Some(ImageKind::Png) => png_image::read(bytes, file, units),
        Some(ImageKind::Exr) => exr_image::read(bytes, file),
        None => Err(file.flaw("neither .png nor .exr")),
    }
}

impl ImageFile<'_> {
    /// An error with the file's name.
    pub(crate) fn flaw(&self, why: impl ToString) -> DepthFileError {
        DepthFileError::Image { path: self.path.to_owned(), frame: self.frame, why: why.to_string() }
    }

    /// Refuses an image whose header states another size than expected.
    pub(crate) fn check_size(&self, found: [u64; 2]) -> Result<(), DepthFileError> {
        if found == self.size.map(u64::from) {
            return Ok(());
        }
        let (path, frame, expected) = (self.path.to_owned(), self.frame, self.size);
        Err(DepthFileError::ImageSize { path, frame, found, expected })
    }
}
