//! Images of textures, as other programs write them. All that are not grey show the same gradient of 16 x 16
//! pixels. `make.py` beside the files has made those that no crate of ours writes.

use png::{BitDepth, ColorType, Compression, Encoder};

/// Pixels of a side.
pub const SIDE: u32 = 16;

/// JPEG, baseline.
pub const JPEG: &[u8] = include_bytes!("image/rgb.jpg");
/// JPEG, progressive.
pub const PROGRESSIVE_JPEG: &[u8] = include_bytes!("image/progressive.jpg");
/// JPEG, grey.
pub const GREY_JPEG: &[u8] = include_bytes!("image/grey.jpg");
/// JPEG, CMYK as Photoshop has it.
pub const CMYK_JPEG: &[u8] = include_bytes!("image/cmyk.jpg");
/// WebP, lossy.
pub const LOSSY_WEBP: &[u8] = include_bytes!("image/lossy.webp");
/// WebP, lossless.
pub const LOSSLESS_WEBP: &[u8] = include_bytes!("image/lossless.webp");
/// WebP, lossy with alpha.
pub const ALPHA_WEBP: &[u8] = include_bytes!("image/alpha.webp");
/// KTX2 with ETC1S.
pub const ETC1S_KTX2: &[u8] = include_bytes!("image/etc1s.ktx2");
/// KTX2 with UASTC in levels, compressed by Zstandard.
pub const UASTC_KTX2: &[u8] = include_bytes!("image/uastc.ktx2");
/// KTX2 with ASTC, which textures of glTF may not have.
pub const ASTC_KTX2: &[u8] = include_bytes!("image/astc.ktx2");

/// The pixel of the gradient at a column and a row.
#[must_use]
pub fn gradient(column: u32, row: u32) -> [u8; 3] {
    [(16 * column + 8) as u8, (16 * row + 8) as u8, 128]
}

/// All files that show the gradient, with the largest error of a channel, by their names.
#[must_use]
pub fn gradients() -> Vec<(&'static str, Vec<u8>, u8)> {
    let mut files = vec![
        ("rgb.jpg", JPEG.to_vec(), 6),
        ("progressive.jpg", PROGRESSIVE_JPEG.to_vec(), 6),
        ("cmyk.jpg", CMYK_JPEG.to_vec(), 12),
        ("lossy.webp", LOSSY_WEBP.to_vec(), 16),
        ("lossless.webp", LOSSLESS_WEBP.to_vec(), 0),
        ("alpha.webp", ALPHA_WEBP.to_vec(), 20),
        ("etc1s.ktx2", ETC1S_KTX2.to_vec(), 48),
        ("uastc.ktx2", UASTC_KTX2.to_vec(), 8),
    ];
    let pixels: Vec<[u8; 3]> =
        (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| gradient(column, row))).collect();
    let with = |more: &[u8]| pixels.iter().flat_map(|pixel| [&pixel[..], more].concat()).collect::<Vec<u8>>();
    let wide: Vec<u8> = pixels.as_flattened().iter().flat_map(|value| [*value; 2]).collect();
    files.extend([
        ("rgb.png", png(SIDE, ColorType::Rgb, BitDepth::Eight, &with(&[])), 0),
        ("rgba.png", png(SIDE, ColorType::Rgba, BitDepth::Eight, &with(&[7])), 0),
        ("wide.png", png(SIDE, ColorType::Rgb, BitDepth::Sixteen, &wide), 0),
    ]);
    files
}

/// A PNG image of samples as they stand in the file, row after row.
#[must_use]
pub fn png(columns: u32, colour: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
    let bits = colour.samples() * depth as usize * columns as usize;
    let rows = samples.len() / bits.div_ceil(8);
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, rows as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::High);
    if colour == ColorType::Indexed {
        encoder.set_palette(vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 8, 7]);
    }
    encoder.write_header().unwrap().write_image_data(samples).unwrap();
    bytes
}

/// The header of a PNG image of a size, and nothing behind it.
#[must_use]
pub fn png_of_size(width: u32, height: u32) -> Vec<u8> {
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, data) in [(b"IHDR", header), (b"IDAT", vec![0; 8]), (b"IEND", Vec::new())] {
        let named = [name, &data[..]].concat();
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend(&named);
        bytes.extend(crc32fast::hash(&named).to_be_bytes());
    }
    bytes
}

/// Four pixels as PNG: red, green, blue and white, row by row.
#[must_use]
pub fn four_colours() -> Vec<u8> {
    let samples = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    png(2, ColorType::Rgb, BitDepth::Eight, &samples)
}
