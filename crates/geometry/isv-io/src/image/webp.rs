//! WebP, lossy and lossless. An animated one gives its first picture.

use super::ImageFault;
use super::pixels::{check_size, image, rgb};
use image_webp::WebPDecoder;
use isv_foreign::catch_panic;
use isv_volume::Image;
use std::io::Cursor;

const FORMAT: &str = "WebP";

/// Bytes of the container before its chunks, and of a chunk before its data.
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// Memory that chunks beside the pixels may take (bytes).
const LIMIT_BYTES: usize = 1 << 26;

pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageFault> {
    catch_panic(|| read_unguarded(bytes))
        .unwrap_or_else(|| Err(ImageFault::damaged(FORMAT, &"its pixels are damaged")))
}

fn read_unguarded(bytes: &[u8]) -> Result<Image, ImageFault> {
    let flaw = |error| ImageFault::damaged(FORMAT, &error);
    for [width, height] in lossy_sizes(bytes.get(HEADER_BYTES..).unwrap_or_default()) {
        check_size(width, height, bytes.len())?;
    }
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(flaw)?;
    decoder.set_memory_limit(LIMIT_BYTES);
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), bytes.len())?;
    let buffer = decoder.output_buffer_size();
    let mut samples = vec![0; buffer.ok_or_else(|| ImageFault::damaged(FORMAT, &"it is too large"))?];
    decoder.read_image(&mut samples).map_err(flaw)?;
    image(FORMAT, [width, height], rgb(&samples, if decoder.has_alpha() { 4 } else { 3 }))
}

/// Sizes that lossy chunks state themselves, for which the decoder takes memory before it compares them with the container's.
fn lossy_sizes(mut chunks: &[u8]) -> Vec<[u64; 2]> {
    /// Bytes of a frame's chunk before the chunks of its picture.
    const FRAME_BYTES: usize = 16;
    let mut sizes = Vec::new();
    while let Some((header, rest)) = chunks.split_first_chunk::<CHUNK_HEADER_BYTES>() {
        let [kind @ .., a, b, c, d] = *header;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        let data = &rest[..length.min(rest.len())];
        if &kind == b"VP8 " {
            let side = |at: usize| {
                let bytes = data.get(at..)?.first_chunk()?;
                Some(u64::from(u16::from_le_bytes(*bytes) & 0x3fff))
            };
            // A tag of 3 bytes and a start code of 3 come first.
            sizes.extend(side(6).zip(side(8)).map(|(width, height)| [width, height]));
        }
        // A frame of an animation has its picture inside.
        let skipped = if &kind == b"ANMF" { FRAME_BYTES } else { length.saturating_add(length % 2) };
        chunks = rest.get(skipped..).unwrap_or_default();
    }
    sizes
}
