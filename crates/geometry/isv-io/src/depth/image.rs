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

    /// Whether a value is no reading.
    pub(crate) fn is_invalid(&self, value: u16) -> bool {
        self.invalid.binary_search(&value).is_ok()
    }
}

/// Largest values that cameras and tools write for "no reading": of 11 to 15 bits, and round numbers.
const SENTINELS: [u16; 9] = [2047, 4095, 8191, 10_000, 16_383, 32_767, 60_000, 65_000, 65_534];

/// Share of an image from which on its largest value is said to be suspect, if it is one of [`SENTINELS`]. A
/// wall would be no whole image at one distance, and at just this one.
const SUSPECT_SHARE: f64 = 0.05;

/// Share from which on [`SATURATED`] is suspect, where the capture lists other values that are no reading.
const SATURATED_SHARE: f64 = 0.01;

/// Value that may stand for "no reading" without the capture saying so, and the share of an image's pixels
/// that hold it. `None` for other images than PNG, and for those that cannot be read.
pub(crate) fn suspect(file: &ImageFile, units: &Units) -> Option<(u16, f64)> {
    if ImageKind::from_path(file.path) != Some(ImageKind::Png) {
        return None;
    }
    // Metres are values.
    let values = read(file, &Units::new(1.0, Some(Vec::new()))).ok()?;
    let share = |value: u16| {
        let same = values.iter().filter(|other| **other == f32::from(value)).count();
        same as f64 / values.len() as f64
    };
    let saturated = share(SATURATED);
    let least = if units.invalid_is_given { SATURATED_SHARE } else { 0.0 };
    // What a capture has said itself needs no word.
    if saturated > least && !(units.invalid_is_given && units.is_invalid(SATURATED)) {
        return Some((SATURATED, saturated));
    }
    let readings = values.iter().map(|value| *value as u16).filter(|value| !units.is_invalid(*value));
    let largest = readings.max().filter(|largest| SENTINELS.contains(largest))?;
    Some((largest, share(largest))).filter(|(_, share)| *share > SUSPECT_SHARE)
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
    match ImageKind::from_path(file.path) {
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
