//! Whole-stream helpers.
#![allow(dead_code, reason = "each test uses some")]

use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_encode::{Encoder, EncoderSettings};
use isv_format::{FrameRate, Packet, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
pub(crate) use isv_testkit::ball;
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};

pub(crate) fn header(edge: u32, truncation: u32, coefficients: u16) -> StreamHeader {
    let paper = PaperParameters { coefficients, dc_step: 819, ac_step: 2048 };
    header_of(Profile::Paper(paper), edge, truncation)
}

pub(crate) fn main_header(truncation: u32) -> StreamHeader {
    header_of(Profile::Main, 8, truncation)
}

fn header_of(profile: Profile, edge: u32, truncation: u32) -> StreamHeader {
    StreamHeader::new(
        profile,
        Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::from_voxels(edge).unwrap(),
            truncation: Truncation::from_voxels(truncation).unwrap(),
        },
        FrameRate::DEFAULT,
    )
}

/// Encodes volumes; returns the stream and the hash of the encoder's own reconstruction of each frame.
pub(crate) fn encode(
    header: &StreamHeader,
    settings: EncoderSettings,
    volumes: &[SparseVolume],
) -> (Vec<u8>, Vec<u64>) {
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    let mut hashes = Vec::new();
    for (frame, volume) in volumes.iter().enumerate() {
        let coded = encoder.encode(volume);
        let timestamp = header.frame_rate.timestamp_ns(frame as u64);
        writer.write_frame(coded.keyframe, timestamp, &coded.payload()).unwrap();
        hashes.push(volume_hash(encoder.reconstruction().unwrap()));
    }
    (writer.finish().unwrap(), hashes)
}

/// Decodes frames up to the end or the first error; returns their volumes.
pub(crate) fn decode(bytes: &[u8]) -> (Vec<SparseVolume>, Result<(), DecodeError>) {
    let mut volumes = Vec::new();
    let end = (|| {
        let mut reader = PacketReader::new(bytes)?;
        let mut decoder =
            Decoder::new(reader.header(), Limits { frame_voxels: 1 << 24, ..Limits::default() });
        while let Some(packet) = reader.next_frame()? {
            volumes.push(decoder.decode_and_verify(&packet)?.volume.clone());
        }
        Ok(())
    })();
    (volumes, end)
}

/// The frame packets of a whole stream.
pub(crate) fn packets(bytes: &[u8]) -> Vec<Packet> {
    let mut reader = PacketReader::new(bytes).unwrap();
    std::iter::from_fn(|| reader.next_frame().unwrap()).collect()
}

/// The packet with another payload, its header made to fit. Past the reader nobody looks at the checksum.
pub(crate) fn forged(packet: &Packet, payload: Vec<u8>) -> Packet {
    let mut packet = packet.clone();
    packet.header.payload_bytes = payload.len() as u32;
    packet.payload = payload;
    packet
}
