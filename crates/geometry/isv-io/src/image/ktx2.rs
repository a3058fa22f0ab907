//! KTX2 (Khronos, version 2.0) with Basis Universal in it, ETC1S or UASTC: what `KHR_texture_basisu` allows. Level 0 is read.

use super::ImageFault;
use super::pixels::{check_size, image, rgb};
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use isv_foreign::catch_panic;
use isv_volume::Image;

/// First bytes of a file.
pub(super) const MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

const FORMAT: &str = "KTX2";

/// Places of header fields (bytes).
const WIDTH: usize = 20;
const HEIGHT: usize = 24;
const DEPTH: usize = 28;
const LAYERS: usize = 32;
const FACES: usize = 36;
/// Length of level 0 when it is decompressed, in the level index.
const LEVEL_BYTES: usize = 80 + 16;

pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageFault> {
    let damaged = |why: &str| ImageFault::damaged(FORMAT, &why);
    let word = |at: usize| bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word));
    let field = |at: usize| word(at).ok_or_else(|| damaged("its header is cut"));
    let size @ [width, height] = [field(WIDTH)?, field(HEIGHT)?];
    check_size(width.into(), height.into(), bytes.len())?;
    if field(DEPTH)? > 0 || field(LAYERS)? > 1 || field(FACES)? != 1 {
        return Err(ImageFault::Variant { variant: "a KTX2 file of several images" });
    }
    // Memory is taken for the length that the file states. A block of 4 x 4 pixels has at most 16 bytes.
    let stated = u64::from(field(LEVEL_BYTES)?) | u64::from(field(LEVEL_BYTES + 4)?) << 32;
    if stated > 16 * u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4)) {
        return Err(damaged("its level is longer than its pixels"));
    }
    let pixels = catch_panic(|| {
        let transcoder = Transcoder::new(bytes).map_err(|_| {
            // The library does not tell damage from formats of GPUs, which a KTX2 file may hold as well.
            damaged("it is damaged, or holds no Basis Universal")
        })?;
        if !matches!(transcoder.source_format(), SourceFormat::Etc1s | SourceFormat::UastcLdr) {
            return Err(ImageFault::Variant { variant: "KTX2 that is neither ETC1S nor UASTC" });
        }
        transcoder
            .transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
            .map_err(|_| damaged("its pixels are damaged"))
    });
    let samples = pixels.unwrap_or_else(|| Err(damaged("its pixels are damaged")))?;
    image(FORMAT, size, rgb(&samples, 4))
}
