//! JPEG, baseline and progressive: grey, YCbCr, RGB, CMYK and YCCK.

use super::ImageFault;
use super::pixels::{check_size, image, rgb};
use isv_foreign::catch_panic;
use isv_volume::Image;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// First bytes of a file.
pub(super) const MAGIC: &[u8] = b"\xff\xd8\xff";

const FORMAT: &str = "JPEG";

/// Most scans of a progressive image. Encoders write about ten.
const MOST_SCANS: usize = 64;

pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageFault> {
    catch_panic(|| read_unguarded(bytes))
        .unwrap_or_else(|| Err(ImageFault::damaged(FORMAT, &"its pixels are damaged")))
}

fn read_unguarded(bytes: &[u8]) -> Result<Image, ImageFault> {
    let flaw = |error| ImageFault::damaged(FORMAT, &error);
    // A cut image is an error, not grey where its pixels are missing.
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        // Sizes are checked here.
        .set_max_width(usize::MAX)
        .set_max_height(usize::MAX)
        .jpeg_set_max_scans(MOST_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(flaw)?;
    let header = decoder.info().ok_or_else(|| ImageFault::damaged(FORMAT, &"it has no header"))?;
    let size @ [width, height] = [header.width, header.height].map(u32::from);
    check_size(width.into(), height.into(), bytes.len())?;
    let samples = decoder.decode().map_err(flaw)?;
    let channels = decoder.output_colorspace().map_or(3, |space| space.num_components());
    if !(1..=4).contains(&channels) {
        return Err(ImageFault::damaged(FORMAT, &format!("its pixels have {channels} channels")));
    }
    image(FORMAT, size, rgb(&samples, channels))
}
