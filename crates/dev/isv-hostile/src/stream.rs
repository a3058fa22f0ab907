//! Decoding a stream as a player would: at full and at reduced resolution, with details and surfaces.

use crate::sealing::with_checksums;
use isv::raw::decode::{Decoder, Limits, Lod};
use isv::raw::format::{Packet, PacketReader, StreamHeader};
use isv::raw::surface::{SurfaceExtractor, SurfaceOptions};
use isv::raw::volume::SparseVolume;

/// Fewer voxels than a decoder allows by itself, for speed: 8,192 blocks of 8.
pub(crate) const LIMITS: Limits = Limits { frame_voxels: 1 << 22, voxels_per_byte: usize::MAX };
/// Frames of a stream that are decoded.
pub(crate) const FRAMES: usize = 8;
/// Most vertices of a surface.
const VERTICES: usize = 1 << 18;

/// Decodes the first frames of a stream whose checksums are made to fit first.
pub(crate) fn decode(bytes: &[u8]) {
    let bytes = with_checksums(bytes);
    let Some((header, packets)) = open(&bytes) else { return };
    decode_with(Decoder::new(&header, LIMITS), &packets);
    // Other resolutions are other paths. Which one is for the bytes to say, so that each costs one.
    let lod = if bytes.len().is_multiple_of(2) { Lod::Half } else { Lod::Quarter };
    if let Ok(decoder) = Decoder::with_lod(&header, LIMITS, lod) {
        decode_with(decoder, &packets);
    }
}

/// The header of a stream and its first whole packets.
pub(crate) fn open(bytes: &[u8]) -> Option<(StreamHeader, Vec<Packet>)> {
    let mut reader = PacketReader::new(bytes).ok()?;
    let header = *reader.header();
    let packets = std::iter::from_fn(|| reader.next_frame().ok().flatten());
    Some((header, packets.take(FRAMES).collect()))
}

/// Decodes packets, past those that are refused.
fn decode_with(mut decoder: Decoder, packets: &[Packet]) {
    let mut extractor = SurfaceExtractor::new(SurfaceOptions { normals: true });
    for (number, packet) in packets.iter().enumerate() {
        decoder.keep_details(number % 2 == 0);
        if decoder.decode(packet).is_err() {
            assert!(
                decoder.volume().is_none() && decoder.details().is_empty(),
                "a refused frame leaves something"
            );
            continue;
        }
        let volume = decoder.volume().expect("a frame was decoded");
        check(volume);
        let details = decoder.details();
        assert!(details.iter().all(|block| block.bits >= 0.0 && block.coord.in_range()));
        let _ = extractor.extract_within(volume, VERTICES);
    }
}

/// Asserts what holds for every volume.
pub(crate) fn check(volume: &SparseVolume) {
    let limit = volume.grid().truncation.codes();
    assert!(
        volume.samples().all(|sample| (-limit..=limit).contains(&sample)),
        "samples within the truncation"
    );
    assert!(volume.coords().iter().all(|coord| coord.in_range()), "coordinates in range");
    assert!(volume.coords().is_sorted_by(|a, b| a.morton() < b.morton()), "blocks in Morton order");
    let blocks = volume.block_count() as u32;
    assert!(
        volume.unobserved_masks().iter().all(|(block, mask)| *block < blocks && !mask.is_empty()),
        "masks of blocks"
    );
}
