//! Depth images as EXR.

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, Vec2,
    WritableImage, f16,
};
use std::io::Cursor;

/// What the crate `exr` can write.
const COMPRESSIONS: [Compression; 8] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
    Compression::PXR24,
    Compression::B44,
    Compression::B44A,
];

/// Images of 8 x 6 pixels with the lossy compression of DreamWorks Animation, which the crate `exr` only reads: channels R, G, B and Y of
/// halves, A, and Z of floats, by OpenEXR (`src/exr/dwa.py`).
pub const DWA: [&[u8]; 2] = [include_bytes!("exr/dwaa.exr"), include_bytes!("exr/dwab.exr")];

/// An image of some channels, in lines and with little compression.
#[must_use]
pub fn image(size: [usize; 2], channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    encoded(size, channels, Encoding::default())
}

/// An image of some channels.
#[must_use]
pub fn encoded(size: [usize; 2], channels: Vec<(&str, FlatSamples)>, encoding: Encoding) -> Vec<u8> {
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let layer =
        Layer::new((size[0], size[1]), LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Depths that differ from pixel to pixel, in lines: from 1 m in steps of 1/16 m, which all types and compressions keep.
#[must_use]
pub fn steps(pixels: usize) -> Vec<f32> {
    (0..pixels).map(|i| 1.0 + (i % 16) as f32 / 16.0).collect()
}

/// [`steps`] of a size as floats and as halves, with each compression in lines and in tiles, and a float among other channels; by what
/// they are.
#[must_use]
pub fn all_kinds(size: [usize; 2]) -> Vec<(String, Vec<u8>)> {
    let depths = steps(size[0] * size[1]);
    let floats = || FlatSamples::F32(depths.clone());
    let halves = || FlatSamples::F16(depths.iter().copied().map(f16::from_f32).collect());
    let mut files = Vec::new();
    for compression in COMPRESSIONS {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(5, 4))] {
            let encoding = Encoding { compression, blocks, ..Encoding::UNCOMPRESSED };
            let whole = FlatSamples::U32((0..size[0] * size[1]).map(|i| i as u32).collect());
            for (channels, name) in [
                (vec![("Z", floats())], "floats"),
                (vec![("Z", halves())], "halves"),
                (vec![("A", halves()), ("object", whole), ("view.Z", floats())], "several channels"),
            ] {
                let name = format!("{name}, {compression}, {blocks:?}");
                files.push((name, encoded(size, channels, encoding)));
            }
        }
    }
    files
}
