//! Colour parts of any bytes, on the surfaces of a small ball that moves.

use isv::raw::decode::colour::frame::SAMPLE_RANGE;
use isv::raw::decode::colour::{ColourDecoder, ColourError, ColourFrame, surface_colours};
use isv::raw::format::ColourPayload;
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use isv_testkit::small_ball;

/// Frames of a stream that are decoded.
const FRAMES: usize = 4;

/// Decodes parts one after the other. The first byte says how many layers they have; two bytes before each part say how long it is.
pub(crate) fn decode(bytes: &[u8]) {
    let [first, rest @ ..] = bytes else { return };
    let layers = 1 + first % 3;
    let mut decoder = ColourDecoder::new(layers);
    if first & 0x80 == 0 {
        decoder.begin_group();
    }
    for (frame, part) in parts(rest).into_iter().enumerate() {
        let volume = small_ball(grid(), frame as f64);
        decode_part(&mut decoder, &volume, part, layers);
        if part.is_empty() {
            // Frames without a part are among the others.
            let carried = decoder.carry_over(&volume).expect("a small ball has few samples");
            carried.iter().for_each(|frame| check(frame));
        }
    }
}

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.02).expect("in range"),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(2).expect("in range"),
    }
}

fn parts(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    while let ([low, high, rest @ ..], true) = (bytes, parts.len() < FRAMES) {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(rest.len());
        let (part, after) = rest.split_at(length);
        parts.push(part);
        bytes = after;
    }
    parts
}

/// Decodes a part, and again with the hash of what it decoded to.
fn decode_part(decoder: &mut ColourDecoder, volume: &SparseVolume, part: &[u8], layers: u8) {
    // No hash that bytes state by chance is right.
    let unhashed = ColourPayload::parse(part, 0, layers).map(|mut payload| {
        payload.header.hash = None;
        payload.to_bytes()
    });
    let part = unhashed.as_deref().unwrap_or(part);
    let before = decoder.clone();
    let Ok(decoded) = decoder.decode(volume, part, 0, true) else {
        assert!(!decoder.is_exact(), "what is refused leaves nothing exact");
        return;
    };
    check(decoded);
    let hash = decoded.hash();
    let mut payload = ColourPayload::parse(part, 0, layers).expect("it was decoded");
    for (stated, is_right) in [(hash, true), (!hash, false)] {
        payload.header.hash = Some(stated);
        let again = before.clone().decode(volume, &payload.to_bytes(), 0, true).map(|frame| frame.hash());
        match again {
            Ok(found) => assert!(found == hash && (is_right || !decoder.is_exact())),
            Err(ColourError::HashMismatch { found, .. }) => assert!(found == hash && !is_right),
            Err(error) => panic!("a hash makes it {error}"),
        }
    }
}

/// Asserts what holds for every frame: each part that the surface crosses has a sample in range, and no other has one.
fn check(frame: &ColourFrame) {
    for (block, depth) in frame.shape.depths().iter().enumerate() {
        let samples = &frame.layers[usize::from(*depth)][frame.shape.block_samples(block, *depth)];
        for (number, samples) in samples.chunks(1 << (3 * depth)).enumerate() {
            let leaves = frame.shape.leaves(block, number);
            for (part, sample) in samples.iter().enumerate() {
                assert_eq!(
                    sample[3],
                    (leaves >> part & 1) as i16,
                    "block {block}, cell {number}, part {part}"
                );
                for (value, (low, high)) in sample.iter().zip(SAMPLE_RANGE) {
                    assert!((low..=high).contains(&i32::from(*value)), "{sample:?}");
                }
            }
        }
    }
    let far =
        surface_colours(frame, &grid(), &[[0.0, 0.0, 0.104], [0.05, -0.04, 0.08], [1e9, 0.0, f64::NAN]]);
    assert_eq!(far[2], [128; 3], "nothing is there");
}
