//! Cut, damaged and forged streams: whole frames or an error, never a panic, a hang or a false frame.

mod support;

use isv_decode::{DecodeError, Decoder, Limits, Lod};
use isv_encode::{EncoderSettings, MotionMode};
use isv_format::{
    FrameCoding, FrameHeader, FramePayload, PacketKind, PacketReader, Prediction, SlicePayload,
};
use proptest::prelude::*;
use support::{ball, decode, encode, forged, header, packets};

fn stream() -> Vec<u8> {
    let header = header(8, 4, 30);
    let volumes: Vec<_> = (0..4).map(|t| ball(header.grid, f64::from(t))).collect();
    let motion = MotionMode::Fixed(Prediction::SixDof);
    encode(
        &header,
        EncoderSettings { motion, gop: 2, checksums: true, slices: Some(2), ..Default::default() },
        &volumes,
    )
    .0
}

#[test]
fn every_prefix_fails_cleanly_or_yields_whole_frames() {
    let bytes = stream();
    let (whole, _) = decode(&bytes);
    let lengths = (0..200).chain((200..bytes.len()).step_by(101)).chain(bytes.len() - 100..bytes.len());
    for length in lengths {
        let (frames, end) = decode(&bytes[..length]);
        assert_eq!(frames, whole[..frames.len()], "{length} bytes");
        assert!(end.is_err() || packets(&bytes[..length]).len() == frames.len());
    }
}

#[test]
fn flipped_bits_are_noticed_by_the_checksums() {
    let bytes = stream();
    let (whole, _) = decode(&bytes);
    for bit in (0..bytes.len() * 8).step_by(1009) {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let (frames, end) = decode(&damaged);
        assert!(end.is_err(), "bit {bit}");
        assert_eq!(frames, whole[..frames.len()]);
    }
}

#[test]
fn prefixes_decode_at_reduced_resolution_too() {
    let bytes = stream();
    for (lod, length) in [Lod::Half, Lod::Quarter].into_iter().flat_map(|l| [(l, 2000), (l, bytes.len())]) {
        let length = length.min(bytes.len());
        let mut reader = PacketReader::new(&bytes[..length]).unwrap();
        let mut decoder = Decoder::with_lod(reader.header(), Limits::default(), lod).unwrap();
        let mut frames = 0;
        while let Ok(Some(packet)) = reader.next_frame() {
            decoder.decode(&packet).unwrap();
            frames += 1;
        }
        assert!(frames <= 4 && (length < bytes.len() || frames == 4), "{frames} frames");
    }
}

#[test]
fn an_inter_frame_without_its_reference_is_refused() {
    let bytes = stream();
    let reader = PacketReader::new(&bytes[..]).unwrap();
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    let packets = packets(&bytes);
    assert!(matches!(decoder.decode(&packets[1]), Err(DecodeError::NoReference { .. })));
    assert!(decoder.decode(&packets[2]).is_ok(), "and the next keyframe decodes");
}

#[test]
fn a_missing_packet_is_noticed_and_the_next_keyframe_decodes() {
    let header = header(8, 4, 30);
    let volumes: Vec<_> = (0..5).map(|t| ball(header.grid, f64::from(t))).collect();
    let motion = MotionMode::Fixed(Prediction::ThreeDof);
    let bytes = encode(&header, EncoderSettings { motion, gop: 4, ..EncoderSettings::default() }, &volumes).0;
    let packets = packets(&bytes);
    let mut decoder = Decoder::new(&header, Limits::default());
    decoder.decode(&packets[0]).unwrap();
    let error = decoder.decode(&packets[2]).unwrap_err();
    assert!(matches!(error, DecodeError::MissingFrame { expected: 1, found: 2, .. }), "{error}");
    assert!(matches!(decoder.decode(&packets[3]), Err(DecodeError::NoReference { .. })));
    decoder.decode(&packets[4]).unwrap();
}

#[test]
fn too_many_blocks_are_refused_before_memory_is_taken() {
    let bytes = stream();
    let reader = PacketReader::new(&bytes[..]).unwrap();
    let mut decoder = Decoder::new(reader.header(), Limits { frame_voxels: 512_000, ..Limits::default() });
    let payload = FramePayload {
        header: FrameHeader {
            blocks: u32::MAX,
            slices: 1,
            coding: FrameCoding::Paper { prediction: Prediction::None },
            volume_hash: None,
        },
        block_set: &[],
        masks: &[],
        slices: vec![SlicePayload::default()],
    };
    let mut packet = forged(&packets(&bytes)[0], payload.to_bytes());
    packet.header.kind = PacketKind::Frame { keyframe: true, hashed: false, colour: false };
    let error = decoder.decode(&packet).unwrap_err();
    assert!(matches!(error, DecodeError::TooManyBlocks { limit: 1000, .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Past the checksum, any bytes at all: the decoder returns, with a volume or an error.
    #[test]
    fn forged_payloads_never_panic(
        frame in 0..4usize,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        lod in prop::sample::select(&[Lod::Full, Lod::Half, Lod::Quarter][..]),
    ) {
        let bytes = stream_once();
        let reader = PacketReader::new(bytes).unwrap();
        let limits = Limits { frame_voxels: 1 << 22, ..Limits::default() };
        let mut decoder = Decoder::with_lod(reader.header(), limits, lod).unwrap();
        let packets = packets(bytes);
        for packet in &packets[frame / 2 * 2..frame] {
            decoder.decode(packet).unwrap();
        }
        let mut payload = packets[frame].payload.clone();
        for (place, value) in edits {
            let place = place.index(payload.len());
            payload[place] = value;
        }
        if let Some(cut) = cut {
            payload.truncate(cut.index(payload.len()));
        }
        let _ = decoder.decode(&forged(&packets[frame], payload));
    }
}

fn stream_once() -> &'static [u8] {
    static STREAM: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    STREAM.get_or_init(stream)
}
