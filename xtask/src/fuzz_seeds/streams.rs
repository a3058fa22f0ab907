//! Streams of the codec: those of the conformance suite, and some small ones.

use super::{Seeds, grid, tetrahedron};
use crate::conformance::painted;
use anyhow::{Context, Result};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings};
use isv::raw::encode::{Encoder, EncoderSettings};
use isv::raw::format::{
    ColourLayers, FrameRate, PacketHeader, PacketKind, PacketReader, PacketWriter, PaperParameters, Profile,
    StreamHeader,
};
use isv::raw::ingest::{MeshIngest, SignDecision, ingest_mesh};
use isv::raw::mp4::{GeometrySink, SoundOptions, open_sound};
use isv::raw::volume::{BlockEdge, SparseVolume};
use isv_testkit::small_ball;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;

pub(super) fn save(seeds: &mut Seeds) -> Result<()> {
    let mut streams = conformance_streams(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance"))?;
    streams.retain(|stream| stream.len() <= MOST_STREAM_BYTES);
    streams.sort();
    let paper = Profile::Paper(PaperParameters { coefficients: 20, dc_step: 819, ac_step: 2048 });
    let coloured = coloured_stream(&volume(BlockEdge::E8)?)?;
    streams.push(stream(paper, &volume(BlockEdge::E4)?)?);
    streams.push(stream(Profile::Main, &volume(BlockEdge::E8)?)?);
    streams.push(coloured.clone());
    for stream in &streams {
        for target in ["container", "live", "loss", "stream"] {
            seeds.save(target, stream)?;
        }
        for target in ["packet", "syntax", "differential"] {
            seeds.save(target, first_frames(stream))?;
        }
    }
    let mut as_it_is = SoundOptions::default();
    as_it_is.opus_bits_per_second = None;
    for sound in [None, Some(SoundOptions::default()), Some(as_it_is)] {
        let file = mp4_file(&coloured, sound)?;
        seeds.save("mp4", &file)?;
        seeds.save("sound", &file)?;
    }
    seeds.save("sound", &waveform())?;
    for layers in 1..=3 {
        seeds.save("colour", &colour_parts(layers))?;
    }
    let noise: Vec<u8> = (0..240u8).map(|i| i.wrapping_mul(37)).collect();
    for target in ["ingest", "encoder", "library"] {
        seeds.save(target, &noise)?;
    }
    seeds.save("range_decoder", &[&32u16.to_le_bytes()[..], &noise].concat())
}

/// A stream in an MP4 file, with sound beside it.
fn mp4_file(stream: &[u8], sound: Option<SoundOptions>) -> Result<Vec<u8>> {
    let sound = sound.map(|options| open_sound(Cursor::new(waveform()), options)).transpose()?;
    let mut sink = GeometrySink::new(Vec::new(), sound.into_iter().collect())?;
    sink.write_all(stream)?;
    Ok(sink.finish()?)
}

/// 10 ms of sound at 8 kHz in a WAV file.
fn waveform() -> Vec<u8> {
    let numbers: Vec<u8> = (0..160u8).collect();
    let (rate, bytes) = (8000u32, numbers.len() as u32);
    let mut file = [b"RIFF", &(36 + bytes).to_le_bytes()[..], b"WAVEfmt ", &16u32.to_le_bytes()].concat();
    for field in [1u16, 1] {
        file.extend(field.to_le_bytes());
    }
    file.extend(rate.to_le_bytes());
    file.extend((2 * rate).to_le_bytes());
    for field in [2u16, 16] {
        file.extend(field.to_le_bytes());
    }
    [&file[..], b"data", &bytes.to_le_bytes(), &numbers].concat()
}

/// A tetrahedron as a volume.
pub(super) fn volume(edge: BlockEdge) -> Result<SparseVolume> {
    let settings = MeshIngest::new(grid(edge));
    Ok(ingest_mesh(&tetrahedron(), &settings, SignDecision::Closed { flipped: false })?)
}

/// Larger streams take too long.
const MOST_STREAM_BYTES: usize = 32 << 10;

/// Streams of which all frames are decoded for every input.
const FEW_STREAM_BYTES: usize = 2 << 10;

/// The beginning of a stream, to the end of its second packet; all of it if it is small, or cannot be read so far.
fn first_frames(stream: &[u8]) -> &[u8] {
    let end = || {
        let mut packets = PacketReader::new(stream).ok()?;
        packets.next_packet().ok()??;
        let second = packets.next_packet().ok()??;
        Some(second.at as usize + second.total_bytes())
    };
    if stream.len() <= FEW_STREAM_BYTES { stream } else { &stream[..end().unwrap_or(stream.len())] }
}

/// The streams of a folder and of those in it, those that decoders must refuse included.
fn conformance_streams(folder: &Path) -> Result<Vec<Vec<u8>>> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut streams = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            streams.extend(conformance_streams(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "isv") {
            streams.push(fs::read(path)?);
        }
    }
    Ok(streams)
}

/// Two frames, the second one predicted.
fn stream(profile: Profile, volume: &SparseVolume) -> Result<Vec<u8>> {
    two_frames(&StreamHeader::new(profile, *volume.grid(), FrameRate::DEFAULT), volume, None)
}

/// Colour parts of so many layers on the first frames of a small ball, as the target takes them: one of each kind.
fn colour_parts(layers: u8) -> Vec<u8> {
    let mut out = vec![layers - 1];
    let cycle = [None, Some(9)][usize::from(layers) % 2];
    let mut encoder = ColourEncoder::new(ColourSettings { layers, cycle, ..ColourSettings::default() });
    for frame in 0..3 {
        let volume = small_ball(grid(BlockEdge::E8), f64::from(frame));
        let colours = painted(&volume, [frame, 0, 0]);
        let part = encoder.encode(&volume, &colours, frame == 0).bytes;
        out.extend((part.len() as u16).to_le_bytes());
        out.extend(part);
    }
    out
}

/// Two frames with colour parts of any bytes, and behind their header a packet that may be skipped.
fn coloured_stream(volume: &SparseVolume) -> Result<Vec<u8>> {
    let header = StreamHeader::new(Profile::Main, *volume.grid(), FrameRate::DEFAULT);
    let header = header.with_colour(ColourLayers::HalfVoxels);
    let frames = two_frames(&header, volume, Some(b"colour"))?;
    let (header, frames) = frames.split_at(StreamHeader::BYTES);
    let skipped = PacketHeader::seal(PacketKind::Skippable { code: 0x80 }, 0, 0, b"skip");
    Ok([header, &skipped, b"skip", frames].concat())
}

fn two_frames(header: &StreamHeader, volume: &SparseVolume, colour: Option<&[u8]>) -> Result<Vec<u8>> {
    let mut encoder = Encoder::new(header, EncoderSettings::default());
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    for _ in 0..2 {
        let frame = encoder.encode(volume);
        writer.write_coloured_frame(frame.keyframe, 0, &frame.payload(), colour)?;
    }
    Ok(writer.finish()?)
}
