//! Profile `main`: cut, damaged and forged streams give whole frames or a typed error, never a panic, a hang or a false frame.

mod support;

use isv_decode::{DecodeError, Decoder, Limits};
use isv_encode::{Band, EncoderSettings, MainSettings};
use isv_entropy::{BitModel, IntegerModel, RangeEncoder};
use isv_format::{
    FrameCoding, FrameHeader, FrameKind, FramePayload, MainFrameHeader, MaskCoding, Packet, PacketKind,
    Profile, SlicePayload, StreamHeader,
};
use isv_testkit::Random;
use isv_volume::{SparseVolume, VolumeBuilder};
use std::sync::OnceLock;
use support::{ball, decode, encode, forged, main_header, packets};

const LIMITS: Limits = Limits { frame_voxels: 1 << 20, voxels_per_byte: usize::MAX };

/// Four frames of the ball with its hole in two GOPs and two slices.
fn stream() -> &'static [u8] {
    static STREAM: OnceLock<Vec<u8>> = OnceLock::new();
    STREAM.get_or_init(|| {
        let header = main_header(4);
        let volumes: Vec<_> = (0..4).map(|t| ball(header.grid, f64::from(t))).collect();
        let settings = EncoderSettings { gop: 2, checksums: true, slices: Some(2), ..Default::default() };
        encode(&header, settings, &volumes).0
    })
}

/// A decoder that waits for a frame of the stream.
fn decoder_before(packets: &[Packet], frame: usize) -> Decoder {
    let mut decoder = Decoder::new(&main_header(4), LIMITS);
    for packet in &packets[frame / 2 * 2..frame] {
        decoder.decode(packet).unwrap();
    }
    decoder
}

/// What a decoder says to the payload of a frame after a change.
fn decode_changed<'a>(
    packets: &'a [Packet],
    frame: usize,
    change: impl FnOnce(&mut FramePayload<'a>),
) -> Result<SparseVolume, DecodeError> {
    let mut payload = FramePayload::parse(&packets[frame].payload, 0, true, &Profile::Main).unwrap();
    change(&mut payload);
    let mut decoder = decoder_before(packets, frame);
    let packet = forged(&packets[frame], payload.to_bytes());
    decoder.decode(&packet).map(|frame| frame.volume.clone())
}

fn assert_malformed(result: Result<SparseVolume, DecodeError>, wanted: &str) {
    match result {
        Err(DecodeError::Malformed { what, .. }) => assert_eq!(what, wanted),
        other => panic!("{other:?} instead of {wanted:?}"),
    }
}

#[test]
fn every_prefix_of_a_stream_yields_whole_frames() {
    let bytes = stream();
    let whole = decode(bytes).0;
    let ends: Vec<usize> = packets(bytes).iter().map(|p| p.at as usize + 24 + p.payload.len()).collect();
    for length in 0..bytes.len() {
        // Only where another frame fits the number of frames changes; decoding is what takes long.
        let fit = ends.iter().filter(|end| **end <= length).count();
        if length < 60 || ends.iter().any(|end| length.abs_diff(*end) < 30) || length % 97 == 0 {
            let (frames, _) = decode(&bytes[..length]);
            assert!(frames == whole[..fit], "{length} bytes");
        }
    }
}

/// Bytes that say at random which cells are drawn give a frame that differs in its masks alone, or are refused.
#[test]
fn random_cells_are_masks_or_refused() {
    let header = main_header(4).with_mask_coding(MaskCoding::Cells);
    let volumes: Vec<_> = (0..2).map(|t| ball(header.grid, f64::from(t))).collect();
    let packets = packets(&encode(&header, EncoderSettings::default(), &volumes).0);
    let mut whole = Decoder::new(&header, LIMITS);
    let whole: Vec<_> = packets.iter().map(|packet| whole.decode(packet).unwrap().volume.clone()).collect();
    let mut random = Random::new(5);
    let (mut decoded, mut refused) = (0, 0);
    for attempt in 0..400 {
        let frame = attempt % 2;
        let mut decoder = Decoder::new(&header, LIMITS);
        for packet in &packets[..frame] {
            decoder.decode(packet).unwrap();
        }
        let mut payload = FramePayload::parse(&packets[frame].payload, 0, false, &Profile::Main).unwrap();
        let mut masks: Vec<u8> =
            (0..4 << (attempt % 10)).map(|_| (random.signed() * 128.0) as i8 as u8).collect();
        // A first bit that says that there are some.
        masks[0] &= 0x3f;
        payload.masks = &masks;
        match decoder.decode(&forged(&packets[frame], payload.to_bytes())) {
            Ok(found) => {
                let (found, whole) = (found.volume, &whole[frame]);
                assert_eq!(found.coords(), whole.coords());
                assert!((0..whole.block_count()).all(|block| found.block(block) == whole.block(block)));
                decoded += 1;
            }
            Err(DecodeError::Malformed { .. }) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    println!("{decoded} decoded, {refused} refused");
    assert!(decoded > 20 && refused > 20);
}

#[test]
fn every_prefix_of_a_payload_is_refused() {
    let packets = packets(stream());
    for (frame, packet) in packets.iter().enumerate().take(2) {
        for length in 0..packet.payload.len() {
            let cut = forged(packet, packet.payload[..length].to_vec());
            let error = decoder_before(&packets, frame).decode(&cut).unwrap_err();
            assert!(matches!(error, DecodeError::Format(_)), "{length} bytes: {error}");
        }
    }
}

#[test]
fn segments_that_end_too_early_are_refused() {
    let packets = packets(stream());
    for frame in 0..2 {
        let refused = decode_changed(&packets, frame, |p| {
            p.slices[1].coefficients = &p.slices[1].coefficients[..1];
        });
        assert_malformed(refused, "the coefficients end too early");
    }
    let refused = decode_changed(&packets, 1, |p| p.slices[0].modes = &p.slices[0].modes[..1]);
    assert_malformed(refused, "the modes end too early");
    // One block, wherever it is, takes 68 bits.
    let packet = forged(&packets[0], announcing(1, &[]));
    let refused = decoder_before(&[], 0).decode(&packet).map(|frame| frame.volume.clone());
    assert_malformed(refused, "the block set ends too early");
}

#[test]
fn of_several_bad_slices_the_first_is_told_whatever_the_threads() {
    let packets = packets(stream());
    let threads = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
    for _ in 0..200 {
        let refused = threads.install(|| {
            decode_changed(&packets, 1, |payload| {
                // The first slice is found to be bad long after the second.
                payload.slices[0].coefficients = &payload.slices[0].coefficients[..1];
                payload.slices[1].modes = &[];
            })
        });
        assert_malformed(refused, "the coefficients end too early");
    }
}

/// Random numbers below a bound.
struct Below(isv_testkit::Random);

impl Below {
    fn draw(&mut self, end: usize) -> usize {
        (((self.0.signed() + 1.0) / 2.0 * end as f64) as usize).min(end - 1)
    }

    /// Puts some random bytes into a run of bytes.
    fn damage(&mut self, bytes: &mut [u8]) {
        for _ in 0..=self.draw(4) {
            bytes[self.draw(bytes.len())] = self.draw(256) as u8;
        }
    }
}

/// The payload with one of its segments damaged. Bytes to spare follow each, so that what is made of it is not just too long.
fn damaged_segment(payload: &[u8], below: &mut Below) -> Vec<u8> {
    let payload = FramePayload::parse(payload, 0, true, &Profile::Main).unwrap();
    let slices = payload.slices.iter().flat_map(|slice| [slice.modes, slice.coefficients]);
    let spare = |segment: &[u8]| [segment, &[0x55; 100]].concat();
    let mut segments: Vec<_> =
        [payload.block_set, payload.masks].into_iter().chain(slices).map(spare).collect();
    let chosen = below.draw(segments.len());
    below.damage(&mut segments[chosen]);
    let slices = segments[2..].chunks_exact(2).map(|s| SlicePayload { modes: &s[0], coefficients: &s[1] });
    FramePayload {
        header: payload.header,
        block_set: &segments[0],
        masks: &segments[1],
        slices: slices.collect(),
    }
    .to_bytes()
}

#[test]
fn flipped_bytes_past_the_checksum_decode_to_something_or_an_error() {
    let packets = packets(stream());
    let mut below = Below(isv_testkit::Random::new(11));
    let (mut decoded, mut refused) = (0, 0);
    for round in 0..600 {
        let frame = below.draw(4);
        let mut payload = packets[frame].payload.clone();
        if round % 2 == 0 {
            below.damage(&mut payload);
        } else {
            payload = damaged_segment(&payload, &mut below);
        }
        let mut decoder = decoder_before(&packets, frame);
        match decoder.decode(&forged(&packets[frame], payload)) {
            Ok(found) => {
                let limit = found.volume.grid().truncation.codes();
                assert!(found.volume.samples().all(|sample| sample.abs() <= limit));
                decoded += 1;
            }
            Err(_) => refused += 1,
        }
        // Either way the next keyframe decodes.
        if frame < 2 && round % 20 == 0 {
            decoder.decode_and_verify(&packets[2]).unwrap();
        }
    }
    println!("{decoded} decoded, {refused} refused");
    assert!(decoded > 50 && refused > 50);
}

/// A keyframe that announces blocks and nothing else.
fn announcing(blocks: u32, block_set: &[u8]) -> Vec<u8> {
    let main = MainFrameHeader {
        kind: FrameKind::Intra,
        step: 9000,
        filter: 0,
        filter_limit: 0,
        half_voxel_vectors: true,
        no_spatial_prediction: false,
    };
    let payload = FramePayload {
        header: FrameHeader { blocks, slices: 1, coding: FrameCoding::Main(main), volume_hash: Some(0) },
        block_set,
        masks: &[],
        slices: vec![SlicePayload::default()],
    };
    payload.to_bytes()
}

#[test]
fn too_many_blocks_are_refused_before_memory_is_taken() {
    let packet = &packets(stream())[0];
    for blocks in [2049, u32::MAX] {
        let error = decoder_before(&[], 0).decode(&forged(packet, announcing(blocks, &[]))).unwrap_err();
        assert!(matches!(error, DecodeError::TooManyBlocks { limit: 2048, .. }), "{error}");
    }
}

#[test]
fn blocks_that_the_extension_would_add_count_towards_the_limit() {
    // 125 blocks on their own, each with 26 to come around it.
    let header = main_header(4);
    let mut builder = VolumeBuilder::new(header.grid);
    for block in 0..125 {
        let coord = [block % 5, block / 5 % 5, block / 25].map(|c| 3 * c);
        builder.push(coord.into(), vec![64; 512], None);
    }
    let bytes = whole_band(&header, &[builder.finish()]);
    let decode = |blocks: usize| {
        let mut decoder = Decoder::new(&header, Limits { frame_voxels: 512 * blocks, ..Limits::default() });
        decoder.decode(&packets(&bytes)[0]).map(|frame| frame.volume.block_count())
    };
    assert_eq!(decode(27 * 125).unwrap(), 27 * 125);
    let error = decode(27 * 125 - 1).unwrap_err();
    assert!(matches!(error, DecodeError::TooManyBlocks { blocks: 3375, limit: 3374, .. }), "{error}");
}

/// A stream of all blocks of some volumes.
fn whole_band(header: &StreamHeader, volumes: &[SparseVolume]) -> Vec<u8> {
    let main = MainSettings { band: Band::Full, ..Default::default() };
    encode(header, EncoderSettings { main, checksums: true, ..Default::default() }, volumes).0
}

#[test]
fn a_block_that_is_flagged_and_in_the_octree_too_is_refused() {
    // Zero bytes decode to ones: flags for the corner of the range of coordinates and the 7 blocks beside it, then an octree
    // of zeros, which is that corner again.
    let header = main_header(4);
    let mut builder = VolumeBuilder::new(header.grid);
    builder.push([-(1 << 20); 3].into(), vec![64; 512], None);
    let packets = packets(&whole_band(&header, &vec![builder.finish(); 2]));
    for (blocks, wanted) in [
        (7, "the block set holds more blocks than announced"),
        (9, "the block set holds a block twice"),
        (10, "the block set holds fewer blocks than announced"),
    ] {
        let mut payload = FramePayload::parse(&packets[1].payload, 0, true, &Profile::Main).unwrap();
        (payload.header.blocks, payload.block_set) = (blocks, &[0; 64]);
        // The frames are equal, but each block is to have its flag.
        if let FrameCoding::Main(main) = &mut payload.header.coding {
            main.kind = FrameKind::Predicted { skip_cells: false };
        }
        let mut decoder = Decoder::new(&header, LIMITS);
        decoder.decode(&packets[0]).unwrap();
        // The encoder may have made it a keyframe.
        let mut packet = forged(&packets[1], payload.to_bytes());
        packet.header.kind = PacketKind::Frame { keyframe: false, hashed: true, colour: false };
        packet.header.since_keyframe = 1;
        let decoded = decoder.decode(&packet);
        assert_malformed(decoded.map(|frame| frame.volume.clone()), wanted);
    }
}

#[test]
fn vectors_out_of_range_are_refused() {
    let packets = packets(stream());
    for steps in [65, -65, 1 << 20] {
        // The first block of a GOP's first slice with modes: not spatial, a vector of its own, all models fresh.
        let mut encoder = RangeEncoder::new();
        encoder.encode(&mut BitModel::default(), false);
        encoder.encode(&mut BitModel::default(), true);
        IntegerModel::default().encode(&mut encoder, steps);
        let mut bytes = encoder.finish();
        bytes.resize(400, 0);
        let refused = decode_changed(&packets, 1, |payload| payload.slices[0].modes = &bytes);
        assert_malformed(refused, "a motion vector is out of range");
    }
}

#[test]
fn masks_without_a_voxel_are_refused() {
    // Any masks: one. The first block: one. Then zeros for ever.
    let bytes = [&[0x3f, 0xff, 0x7f][..], &[0xff; 600]].concat();
    let packets = packets(stream());
    let refused = decode_changed(&packets, 0, |payload| payload.masks = &bytes);
    assert_malformed(refused, "a mask of unobserved voxels is empty");
}

#[test]
fn a_frame_needs_the_one_before_it() {
    let packets = packets(stream());
    let mut decoder = decoder_before(&packets, 0);
    assert!(matches!(decoder.decode(&packets[1]), Err(DecodeError::NoReference { .. })));
    decoder.decode(&packets[2]).unwrap();
    decoder.decode(&packets[3]).unwrap();
    assert!(matches!(
        decoder.decode(&packets[3]),
        Err(DecodeError::MissingFrame { expected: 2, found: 1, .. })
    ));
}
