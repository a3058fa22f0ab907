//! PNG, of any depth and colour type, interlaced too; and PNG written.

use super::ImageFault;
use super::pixels::{check_size, image, rgb};
use crate::own::COMMENT;
use isv_foreign::catch_panic;
use isv_volume::{Image, Rgb};
use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Limits, Transformations};
use std::io::{self, Cursor, Write};

/// First bytes of a file.
pub(super) const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

const FORMAT: &str = "PNG";

/// Memory that chunks beside the pixels may take (bytes).
const LIMIT_BYTES: usize = 1 << 26;

pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageFault> {
    catch_panic(|| read_unguarded(bytes))
        .unwrap_or_else(|| Err(ImageFault::damaged(FORMAT, &"its pixels are damaged")))
}

fn read_unguarded(bytes: &[u8]) -> Result<Image, ImageFault> {
    let flaw = |error: png::DecodingError| ImageFault::damaged(FORMAT, &error);
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: LIMIT_BYTES });
    // Palettes and few bits become bytes; 16 bits stay, to be rounded and not cut.
    decoder.set_transformations(Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(flaw)?;
    let size @ [width, height] = [header.width, header.height];
    check_size(width.into(), height.into(), bytes.len())?;
    let mut reader = decoder.read_info().map_err(flaw)?;
    let buffer = reader.output_buffer_size();
    let mut samples = vec![0; buffer.ok_or_else(|| ImageFault::damaged(FORMAT, &"it is too large"))?];
    reader.next_frame(&mut samples).map_err(flaw)?;
    let (colour, depth) = reader.output_color_type();
    if depth == BitDepth::Sixteen {
        round_to_bytes(&mut samples);
    }
    image(FORMAT, size, rgb(&samples, colour.samples()))
}

/// Rounds big-endian samples of 16 bits to bytes, in place.
fn round_to_bytes(samples: &mut Vec<u8>) {
    for at in 0..samples.len() / 2 {
        let wide = u32::from(samples[2 * at]) << 8 | u32::from(samples[2 * at + 1]);
        samples[at] = ((wide + 128) / 257) as u8;
    }
    samples.truncate(samples.len() / 2);
}

/// Writes an image. A comment says who made it, so that it may be overwritten. The same image gives the same bytes.
pub(crate) fn write(out: impl Write, image: &Image) -> io::Result<()> {
    let mut encoder = Encoder::new(out, image.width(), image.height());
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    encoder.add_text_chunk("Comment".to_owned(), COMMENT.to_owned())?;
    let mut writer = encoder.write_header()?;
    let pixels: &[Rgb] = image.pixels();
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(())
}
