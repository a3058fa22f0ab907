//! Images of textures: PNG, JPEG, WebP and KTX2 with Basis Universal, all as 8-bit sRGB.
//!
//! The first bytes tell the format, not the name. Alpha is dropped; 16 bits are rounded to 8; grey and palettes become RGB. Colour
//! profiles and gamma chunks are not looked at.

mod error;
mod jpeg;
mod ktx2;
mod pixels;
mod png;
mod webp;

use crate::regular_file;
pub use error::{ImageError, ImageFault};
use isv_volume::Image;
pub(crate) use png::write as write_png;
use std::path::Path;

/// Largest width and height of an image (pixels).
pub const MAX_IMAGE_SIDE: u32 = 1 << 14;

/// Most pixels of an image: 8192 x 8192. Decoders take up to 12 bytes a pixel while they work.
pub const MAX_IMAGE_PIXELS: u64 = 1 << 26;

/// Most bytes of the file of an image.
pub(crate) const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// Reads an image's file whole, unless it is larger than any image may be.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, ImageFault> {
    let fault = |cause: std::io::Error| ImageFault::File { cause: cause.to_string() };
    let (_, length) = regular_file::open(path).map_err(fault)?;
    if length > MAX_IMAGE_BYTES {
        return Err(ImageFault::File { cause: format!("it has more than {MAX_IMAGE_BYTES} bytes") });
    }
    regular_file::read(path).map_err(fault)
}

/// Decodes an image from the bytes of its file; `name` names it in errors.
///
/// Sizes are checked before anything is decoded: see [`MAX_IMAGE_SIDE`] and [`MAX_IMAGE_PIXELS`]. An image of more than 4 million
/// pixels must also have a byte for every 4096 of them.
///
/// # Errors
/// [`ImageError`], which names the image.
///
/// ```
/// let error = isv_io::decode_image(b"GIF89a", "skin.gif").unwrap_err();
/// assert_eq!(error.to_string(), "image `skin.gif`: not a PNG, JPEG, WebP or KTX2 image");
/// ```
pub fn decode_image(bytes: &[u8], name: &str) -> Result<Image, ImageError> {
    decode(bytes).map_err(|fault| fault.of_image(name))
}

/// Decodes an image whose name is not known yet.
pub(crate) fn decode(bytes: &[u8]) -> Result<Image, ImageFault> {
    match bytes {
        _ if bytes.starts_with(png::MAGIC) => png::read(bytes),
        _ if bytes.starts_with(jpeg::MAGIC) => jpeg::read(bytes),
        _ if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") => webp::read(bytes),
        _ if bytes.starts_with(ktx2::MAGIC) => ktx2::read(bytes),
        _ => Err(ImageFault::Unknown),
    }
}
