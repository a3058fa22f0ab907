//! Streams at the ends of what the format allows, most of which our encoder never makes.

mod main_profile;
mod paper;

use super::Stream;
use super::raw::{RawFrame, RawStream, judge, octree, stream_of};
use anyhow::{Result, ensure};
use isv::raw::format::{
    FrameCoding, FrameHeader, FrameKind, FrameRate, MainFrameHeader, PaperParameters, Prediction, Profile,
    StreamHeader,
};
use isv::raw::volume::{BlockEdge, Grid, Truncation, VoxelSize};

/// All of them, by name.
pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    let mut streams = paper::streams()?;
    streams.extend(main_profile::streams()?);
    streams.extend([
        ("no_frames", no_frames(true)?),
        ("no_frames_no_index", no_frames(false)?),
        ("no_hashes_no_index", no_hashes_no_index()?),
        ("long_gop", long_gop()?),
        ("long_varints", long_varints()?),
        ("unused_bytes", unused_bytes()?),
    ]);
    Ok(streams)
}

/// First and last block coordinate along an axis.
pub(super) const FIRST: i32 = -(1 << 20);
pub(super) const LAST: i32 = (1 << 20) - 1;

/// The fields of a stream header that say nothing about samples, at their least or at their most.
fn header(profile: Profile, edge: BlockEdge, truncation: u32, most: bool) -> Result<StreamHeader> {
    let (nanometres, numerator, denominator) =
        if most { (1_000_000_000_000, u32::MAX, 1) } else { (1000, 1, u32::MAX) };
    let grid = Grid {
        voxel_size: VoxelSize::from_nanometres(nanometres)?,
        edge,
        truncation: Truncation::from_voxels(truncation)?,
    };
    Ok(StreamHeader::new(profile, grid, FrameRate { numerator, denominator }))
}

/// A small stream of profile `paper`.
pub(super) fn small_paper() -> Result<StreamHeader> {
    let paper = PaperParameters { coefficients: 64, dc_step: 256, ac_step: 1024 };
    header(Profile::Paper(paper), BlockEdge::E4, 2, false)
}

/// A small stream of profile `main`.
pub(super) fn small_main() -> Result<StreamHeader> {
    header(Profile::Main, BlockEdge::E8, 2, false)
}

/// What a frame of profile `main` states, in the middle of what it may.
pub(super) const MAIN: MainFrameHeader = MainFrameHeader {
    step: 9000,
    filter: 0,
    filter_limit: 0,
    half_voxel_vectors: true,
    no_spatial_prediction: false,
    kind: FrameKind::Intra,
};

/// Header of a frame that is predicted from the one before.
pub(super) const PREDICTED: MainFrameHeader =
    MainFrameHeader { kind: FrameKind::Predicted { skip_cells: false }, ..MAIN };

/// A frame of one slice whose symbols, but for those of the block set, are ones: that is what zeros are. No masks.
pub(super) fn frame_of_ones(header: &StreamHeader, prediction: Prediction, blocks: u32) -> RawFrame {
    let coding = match header.profile {
        Profile::Paper(_) => FrameCoding::Paper { prediction },
        Profile::Main if prediction == Prediction::None => FrameCoding::Main(MAIN),
        Profile::Main => FrameCoding::Main(PREDICTED),
    };
    RawFrame {
        header: FrameHeader { blocks, slices: 1, coding, volume_hash: None },
        block_set: vec![0; 64],
        masks: vec![0x80],
        slices: vec![[vec![0; 32], vec![0; 64]]],
    }
}

/// A keyframe of these blocks.
pub(super) fn keyframe(header: &StreamHeader, coords: &[[i32; 3]], depth: u32) -> RawFrame {
    let mut frame = frame_of_ones(header, Prediction::None, coords.len() as u32);
    frame.block_set = octree(coords, depth);
    frame.slices[0][0].clear();
    frame
}

fn no_frames(index: bool) -> Result<Stream> {
    let stream = RawStream::new(&small_main()?);
    Ok((if index { stream.finish() } else { stream.bytes }, Vec::new()))
}

/// Timestamps that go down from the largest; no frame states its hash, and the writer did not finish.
fn no_hashes_no_index() -> Result<Stream> {
    let header = small_paper()?;
    let mut stream = RawStream::new(&header);
    for (frame, timestamp_ns) in [u64::MAX, 1 << 40, 7, 7].into_iter().enumerate() {
        let payload = match frame {
            0 | 2 => keyframe(&header, &[[0; 3], [1, 0, 0]], 1),
            _ => frame_of_ones(&header, Prediction::ZeroMotion, 1),
        };
        stream.frame(frame % 2 == 0, timestamp_ns, false, &payload.to_bytes());
    }
    judged(stream.bytes)
}

/// A GOP of more frames than a byte counts. All of them are empty.
fn long_gop() -> Result<Stream> {
    let header = small_main()?;
    let mut stream = RawStream::new(&header);
    for frame in 0..300u64 {
        let prediction = if frame == 0 { Prediction::None } else { Prediction::ThreeDof };
        let mut empty = frame_of_ones(&header, prediction, 0);
        (empty.block_set, empty.masks, empty.slices[0]) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new()]);
        stream.frame(frame == 0, header.frame_rate.timestamp_ns(frame), false, &empty.to_bytes());
    }
    judged(stream.finish())
}

/// A stream that is decoded to its end.
pub(super) fn judged(bytes: Vec<u8>) -> Result<Stream> {
    let (hashes, error) = judge(&bytes);
    ensure!(error.is_none(), "{error:?}");
    Ok((bytes, hashes))
}

/// Every varint takes all 5 bytes.
fn long_varints() -> Result<Stream> {
    let header = small_main()?;
    let mut stream = RawStream::new(&header);
    let first = keyframe(&header, &[[FIRST, 0, LAST]], 3);
    let second = frame_of_ones(&header, Prediction::ThreeDof, 12);
    for (index, frame) in [first, second].into_iter().enumerate() {
        stream.frame(index == 0, 0, false, &widened(&frame));
    }
    judged(stream.finish())
}

/// The payload of a frame of one slice of profile `main`, without a filter, whose varints have 5 bytes each.
fn widened(frame: &RawFrame) -> Vec<u8> {
    let varint =
        |value: usize| (0..5).map(move |i| (value >> (7 * i) & 0x7f) as u8 | if i < 4 { 0x80 } else { 0 });
    let payload = frame.to_bytes();
    let mut out = vec![payload[0]];
    out.extend(varint(frame.header.blocks as usize));
    out.extend(varint(1));
    out.extend(varint(MAIN.step as usize));
    out.push(1 << 6);
    let [motion, coefficients] = &frame.slices[0];
    let segments = [&frame.block_set, &frame.masks, motion, coefficients];
    segments.iter().for_each(|segment| out.extend(varint(segment.len())));
    segments.iter().for_each(|segment| out.extend(*segment));
    out
}

/// Segments that are not read, and bytes behind those that are.
fn unused_bytes() -> Result<Stream> {
    let header = small_paper()?;
    let mut frames = vec![
        (true, keyframe(&header, &[[0; 3], [5, -3, 2]], 21)),
        (false, frame_of_ones(&header, Prediction::None, 1)),
        (true, frame_of_ones(&header, Prediction::None, 0)),
        (false, frame_of_ones(&header, Prediction::SixDof, 0)),
    ];
    for (_, frame) in &mut frames {
        // Up to four zeros were left off.
        frame.block_set.extend([0, 0, 0, 0, 0xde, 0xad, 0, 0, 0, 0]);
        frame.masks.extend([0xff; 9]);
        frame.slices[0].iter_mut().for_each(|segment| segment.extend([0x55; 5]));
    }
    stream_of(&header, &frames)
}
