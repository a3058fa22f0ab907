//! Packets count the frames since a keyframe modulo 2^16: a longer group of pictures decodes, and what is missing is still noticed.

use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_encode::{Encoder, EncoderSettings};
use isv_format::{FrameRate, Packet, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv_testkit::volume_of;
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};

/// Frames of a group: four more than the count has values for.
const FRAMES: u64 = (1 << 16) + 4;

/// The packets of a stream with one keyframe: nothing, until a speck comes in frame `2^16`.
fn group(header: &StreamHeader) -> Vec<Packet> {
    let [nothing, speck] = [f64::NEG_INFINITY, 2.0].map(|radius| ball(header.grid, radius));
    let settings = EncoderSettings { gop: u32::MAX, checksums: true, ..EncoderSettings::default() };
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    for frame in 0..FRAMES {
        let coded = encoder.encode(if frame < 1 << 16 { &nothing } else { &speck });
        assert_eq!(coded.keyframe, frame == 0);
        writer.write_frame(coded.keyframe, frame, &coded.payload()).unwrap();
    }
    let bytes = writer.finish().unwrap();
    let mut reader = PacketReader::new(&bytes[..]).unwrap();
    std::iter::from_fn(|| reader.next_frame().unwrap()).collect()
}

/// A ball, its radius in voxels.
fn ball(grid: Grid, radius: f64) -> SparseVolume {
    volume_of(grid, 10, |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt() - radius, |_| false)
}

fn header(profile: Profile, edge: BlockEdge) -> StreamHeader {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge,
        truncation: Truncation::from_voxels(4).unwrap(),
    };
    StreamHeader::new(profile, grid, FrameRate::DEFAULT)
}

fn check(header: &StreamHeader) {
    let packets = group(header);
    let counts = packets.iter().map(|packet| u64::from(packet.header.since_keyframe));
    assert!(counts.eq((0..FRAMES).map(|frame| frame % (1 << 16))));

    let mut decoder = Decoder::new(header, Limits::default());
    let (before, from_there_on) = packets.split_at(1 << 16);
    let mut hash = |packet| volume_hash(decoder.decode_and_verify(packet).unwrap().volume);
    let last_before = before.iter().map(&mut hash).last().unwrap();
    for packet in from_there_on {
        assert_ne!(hash(packet), last_before);
    }

    // Frame 2^16 again, which has the count 0, where the frame with the count 4 should be.
    match decoder.decode(&packets[1 << 16]) {
        Err(DecodeError::MissingFrame { expected: 4, found: 0, .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_group_may_be_longer_than_its_packets_count_in_profile_main() {
    check(&header(Profile::Main, BlockEdge::E8));
}

#[test]
fn a_group_may_be_longer_than_its_packets_count_in_profile_paper() {
    let paper = PaperParameters { coefficients: 20, dc_step: 819, ac_step: 8192 };
    check(&header(Profile::Paper(paper), BlockEdge::E4));
}
