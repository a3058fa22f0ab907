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
        if units.is_invalid(value) { 0.0 } else { metres }
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;
    use std::path::Path;

    #[test]
    fn only_invalid_values_are_no_reading() {
        let samples: Vec<u16> = (0..=u16::MAX).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 256, 256);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let data: Vec<u8> = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect();
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        let file = ImageFile { path: Path::new("0.png"), frame: 0, size: [256, 256] };
        for invalid in [vec![], vec![0], (0..=u16::MAX).step_by(3).collect()] {
            let units = Units { depth_scale_m: 0.5, invalid, invalid_is_given: true };
            let depths = read(Cursor::new(&bytes), bytes.len() as u64, &file, &units).unwrap();
            for (sample, depth) in samples.iter().zip(depths) {
                let expected = if units.invalid.contains(sample) { 0.0 } else { f32::from(*sample) / 2.0 };
                assert_eq!(depth, expected, "sample {sample}");
            }
        }
    }
}
