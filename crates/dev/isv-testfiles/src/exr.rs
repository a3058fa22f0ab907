//! Depth images as EXR, written by the crate `exr` and by OpenEXR.

use exr::image::write::samples::WritableSamples;
use exr::math::RoundingMode;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes, Layer,
    LayerAttributes, Levels, Vec2, WritableImage, f16,
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

/// Images of 8 x 6 pixels with the lossy compression of DreamWorks Animation, which the crate `exr` only
/// reads. They have channels R, G, B and Y of halves, A, and Z of floats, by OpenEXR (`src/exr/dwa.py`).
pub const DWA: [&[u8]; 2] = [include_bytes!("exr/dwaa.exr"), include_bytes!("exr/dwab.exr")];

/// An image of some channels, in lines and with little compression.
#[must_use]
pub fn image(size: [usize; 2], channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    encoded(size, channels, Encoding::default())
}

/// An image of some channels.
#[must_use]
pub fn encoded(size: [usize; 2], channels: Vec<(&str, FlatSamples)>, encoding: Encoding) -> Vec<u8> {
    of_layers(vec![layer(size, channels, encoding)])
}

/// [`steps`] of a size in tiles, with the smaller images of a mipmap after the whole one.
fn with_smaller_images(size: [usize; 2]) -> Vec<u8> {
    let mut sizes = vec![size];
    while let Some(last) = sizes.last().filter(|last| **last != [1, 1]) {
        sizes.push(last.map(|edge| (edge / 2).max(1)));
    }
    let level_data = sizes.into_iter().map(|[columns, rows]| floats(&steps(columns * rows))).collect();
    let levels = Levels::Mip { rounding_mode: RoundingMode::Down, level_data };
    let encoding = Encoding { blocks: Blocks::Tiles(Vec2(4, 4)), ..Encoding::UNCOMPRESSED };
    of_layers(vec![layer(size, vec![("Z", levels)], encoding)])
}

/// [`steps`] of a size as the second of two layers.
fn with_another_layer(size: [usize; 2]) -> Vec<u8> {
    let depths = steps(size[0] * size[1]);
    let layers = [("B", vec![0.5; depths.len()]), ("Z", depths)].map(|(name, depths)| Layer {
        attributes: LayerAttributes::named(name),
        ..layer(size, vec![(name, floats(&depths))], Encoding::default())
    });
    of_layers(layers.to_vec())
}

fn layer<Samples>(
    size: [usize; 2],
    channels: Vec<(&str, Samples)>,
    encoding: Encoding,
) -> Layer<AnyChannels<Samples>>
where
    Samples: for<'a> WritableSamples<'a>,
{
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    Layer::new((size[0], size[1]), LayerAttributes::default(), encoding, AnyChannels::sort(channels))
}

fn of_layers<Samples>(layers: Vec<Layer<AnyChannels<Samples>>>) -> Vec<u8>
where
    Samples: for<'a> WritableSamples<'a>,
{
    let attributes = ImageAttributes::new(layers[0].absolute_bounds());
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layers(attributes, layers);
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Depths that differ from pixel to pixel, in lines: from 1 m in steps of 1/16 m, which all types and compressions keep.
#[must_use]
pub fn steps(pixels: usize) -> Vec<f32> {
    (0..pixels).map(|i| 1.0 + (i % 16) as f32 / 16.0).collect()
}

/// Samples of a channel in single precision.
#[must_use]
pub fn floats(depths: &[f32]) -> FlatSamples {
    FlatSamples::F32(depths.to_vec())
}

/// [`steps`] of a size as floats and as halves, with each compression in lines and in tiles. Then a float
/// among other channels, and among other layers and levels. By what they are.
#[must_use]
pub fn all_kinds(size: [usize; 2]) -> Vec<(String, Vec<u8>)> {
    let depths = steps(size[0] * size[1]);

    let halves = || FlatSamples::F16(depths.iter().copied().map(f16::from_f32).collect());
    let mut files = Vec::new();
    for compression in COMPRESSIONS {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(5, 4))] {
            let encoding = Encoding { compression, blocks, ..Encoding::UNCOMPRESSED };
            let whole = FlatSamples::U32((0..size[0] * size[1]).map(|i| i as u32).collect());
            for (channels, name) in [
                (vec![("Z", floats(&depths))], "floats"),
                (vec![("Z", halves())], "halves"),
                (vec![("A", halves()), ("object", whole), ("view.Z", floats(&depths))], "several channels"),
            ] {
                let name = format!("{name}, {compression}, {blocks:?}");
                files.push((name, encoded(size, channels, encoding)));
            }
        }
    }
    files.push(("with smaller images".to_owned(), with_smaller_images(size)));
    files.push(("with another layer".to_owned(), with_another_layer(size)));
    files
}
