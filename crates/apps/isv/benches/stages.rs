//! Time of the codec, stage by stage, next to what the machine could do at best: `cargo bench -p isv`.
//!
//! The project's own figure is always measured. Captures are measured if they are there (`ISV_DATA`, else
//! `../shared/data`): a person, the same person with nine times the faces, and a building. One table each,
//! preset `realtime`, frames after the first. Stages are means and count in full where they run side by side;
//! wholes are medians.

use anyhow::{Context, Result};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, MeshIngester, Reach, decide_sign};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::kernels::simd::{self, vectorized};
use isv::raw::surface::{SurfaceOptions, SurfaceParts, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use isv_baseline::Draco;
use isv_study::Stages;
use isv_testkit::capture;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

/// Frames of a take, the first of which is not counted: of people, and of the building, whose volumes fill gigabytes.
const FRAMES: usize = 9;
const LARGE_FRAMES: usize = 3;
/// How deep the fine person is dented, in metres.
const DENTS_M: f64 = 0.0005;
/// Bits of a position in Draco, about a step of 0.1 mm for a person.
const DRACO_BITS: u8 = 14;
/// Multiply-adds of a block's 3-D DCT as three products with a matrix.
const DCT_MULTIPLY_ADDS: usize = 3 * 512 * 8;

fn main() -> Result<()> {
    simd::choose_by_environment()?;
    let stages = Stages::listen();
    println!("{} threads, {} instructions", std::thread::available_parallelism()?, simd::in_use());
    let figure = (0..FRAMES).map(|n| isv_figure::figure_mesh(n as f64 / 30.0, voxels(0.006)));
    measure("figure", 0.006, &figure.collect::<Vec<_>>(), &stages)?;
    let takes =
        [("dancer", 0.005, FRAMES), ("monastery", 0.02, LARGE_FRAMES), ("monastery", 0.01, LARGE_FRAMES)];
    for (name, voxel_m, frames) in takes {
        let Some(folder) = capture(name) else { continue };
        let paths = FrameSequence::open(&folder)?;
        let meshes = paths.paths().iter().take(frames).map(|path| read_mesh(path, Unit::Metre));
        let meshes = meshes.collect::<Result<Vec<_>, _>>()?;
        measure(name, voxel_m, &meshes, &stages)?;
        if name == "dancer" {
            let fine: Vec<_> = meshes.iter().map(|mesh| isv_testkit::finer(mesh, DENTS_M)).collect();
            measure("dancer, nine times the faces", voxel_m, &fine, &stages)?;
        }
    }
    Ok(())
}

fn voxels(metres: f64) -> VoxelSize {
    VoxelSize::from_metres(metres).expect("a voxel size in range")
}

/// Measures a take and prints its table.
fn measure(name: &str, voxel_m: f64, meshes: &[TriangleMesh], stages: &Stages) -> Result<()> {
    let truncation = Truncation::DEFAULT;
    let grid = Grid { voxel_size: voxels(voxel_m), edge: BlockEdge::E8, truncation };
    let mut table = Table::default();
    let volumes = ingest(grid, meshes, &mut table)?;
    let (stream, blocks) = encode(grid, &volumes, stages, &mut table)?;
    let last = decode(&stream, stages, &mut table)?;
    surface_parts(&stream, &mut table)?;
    floors(&last, blocks, &mut table);
    draco(meshes.last().context("a take has frames")?, &mut table)?;
    let faces = meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>() / meshes.len();
    println!(
        "\n## {name}, {} mm: {faces} faces, {} blocks in the band, {blocks} coded\n",
        voxel_m * 1e3,
        volumes.iter().map(SparseVolume::block_count).sum::<usize>() / volumes.len(),
    );
    table.print(blocks);
    Ok(())
}

fn ingest(grid: Grid, meshes: &[TriangleMesh], table: &mut Table) -> Result<Vec<SparseVolume>> {
    // As far as what is coded.
    let settings = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
    let sign = decide_sign(meshes.first().context("a take has frames")?, settings.sign).0;
    let mut ingester = MeshIngester::new(settings);
    let (mut volumes, mut times) = (Vec::new(), Vec::new());
    for mesh in meshes {
        let (volume, ms) = timed(|| ingester.ingest(mesh, sign));
        volumes.push(volume?);
        times.push(ms);
    }
    table.whole("ingest", times);
    Ok(volumes)
}

/// The stream, and how many blocks a frame has on average.
fn encode(
    grid: Grid,
    volumes: &[SparseVolume],
    stages: &Stages,
    table: &mut Table,
) -> Result<(Vec<u8>, usize)> {
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(Profile::Main, grid, frame_rate);
    let settings = EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() };
    let mut encoder = Encoder::new(&header, settings);
    let mut writer = PacketWriter::new(Vec::new(), &header)?;
    let (mut times, mut blocks) = (Vec::new(), 0);
    for (n, volume) in volumes.iter().enumerate() {
        let (frame, ms) = timed(|| encoder.encode(volume));
        if n == 0 {
            drop(stages.take_milliseconds());
        }
        blocks += frame.payload().header.blocks as usize;
        writer.write_frame(frame.keyframe, n as u64 * 33_333_333, &frame.payload())?;
        times.push(ms);
    }
    table.whole("encode", times);
    table.stages(stages.take_milliseconds(), volumes.len() - 1);
    Ok((writer.finish()?, blocks / volumes.len()))
}

/// Decodes the stream and extracts its surface; the last volume.
fn decode(stream: &[u8], stages: &Stages, table: &mut Table) -> Result<SparseVolume> {
    let mut reader = PacketReader::new(stream)?;
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    let (mut decode_times, mut surface_times, mut last) = (Vec::new(), Vec::new(), None);
    while let Some(packet) = reader.next_frame()? {
        let is_first = last.is_none();
        // Who keeps a frame keeps its memory from serving the next one.
        drop(last.take());
        let (frame, ms) = timed(|| decoder.decode(&packet));
        let volume = frame?.volume;
        decode_times.push(ms);
        surface_times.push(timed(|| extract_surface(volume, &SurfaceOptions::default())).1);
        if is_first {
            drop(stages.take_milliseconds());
        }
        last = Some(volume.clone());
    }
    let frames = decode_times.len() - 1;
    table.whole("decode", decode_times);
    table.stages(stages.take_milliseconds(), frames);
    table.whole("surface", surface_times);
    last.context("a stream with frames")
}

/// Decodes the stream once more, and extracts those parts of its surface that changed.
fn surface_parts(stream: &[u8], table: &mut Table) -> Result<()> {
    let mut reader = PacketReader::new(stream)?;
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    let mut parts = SurfaceParts::new(SurfaceOptions::default());
    let mut times = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        let volume = decoder.decode(&packet)?.volume;
        times.push(timed(|| parts.update(volume)).1);
    }
    table.whole("surface, the parts that changed", times);
    Ok(())
}

/// A copy of all samples.
fn copied(volume: &SparseVolume) -> Vec<i16> {
    let mut samples = Vec::with_capacity(volume.sample_count());
    (0..volume.block_count()).for_each(|block| samples.extend_from_slice(volume.block(block)));
    samples
}

/// Floors: what the machine could do at best, on all threads. The bytes of a decoded volume are copied, and
/// each coded block is transformed at the speed of multiply-adds that wait for nothing.
fn floors(volume: &SparseVolume, blocks: usize, table: &mut Table) {
    let copies = (0..FRAMES).map(|_| timed(|| black_box(copied(black_box(volume)))).1);
    table.whole("floor: the decoded volume copied", copies.collect());
    let transforms = (0..FRAMES).map(|_| {
        timed(|| (0..blocks).into_par_iter().with_min_len(16).for_each(|_| multiply_adds(DCT_MULTIPLY_ADDS)))
            .1
    });
    table.whole("floor: arithmetic of a DCT of each block", transforms.collect());
}

/// So many multiply-adds, in chains enough to keep any machine busy.
fn multiply_adds(count: usize) {
    vectorized(
        #[inline(always)]
        || {
            let (factor, mut sums) = (black_box(0.999_f32), [1.0_f32; 64]);
            for _ in 0..count / 64 {
                for sum in &mut sums {
                    *sum = *sum * factor + 1.0;
                }
            }
            black_box(sums);
        },
    );
}

/// Draco's programs on the same mesh, if they are there, their reading and writing of files included.
fn draco(mesh: &TriangleMesh, table: &mut Table) -> Result<()> {
    let Some(draco) = Draco::find() else { return Ok(()) };
    let coded = draco.encode(mesh, DRACO_BITS)?;
    let decoded = draco.decode(&coded.output)?;
    table.whole("draco_encoder, the whole program", vec![coded.ms; 2]);
    table.whole("draco_decoder, the whole program", vec![decoded.ms; 2]);
    Ok(())
}

fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

/// Rows of names and milliseconds a frame.
#[derive(Default)]
struct Table(Vec<(String, f64)>);

impl Table {
    /// The median of all times but the first.
    fn whole(&mut self, name: &str, times: Vec<f64>) {
        let mut times: Vec<_> = times.into_iter().skip(1).collect();
        times.sort_by(f64::total_cmp);
        self.0.push((format!("**{name}**"), times.get(times.len() / 2).copied().unwrap_or(f64::NAN)));
    }

    /// Stages over so many frames.
    fn stages(&mut self, stages: BTreeMap<&str, f64>, frames: usize) {
        self.0.extend(stages.into_iter().map(|(name, ms)| (name.to_owned(), ms / frames as f64)));
    }

    fn print(&self, blocks: usize) {
        println!("| stage | ms a frame | ns a coded block |\n|---|---|---|");
        for (name, ms) in &self.0 {
            println!("| {name} | {ms:.2} | {:.0} |", ms * 1e6 / blocks.max(1) as f64);
        }
    }
}
