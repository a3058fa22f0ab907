//! Decoding at reduced resolution: what it saves, and how far it drifts from a full decode that is averaged down.

use anyhow::{Context, Result};
use isv::raw::decode::{Decoder, Limits, Lod};
use isv::raw::encode::{Encoder, EncoderSettings};
use isv::raw::format::{Packet, PacketReader, PacketWriter, StreamHeader};
use isv::raw::ingest::{MeshIngest, decide_sign, ingest_mesh};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::metrics::{CompareOptions, compare};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{Grid, SparseVolume, TriangleMesh, VolumeBuilder, VoxelMask};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Times a decode is run; the fastest counts, as other work on the machine only ever adds.
const RUNS: usize = 5;

/// Measures the first `frames` frames of a folder of meshes in metres, one GOP of 30 or as many GOPs as it takes.
pub(crate) fn run(folder: &str, frames: usize, header: &StreamHeader) -> Result<()> {
    let (meshes, packets) = encode(folder, frames, header)?;
    let full = decode(header, Lod::Full, &packets)?;
    println!("{folder}: {} frames; full resolution: {}", meshes.len(), full.times());
    for lod in [Lod::Half, Lod::Quarter] {
        let reduced = decode(header, lod, &packets)?;
        let start = Instant::now();
        let averaged: Vec<_> = full
            .volumes
            .iter()
            .zip(&reduced.volumes)
            .map(|(volume, like)| average(volume, like.grid()))
            .collect();
        let averaging = start.elapsed();
        let averaging_ms = averaging.as_secs_f64() * 1e3 / meshes.len() as f64;
        println!("\n1/{}: {}; averaging down {averaging_ms:.1} ms\n", lod.voxels(), reduced.times());
        println!(
            "| frame | drift, rms, voxels | drift, mean | point to surface, mm | the same, averaged down |"
        );
        println!("|---|---|---|---|---|");
        for frame in (0..meshes.len()).filter(|f| *f < 3 || f % 5 == 4) {
            let (rms, mean) = difference(&averaged[frame], &reduced.volumes[frame]);
            let error = |volume| error_mm(&meshes[frame], volume);
            let (direct, alternative) = (error(&reduced.volumes[frame])?, error(&averaged[frame])?);
            println!("| {frame} | {rms:.3} | {mean:+.3} | {direct:.3} | {alternative:.3} |");
        }
    }
    Ok(())
}

fn encode(folder: &str, frames: usize, header: &StreamHeader) -> Result<(Vec<TriangleMesh>, Vec<Packet>)> {
    let sequence = FrameSequence::open(folder)?;
    let mut encoder = Encoder::new(header, EncoderSettings::default());
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    let (mut meshes, mut decision) = (Vec::new(), None);
    for (frame, path) in sequence.paths().iter().take(frames).enumerate() {
        let mesh = read_mesh(path, Unit::Metre)?;
        let settings = MeshIngest::new(header.grid);
        let sign = *decision.get_or_insert_with(|| decide_sign(&mesh, settings.sign).0);
        let coded = encoder.encode(&ingest_mesh(&mesh, &settings, sign)?);
        writer.write_frame(coded.keyframe, header.frame_rate.timestamp_ns(frame as u64), &coded.payload())?;
        meshes.push(mesh);
    }
    let bytes = writer.finish()?;
    let mut reader = PacketReader::new(&bytes[..])?;
    let packets = std::iter::from_fn(|| reader.next_frame().transpose()).collect::<Result<_, _>>()?;
    Ok((meshes, packets))
}

struct Decoded {
    volumes: Vec<SparseVolume>,
    decode: Duration,
    surface: Duration,
}

impl Decoded {
    fn times(&self) -> String {
        let ms = |time: Duration| time.as_secs_f64() * 1e3 / self.volumes.len() as f64;
        format!("decode {:.1} ms a frame, surface {:.1} ms", ms(self.decode), ms(self.surface))
    }
}

/// Decodes all packets and extracts the surfaces.
fn decode(header: &StreamHeader, lod: Lod, packets: &[Packet]) -> Result<Decoded> {
    let mut best = Decoded { volumes: Vec::new(), decode: Duration::MAX, surface: Duration::MAX };
    for _ in 0..RUNS {
        let mut decoder = Decoder::with_lod(header, Limits::default(), lod)?;
        let (mut volumes, mut decode, mut surface) = (Vec::new(), Duration::ZERO, Duration::ZERO);
        for packet in packets {
            let start = Instant::now();
            let volume = decoder.decode(packet)?.volume;
            decode += start.elapsed();
            let start = Instant::now();
            std::hint::black_box(extract_surface(volume, &SurfaceOptions::default()));
            surface += start.elapsed();
            volumes.push(volume.clone());
        }
        best = Decoded { volumes, decode: best.decode.min(decode), surface: best.surface.min(surface) };
    }
    Ok(best)
}

/// A volume averaged down to larger voxels: each the mean of the voxels in it, unobserved if half of them or more are.
fn average(volume: &SparseVolume, grid: &Grid) -> SparseVolume {
    let ratio = (grid.voxel_size.nanometres() / volume.grid().voxel_size.nanometres()) as usize;
    let n = grid.edge.voxels();
    let part = n / ratio;
    let mut groups: BTreeMap<_, (Vec<i16>, VoxelMask)> = BTreeMap::new();
    for (block, coord) in volume.coords().iter().enumerate() {
        let (samples, hidden) = groups
            .entry(coord.to_array().map(|c| c.div_euclid(ratio as i32)))
            .or_insert_with(|| (vec![grid.truncation.codes(); n.pow(3)], full_mask(grid)));
        let corner = coord.to_array().map(|c| c.rem_euclid(ratio as i32) as usize * part);
        for voxel in 0..part.pow(3) {
            let at = [voxel % part, voxel / part % part, voxel / part / part];
            let (mut sum, mut unobserved) = (0, 0);
            for i in 0..ratio.pow(3) {
                let by = [i % ratio, i / ratio % ratio, i / ratio / ratio];
                let [x, y, z] = [0, 1, 2].map(|axis| ratio * at[axis] + by[axis]);
                let from = grid.edge.voxel_index(x, y, z);
                sum += i32::from(volume.block(block)[from]);
                unobserved += usize::from(volume.unobserved(block).is_some_and(|m| m.contains(from)));
            }
            let to = grid.edge.voxel_index(corner[0] + at[0], corner[1] + at[1], corner[2] + at[2]);
            samples[to] = (f64::from(sum) / ratio.pow(4) as f64).round() as i16;
            if 2 * unobserved < ratio.pow(3) {
                hidden.remove(to);
            }
        }
    }
    let mut builder = VolumeBuilder::new(*grid);
    for (coord, (samples, hidden)) in groups {
        builder.push(coord.into(), samples, Some(hidden));
    }
    builder.finish()
}

fn full_mask(grid: &Grid) -> VoxelMask {
    let mut mask = VoxelMask::empty(grid.edge);
    (0..grid.edge.block_voxels()).for_each(|voxel| mask.insert(voxel));
    mask
}

/// Root mean square and mean of the difference of two fields, in voxels, where the first is within 0.9 voxel of its surface.
fn difference(a: &SparseVolume, b: &SparseVolume) -> (f64, f64) {
    assert_eq!(a.coords(), b.coords());
    let (mut squares, mut sum, mut count) = (0.0, 0.0, 0.0);
    for block in 0..a.block_count() {
        for (voxel, (p, q)) in a.block(block).iter().zip(b.block(block)).enumerate() {
            if p.abs() <= 230 && a.unobserved(block).is_none_or(|mask| !mask.contains(voxel)) {
                let difference = (f64::from(*q) - f64::from(*p)) / 256.0;
                squares += difference * difference;
                sum += difference;
                count += 1.0;
            }
        }
    }
    ((squares / count).sqrt(), sum / count)
}

fn error_mm(mesh: &TriangleMesh, volume: &SparseVolume) -> Result<f64> {
    let surface = extract_surface(volume, &SurfaceOptions::default());
    let error = compare(mesh, &surface, &CompareOptions::default()).context("a surface to compare")?;
    Ok(error.p2s_mean_mm.expect("both are surfaces"))
}
