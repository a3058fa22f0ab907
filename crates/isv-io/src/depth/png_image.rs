//! Depths in 16-bit grey PNG.

use super::error::DepthFileError;
use super::image::{ImageFile, Units};
use std::io::{BufRead, Seek};

pub(crate) fn read(
    bytes: impl BufRead + Seek,
    length: u64,
    file: &ImageFile,
    units: &Units,
) -> Result<Vec<f32>, DepthFileError> {
    let flaw = |error| file.flaw(in_words(&error));
    let mut decoder = png::Decoder::new(bytes);
    let header = decoder.read_header_info().map_err(flaw)?;
    file.check_size([header.width, header.height].map(u64::from), length)?;
    if (header.color_type, header.bit_depth) != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
        let (colour, bits) = (header.color_type, header.bit_depth as u8);
        return Err(file.flaw(format!("{colour:?} of {bits} bits; depths must be grey of 16 bits")));
    }
    let mut reader = decoder.read_info().map_err(flaw)?;
    let size = reader.output_buffer_size().ok_or_else(|| file.flaw("too large"))?;
    let mut samples = vec![0; size];
    reader.next_frame(&mut samples).map_err(flaw)?;
    let depth = |sample: &[u8]| {
        let value = u16::from_be_bytes([sample[0], sample[1]]);
        let metres = (f64::from(value) * units.depth_scale_m) as f32;
        if units.invalid.contains(&value) { 0.0 } else { metres }
    };
    Ok(samples.chunks_exact(2).map(depth).collect())
}

/// What is wrong with an image, without the decoder's inner words.
fn in_words(error: &png::DecodingError) -> &'static str {
    match error {
        png::DecodingError::IoError(cause) if cause.kind() == std::io::ErrorKind::UnexpectedEof => {
            "the PNG image is cut off"
        }
        png::DecodingError::IoError(_) => "the PNG image cannot be read",
        _ => "not a PNG image, or a damaged one",
    }
}
