//! Depths in EXR.

use super::error::DepthFileError;
use super::image::ImageFile;
use exr::block::chunk::{
    Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::block::reader::ChunksReader;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::compression::Compression;
use exr::meta::attribute::{ChannelList, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use isv_foreign::catch_panic;
use std::io::{Read, Seek};

/// Most channels that an image may have: a block of it holds a few hundred rows of each.
const MOST_CHANNELS: usize = 64;

/// Most pixels of a tile that is larger than its image. Memory is taken for as much of it as the file says
/// that there is.
const MOST_TILE_PIXELS: usize = 1 << 20;

/// Depths from here on are no reading, in metres. It is the largest number of a half, which renderers write
/// for the background, as they write 1e10 where there is room.
const FARTHEST_M: f32 = 65_504.0;

/// The depth channel, in metres.
pub(crate) fn read(
    bytes: impl Read + Seek,
    length: u64,
    file: &ImageFile,
) -> Result<Vec<f32>, DepthFileError> {
    // Compressed pixels lead to numbers that `exr` does not check.
    let read = catch_panic(|| read_unguarded(bytes, length, file));
    read.unwrap_or_else(|| Err(file.flaw("not a readable EXR image: its pixels are damaged")))
}

fn read_unguarded(
    bytes: impl Read + Seek,
    length: u64,
    file: &ImageFile,
) -> Result<Vec<f32>, DepthFileError> {
    let reader = exr::block::read(bytes, false).map_err(|why| file.flaw(why))?;
    for header in reader.headers() {
        file.check_size([header.layer_size.width() as u64, header.layer_size.height() as u64], length)?;
        if header.channels.list.len() > MOST_CHANNELS {
            return Err(file.flaw(format!("more than {MOST_CHANNELS} channels")));
        }
        if let BlockDescription::Tiles(tiles) = header.blocks {
            let exr::math::Vec2(columns, rows) = tiles.tile_size;
            if columns.saturating_mul(rows) > MOST_TILE_PIXELS.max(header.layer_size.area()) {
                return Err(file.flaw(format!("tiles of {columns} x {rows} pixels")));
            }
        }
    }
    let (layer, channel) = depth_channel(reader.headers())
        .ok_or_else(|| file.flaw("no channel of depths: none is called Z, R, Y, depth or D"))?;
    let channels = reader.headers()[layer].channels.clone();
    let of_layer = |_: &MetaData, _: TileCoordinates, block: BlockIndex| {
        block.layer == layer && block.level == exr::math::Vec2(0, 0)
    };
    let chunks = reader.filter_chunks(false, of_layer).map_err(|why| file.flaw(why))?;
    let meta = chunks.meta_data().clone();
    let mut depths = vec![0.0; file.size[0] as usize * file.size[1] as usize];
    for chunk in chunks {
        let chunk = chunk.map_err(|why| file.flaw(why))?;
        if !claims_what_it_holds(&chunk, &meta.headers[layer]) {
            return Err(file.flaw("a block claims more than its pixels"));
        }
        let block = UncompressedBlock::decompress_chunk(chunk, &meta, false);
        let block = block.map_err(|why| file.flaw(why))?;
        copy_block(&block, &channels, channel, file, &mut depths)?;
    }
    for depth in depths.iter_mut().filter(|depth| **depth >= FARTHEST_M) {
        *depth = 0.0;
    }
    Ok(depths)
}

/// Whether what the counters of a chunk of DWAA or DWAB claim can be of its pixels; `exr` takes memory for it, whatever it is. Chunks
/// of other compressions claim nothing.
fn claims_what_it_holds(chunk: &Chunk, header: &Header) -> bool {
    let (Compression::DWAA(_) | Compression::DWAB(_)) = header.compression else { return true };
    let (CompressedBlock::ScanLine(CompressedScanLineBlock { compressed_pixels_le: bytes, .. })
    | CompressedBlock::Tile(CompressedTileBlock { compressed_pixels_le: bytes, .. })) =
        &chunk.compressed_block
    else {
        return true;
    };
    // What would not become smaller is there as it is.
    let place = header
        .get_block_data_indices(&chunk.compressed_block)
        .and_then(|indices| header.get_absolute_block_pixel_coordinates(indices));
    if place.is_ok_and(|place| bytes.len() == place.size.area() * header.channels.bytes_per_pixel) {
        return true;
    }
    // Samples in blocks of 8 x 8, of 4 bytes; run lengths may double them.
    let exr::math::Vec2(columns, rows) = header.max_block_pixel_size();
    let samples = columns.next_multiple_of(8).saturating_mul(rows.next_multiple_of(8));
    let most = samples.saturating_mul(8 * header.channels.list.len()) as u64;
    // Eleven counters: sizes and counts of what is unpacked are these.
    let counters = bytes.as_chunks::<8>().0;
    [1, 6, 7, 8, 9]
        .iter()
        .filter_map(|at| counters.get(*at))
        .all(|counter| u64::from_le_bytes(*counter) <= most)
}

/// Layer and channel of the depths. An image with one channel needs no name for it.
fn depth_channel(headers: &[Header]) -> Option<(usize, usize)> {
    let flat = headers.iter().enumerate().filter(|(_, header)| !header.deep);
    let ranked = flat.flat_map(|(layer, header)| {
        let names: Vec<String> =
            header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
        let ranks: Vec<_> =
            (0..names.len()).filter_map(|at| Some((rank(&names, at)?, (layer, at)))).collect();
        ranks
    });
    ranked.min().map(|(_, place)| place)
}

/// How likely a channel of a layer holds depths, 0 the likeliest, by its name and those beside it; `None` if it holds none. What
/// stands before the last dot of a name is a group.
fn rank(names: &[String], at: usize) -> Option<u32> {
    let name = &names[at];
    let (group, last) = name.rsplit_once('.').unwrap_or(("", name));
    // X, Y and Z of a group are a vector, such as a normal.
    let is_of_vector = || names.iter().any(|other| *other == format!("{group}.X"));
    let is_depth_group = || group.rsplit('.').next().is_some_and(|word| word.eq_ignore_ascii_case("depth"));
    match last {
        "Z" if group.is_empty() => Some(0),
        "Z" if !is_of_vector() => Some(1),
        "depth" | "Depth" | "D" => Some(2),
        "V" if is_depth_group() => Some(3),
        "R" => Some(4),
        "Y" if !is_of_vector() => Some(5),
        _ if names.len() == 1 => Some(6),
        _ => None,
    }
}

/// Copies the rows of one channel out of a block.
fn copy_block(
    block: &UncompressedBlock,
    channels: &ChannelList,
    channel: usize,
    file: &ImageFile,
    depths: &mut [f32],
) -> Result<(), DepthFileError> {
    for line in block.lines(channels).filter(|line| line.location.channel == channel) {
        let exr::math::Vec2(column, row) = line.location.position;
        let end = column.saturating_add(line.location.sample_count);
        if end > file.size[0] as usize || row >= file.size[1] as usize {
            return Err(file.flaw("a block lies outside the image"));
        }
        let row = &mut depths[row * file.size[0] as usize..][column..end];
        let read = match channels.list[channel].sample_type {
            SampleType::F32 => line.read_samples_into_slice(row),
            SampleType::F16 => {
                line.read_samples::<exr::prelude::f16>().zip(row).try_for_each(|(value, to)| {
                    *to = value?.to_f32();
                    Ok(())
                })
            }
            SampleType::U32 => return Err(file.flaw("depths as whole numbers; EXR must hold metres")),
        };
        read.map_err(|why| file.flaw(why))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_told_from_normals_and_colours() {
        let chosen = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            (0..names.len())
                .filter_map(|at| Some((rank(&names, at)?, names[at].clone())))
                .min()
                .map(|(_, name)| name)
        };
        for (names, depth) in [
            (&["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z"][..], "Z"),
            (&["Depth.V", "Image.A", "Image.B", "Image.G", "Image.R"], "Depth.V"),
            (&["B", "G", "R", "depth"], "depth"),
            (
                &["ViewLayer.Combined.R", "ViewLayer.Depth.Z", "ViewLayer.Normal.X", "ViewLayer.Normal.Z"],
                "ViewLayer.Depth.Z",
            ),
            (&["A", "B", "G", "R"], "R"),
            (&["Y"], "Y"),
            (&["distance"], "distance"),
        ] {
            assert_eq!(chosen(names).as_deref(), Some(depth), "{names:?}");
        }
        assert_eq!(chosen(&["N.X", "N.Y", "N.Z"]), None);
    }
}
