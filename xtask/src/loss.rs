//! Streams that lose packets: what is shown over time, and how far it is from what was captured (`docs/results/loss.md`).

use crate::takes::{FRAME_RATE, Sequence};
use anyhow::{Context, Result};
use isv::raw::decode::{Decoder, Limits, volume_hash};
use isv::raw::encode::{Encoder, EncoderSettings, MainSettings, Preset, Refresh};
use isv::raw::format::{Packet, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, decide_sign, ingest_mesh};
use isv::raw::volume::{BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, Truncation, VoxelSize};
use isv_study::{Axis, Chart, Series, Take};
use isv_testkit::Random;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Frames of the stream: the clip forth and back.
const FRAMES: usize = 300;
const CLIP: &str = "dancer";
const VOXEL_M: f64 = 0.005;
/// Shares of the packets that are lost.
const LOSSES: [f64; 3] = [0.01, 0.05, 0.2];
/// Voxels nearer to the source's surface than this, in voxels, are compared.
const NEAR: f64 = 0.9;

/// A way to get over losses.
struct Scheme {
    name: &'static str,
    colour: &'static str,
    refresh: Refresh,
    gop: u32,
}

const SCHEMES: [Scheme; 4] = [
    Scheme { name: "a keyframe every 30 frames", colour: "#d1603d", refresh: Refresh::Keyframes, gop: 30 },
    Scheme { name: "a keyframe every 8 frames", colour: "#c9a227", refresh: Refresh::Keyframes, gop: 8 },
    Scheme { name: "gradual refresh in 30 frames", colour: "#2b6cb0", refresh: Refresh::Gradual, gop: 30 },
    Scheme { name: "gradual refresh in 8 frames", colour: "#3a8f6b", refresh: Refresh::Gradual, gop: 8 },
];

/// What a viewer has of a stream.
struct Seen {
    /// For each frame, the root mean square of its error in millimetres; NaN before the first one that can be decoded.
    errors_mm: Vec<f64>,
    /// Frames that are as without loss.
    exact: usize,
    /// Frames that are the last one again.
    held: usize,
}

/// Measures all schemes at all losses; writes charts into `docs` and prints the table.
pub(crate) fn run(data: &Path, docs: &Path) -> Result<()> {
    let (header, volumes) = capture(&data.join(CLIP))?;
    let source = |frame: usize| &volumes[fold(frame, volumes.len())];
    let mut rows = String::new();
    let mut charts: Vec<Vec<Series>> = LOSSES.iter().map(|_| Vec::new()).collect();
    for scheme in &SCHEMES {
        let (packets, hashes) = encode(&header, scheme, source)?;
        let sizes: Vec<usize> = packets[1..].iter().map(Packet::total_bytes).collect();
        let bytes = packets.iter().map(Packet::total_bytes).sum::<usize>() as f64;
        let mbps = bytes * 8.0 / (FRAMES as f64 / FRAME_RATE.per_second()) / 1e6;
        let peak = *sizes.iter().max().expect("there are frames") as f64
            / (sizes.iter().sum::<usize>() as f64 / sizes.len() as f64);
        let whole = watch(&header, &packets, &hashes, source, |_| false)?;
        write!(rows, "| {} | {mbps:.2} | {peak:.1} | {:.2} |", scheme.name, mean(&whole.errors_mm))?;
        for (loss, series) in LOSSES.iter().zip(&mut charts) {
            let lost = lost_packets(*loss);
            let seen = watch(&header, &packets, &hashes, source, |frame| lost[frame])?;
            let percent = |count: usize| 100.0 * count as f64 / FRAMES as f64;
            write!(
                rows,
                " {:.2} mm, {:.0} % exact, {:.0} % held |",
                mean(&seen.errors_mm),
                percent(seen.exact),
                percent(seen.held)
            )?;
            series.push(Series {
                name: scheme.name.to_owned(),
                colour: scheme.colour.to_owned(),
                dashed: false,
                points: seen.errors_mm.iter().enumerate().map(|(x, y)| (x as f64, *y)).collect(),
                labels: Vec::new(),
                spread: Vec::new(),
            });
        }
        rows.push('\n');
    }
    for (loss, series) in LOSSES.iter().zip(charts) {
        let percent = 100.0 * loss;
        let chart = Chart::Lines {
            title: format!("{CLIP}, {percent:.0} % of the packets lost"),
            x: Axis::linear("frame"),
            y: Axis::linear("error of what is shown, mm"),
            series,
        };
        write_file(docs, &format!("loss-{percent:.0}.svg"), &chart.svg())?;
    }
    let columns = LOSSES.map(|loss| format!(" {:.0} % lost |", 100.0 * loss)).concat();
    let header = format!("| stream | Mbps | largest frame over mean | nothing lost, mm |{columns}\n");
    println!("{header}|{}\n{rows}", "---|".repeat(4 + LOSSES.len()));
    Ok(())
}

/// The clip as volumes.
fn capture(folder: &Path) -> Result<(StreamHeader, Vec<SparseVolume>)> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(VOXEL_M)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let (ingest, mut sign, mut volumes) = (MeshIngest::new(grid), None, Vec::new());
    for mesh in Sequence::open(folder, FRAMES)?.meshes().map_err(anyhow::Error::from_boxed)? {
        let mesh = mesh.map_err(anyhow::Error::from_boxed)?;
        let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
        volumes.push(ingest_mesh(&mesh, &ingest, sign)?);
    }
    Ok((StreamHeader::new(Profile::Main, grid, FRAME_RATE), volumes))
}

/// Frame of a clip of `length` frames that is played forth and back.
fn fold(frame: usize, length: usize) -> usize {
    let period = (2 * (length - 1)).max(1);
    let place = frame % period;
    place.min(period - place).min(length - 1)
}

/// Which packets are lost; never the first. The same for all streams.
fn lost_packets(share: f64) -> Vec<bool> {
    let mut random = Random::new(2026);
    (0..FRAMES).map(|frame| random.signed().abs() < share && frame > 0).collect()
}

/// The packets of a stream, and the hash of each frame.
fn encode<'a>(
    header: &StreamHeader,
    scheme: &Scheme,
    source: impl Fn(usize) -> &'a SparseVolume,
) -> Result<(Vec<Packet>, Vec<u64>)> {
    let main = MainSettings { refresh: scheme.refresh, ..Preset::Realtime.settings() };
    let settings = EncoderSettings { gop: scheme.gop, main, ..EncoderSettings::default() };
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    let mut hashes = Vec::new();
    for frame in 0..FRAMES {
        let coded = encoder.encode(source(frame));
        writer.write_frame(coded.keyframe, FRAME_RATE.timestamp_ns(frame as u64), &coded.payload())?;
        hashes.push(volume_hash(encoder.reconstruction().context("a frame was coded")?));
    }
    let bytes = writer.finish()?;
    let mut reader = PacketReader::new(&bytes[..])?;
    let mut packets = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        packets.push(packet);
    }
    Ok((packets, hashes))
}

/// What is seen where packets are lost: the last frame, where there is no other.
fn watch<'a>(
    header: &StreamHeader,
    packets: &[Packet],
    hashes: &[u64],
    source: impl Fn(usize) -> &'a SparseVolume,
    lost: impl Fn(usize) -> bool,
) -> Result<Seen> {
    let mut decoder = Decoder::new(header, Limits::default());
    decoder.recover(true);
    let mut shown: Option<SparseVolume> = None;
    let mut seen = Seen { errors_mm: Vec::new(), exact: 0, held: 0 };
    for (frame, packet) in packets.iter().enumerate() {
        match if lost(frame) { None } else { decoder.decode(packet).ok() } {
            Some(decoded) => {
                if decoded.inexact_blocks == 0 {
                    anyhow::ensure!(
                        volume_hash(decoded.volume) == hashes[frame],
                        "frame {frame} is not exact"
                    );
                    seen.exact += 1;
                }
                shown = Some(decoded.volume.clone());
            }
            None => seen.held += 1,
        }
        seen.errors_mm.push(shown.as_ref().map_or(f64::NAN, |shown| error_mm(source(frame), shown)));
    }
    Ok(seen)
}

/// Root mean square of the difference in signed distance near the source's surface; the truncation distance where what is shown
/// has no block.
fn error_mm(source: &SparseVolume, shown: &SparseVolume) -> f64 {
    let index = shown.index();
    let near = (NEAR * f64::from(CODES_PER_VOXEL)) as i16;
    let missing = f64::from(source.grid().truncation.codes());
    let (mut squares, mut count) = (0.0, 0u64);
    for (block, coord) in source.coords().iter().enumerate() {
        let there = index.get(*coord).map(|there| shown.block(there as usize));
        let mask = source.unobserved(block);
        for (voxel, sample) in source.block(block).iter().enumerate() {
            if sample.abs() > near || mask.is_some_and(|mask| mask.contains(voxel)) {
                continue;
            }
            let difference =
                there.map_or(missing, |there| f64::from(i32::from(there[voxel]) - i32::from(*sample)));
            squares += difference * difference;
            count += 1;
        }
    }
    let codes = (squares / count.max(1) as f64).sqrt();
    1000.0 * VOXEL_M * codes / f64::from(CODES_PER_VOXEL)
}

fn mean(errors_mm: &[f64]) -> f64 {
    errors_mm.iter().sum::<f64>() / errors_mm.len() as f64
}

fn write_file(docs: &Path, name: &str, text: &str) -> Result<()> {
    let path = docs.join(name);
    println!("{}", path.display());
    fs::write(&path, text).with_context(|| format!("{}: cannot write", path.display()))
}
