//! One depth image.

use super::error::DepthFileError;
use super::listing::ImageKind;
use super::{exr_image, png_image};
use crate::regular_file;
use std::io::BufReader;
use std::path::Path;

/// Most bytes of samples to a byte of a file. Deflate cannot pack them denser, and no other packing in use comes near it.
const MOST_PACKED: u64 = 1032;

/// What the whole numbers of a PNG mean.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Units {
    /// Metres to one unit.
    pub(crate) depth_scale_m: f64,
    /// Values that are no reading, each once and in rising order, as every pixel is looked for among them.
    pub(crate) invalid: Vec<u16>,
    /// Whether the capture says which values these are.
    pub(crate) invalid_is_given: bool,
}

/// The largest value of a pixel. Cameras that saturate, and several data sets, write it for "no reading".
pub(crate) const SATURATED: u16 = u16::MAX;

impl Units {
    /// Units with the values that a capture says are no reading; where it does not say, zero and [`SATURATED`].
    pub(crate) fn new(depth_scale_m: f64, invalid: Option<Vec<u16>>) -> Self {
        let invalid_is_given = invalid.is_some();
        let mut invalid = invalid.unwrap_or_else(|| vec![0, SATURATED]);
        invalid.sort_unstable();
        invalid.dedup();
        Self { depth_scale_m, invalid, invalid_is_given }
    }
}

/// Share of an image's pixels that hold [`SATURATED`]; none for other images than PNG.
pub(crate) fn saturated_share(file: &ImageFile) -> Option<f64> {
    if ImageKind::of(file.path) != Some(ImageKind::Png) {
        return None;
    }
    // Nothing but that value is a reading.
    let units = Units::new(1.0, Some((0..SATURATED).collect()));
    let depths = read(file, &units).ok()?;
    let saturated = depths.iter().filter(|depth| **depth > 0.0).count();
    Some(saturated as f64 / depths.len() as f64)
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
    let (opened, length) = regular_file::open(file.path).map_err(io_error)?;
    let bytes = BufReader::new(opened);
    match ImageKind::of(file.path) {
        Some(ImageKind::Png) => png_image::read(bytes, length, file, units),
        Some(ImageKind::Exr) => exr_image::read(bytes, length, file),
        None => Err(file.flaw("neither .png nor .exr")),
    }
}

impl ImageFile<'_> {
    /// An error with the file's name.
    pub(crate) fn flaw(&self, why: impl ToString) -> DepthFileError {
        DepthFileError::Image { path: self.path.to_owned(), frame: self.frame, why: why.to_string() }
    }

    /// Refuses an image whose header states another size than expected, or one that a file of `length` bytes cannot hold.
    pub(crate) fn check_size(&self, found: [u64; 2], length: u64) -> Result<(), DepthFileError> {
        if found != self.size.map(u64::from) {
            let (path, frame, expected) = (self.path.to_owned(), self.frame, self.size);
            return Err(DepthFileError::ImageSize { path, frame, found, expected });
        }
        // Samples have two bytes or more.
        if found[0] * found[1] * 2 > length.saturating_mul(MOST_PACKED) {
            let [columns, rows] = found;
            return Err(self.flaw(format!("{length} bytes cannot hold {columns} x {rows} pixels")));
        }
        Ok(())
    }
}
