//! Streams and sound for tests.

use isv_format::{
    FrameCoding, FrameHeader, FramePayload, FrameRate, PacketWriter, PaperParameters, Prediction, Profile,
    SlicePayload, StreamHeader,
};
use isv_mp4::{GeometrySink, Mp4Error, SampleSource, SourceSample, TrackDescription, TrackKind};
use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};
use std::io::{Read, Write};
use std::path::Path;

/// Sound of 20 ms packets, each of 40 bytes that hold its number.
pub(crate) struct Clicks {
    description: TrackDescription,
    next: u64,
    end: u64,
}

impl Clicks {
    pub(crate) fn new(seconds: f64) -> Self {
        let entry = [&16u32.to_be_bytes()[..], b"test", &[0; 8]].concat();
        let description = TrackDescription::new(TrackKind::Sound, 1000, entry);
        Self { description, next: 0, end: (seconds * 50.0).round() as u64 }
    }
}

impl SampleSource for Clicks {
    fn description(&self) -> &TrackDescription {
        &self.description
    }

    fn next_sample(&mut self) -> Result<Option<SourceSample>, Mp4Error> {
        if self.next == self.end {
            return Ok(None);
        }
        let number = self.next;
        self.next += 1;
        let data = vec![number as u8; 40];
        Ok(Some(SourceSample { time: number * 20, duration: 20, composition_offset: 0, sync: true, data }))
    }
}

/// A stream at 30 frames a second with a keyframe every `gop` frames.
pub(crate) fn stream(frames: u64, gop: u64) -> Vec<u8> {
    stream_with_times((0..frames).map(|frame| FrameRate::DEFAULT.timestamp_ns(frame)), gop)
}

pub(crate) fn stream_with_times(times: impl Iterator<Item = u64>, gop: u64) -> Vec<u8> {
    let voxel_size = VoxelSize::from_metres(0.01).unwrap();
    let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::from_voxels(8).unwrap() };
    let profile = Profile::Paper(PaperParameters { coefficients: 8, dc_step: 16, ac_step: 16 });
    let mut writer =
        PacketWriter::new(Vec::new(), &StreamHeader::new(profile, grid, FrameRate::DEFAULT)).unwrap();
    for (frame, time_ns) in (0..).zip(times) {
        let coefficients = vec![frame as u8; 30 + frame as usize % 7];
        let slice = SlicePayload { modes: &[], coefficients: &coefficients };
        let header = FrameHeader {
            blocks: 1,
            slices: 1,
            coding: FrameCoding::Paper { prediction: Prediction::None },
            volume_hash: None,
        };
        let payload = FramePayload { header, block_set: &[7], masks: &[], slices: vec![slice] };
        writer.write_frame(frame % gop == 0, time_ns, &payload).unwrap();
    }
    writer.finish().unwrap()
}

/// An MP4 file of a stream and tracks, and the number of packets that it lacks. Bytes are given in odd pieces.
pub(crate) fn in_mp4(
    stream: &[u8],
    tracks: Vec<Box<dyn SampleSource>>,
) -> Result<(Vec<u8>, usize), Mp4Error> {
    let mut sink = GeometrySink::new(Vec::new(), tracks)?;
    for piece in stream.chunks(101) {
        sink.write_all(piece)?;
    }
    let left_out = sink.left_out();
    Ok((sink.finish()?, left_out))
}

pub(crate) fn read_all(source: &mut impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes).unwrap();
    bytes
}

/// The streams of the conformance suite, with their names.
pub(crate) fn conformance() -> impl Iterator<Item = (String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|end| end == "isv")).filter_map(|path| {
        let bytes = std::fs::read(&path).unwrap();
        let is_stream = bytes.first_chunk().is_some_and(|header| StreamHeader::parse(header).is_ok());
        is_stream.then(|| (path.display().to_string(), bytes))
    })
}
