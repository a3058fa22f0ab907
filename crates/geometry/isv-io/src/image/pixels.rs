//! Sizes of images, and pixels from the rows of decoders.

use super::{ImageFault, MAX_IMAGE_PIXELS, MAX_IMAGE_SIDE};
use isv_volume::{Image, Rgb};

/// Pixels that a file of any size may hold.
const LEAST_PIXELS: u64 = 1 << 22;

/// Most pixels to a byte of a larger image. Formats hold an even colour in any number of pixels; textures take several bits a pixel.
const MOST_PIXELS_A_BYTE: u64 = 4096;

/// Refuses the sizes of images that are not decoded, given the bytes of the file.
pub(super) fn check_size(width: u64, height: u64, bytes: usize) -> Result<(), ImageFault> {
    let largest = u64::from(MAX_IMAGE_SIDE);
    if width == 0 || height == 0 || width > largest || height > largest || width * height > MAX_IMAGE_PIXELS {
        return Err(ImageFault::Size { width, height });
    }
    let bytes = bytes as u64;
    if width * height > LEAST_PIXELS.max(bytes.saturating_mul(MOST_PIXELS_A_BYTE)) {
        return Err(ImageFault::Dense { bytes, width, height });
    }
    Ok(())
}

/// Pixels of samples, `channels` a pixel; one or two channels are grey, and the second or fourth is alpha, which is dropped.
pub(super) fn rgb(samples: &[u8], channels: usize) -> Vec<Rgb> {
    let pixel = |samples: &[u8]| match samples {
        [grey] | [grey, _] => [*grey; 3],
        samples => [samples[0], samples[1], samples[2]],
    };
    samples.chunks_exact(channels).map(pixel).collect()
}

/// An image of pixels that a decoder gave, whose count it may have got wrong.
pub(super) fn image(
    format: &'static str,
    [width, height]: [u32; 2],
    pixels: Vec<Rgb>,
) -> Result<Image, ImageFault> {
    Image::new(width, height, pixels).ok_or_else(|| ImageFault::damaged(format, &"it has too few pixels"))
}
