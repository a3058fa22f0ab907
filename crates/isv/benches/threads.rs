//! What a second thread brings: `cargo bench -p isv --bench threads`.
//!
//! A person is ingested, encoded, decoded and extracted by one thread and by two, frame by frame in turn, preset `realtime`. The capture
//! `dancer` where it is (`ISV_DATA`, else `../shared/data`), else the project's own figure. Medians of the frames after the first.

use anyhow::{Context, Result, ensure};
use isv::decode::{Decoder, Limits, volume_hash};
use isv::encode::{Encoder, EncoderSettings, Preset};
use isv::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::ingest::{MeshIngest, MeshIngester, Reach, decide_sign};
use isv::io::{FrameSequence, Unit, read_mesh};
use isv::surface::{SurfaceOptions, extract_surface};
use isv::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::path::{Path, PathBuf};
use std::time::Instant;

const FRAMES: usize = 16;
const THREADS: [usize; 2] = [1, 2];
const STAGES: [&str; 4] = ["ingest", "encode", "decode", "surface"];

fn main() -> Result<()> {
    let (name, voxel_m, meshes) = take()?;
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_m)?,
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8).context("a truncation in range")?,
    };
    let mut sides = [Side::new(grid, THREADS[0], &meshes)?, Side::new(grid, THREADS[1], &meshes)?];
    let mut times: Vec<[[f64; STAGES.len()]; THREADS.len()]> = Vec::new();
    for mesh in &meshes {
        let mut frame = [[0.0; STAGES.len()]; THREADS.len()];
        let mut hashes = Vec::new();
        for (side, times) in sides.iter_mut().zip(&mut frame) {
            hashes.push(side.code(mesh, times)?);
        }
        ensure!(hashes[0] == hashes[1], "the number of threads changes the result");
        times.push(frame);
    }
    println!("{name}, {} mm; {} cores; ms a frame\n", voxel_m * 1e3, std::thread::available_parallelism()?);
    println!("| stage | 1 thread | 2 threads | times as fast |\n|---|---|---|---|");
    for (stage, name) in STAGES.iter().enumerate() {
        let [one, two] = [0, 1].map(|side| median(times.iter().skip(1).map(|frame| frame[side][stage])));
        println!("| {name} | {one:.1} | {two:.1} | {:.2} |", one / two);
    }
    let [one, two] = [0, 1].map(|side| median(times.iter().skip(1).map(|frame| frame[side].iter().sum())));
    println!("| all of them | {one:.1} | {two:.1} | {:.2} |", one / two);
    Ok(())
}

/// What is measured: its name, the voxel in metres, and its frames.
fn take() -> Result<(&'static str, f64, Vec<TriangleMesh>)> {
    let data = std::env::var_os("ISV_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    let folder = data.join("dancer");
    if !folder.is_dir() {
        println!("skipped: no {}", folder.display());
        let voxel = VoxelSize::from_metres(0.006)?;
        let meshes = (0..FRAMES).map(|n| isv_figure::figure_mesh(n as f64 / 30.0, voxel));
        return Ok(("figure", 0.006, meshes.collect()));
    }
    let paths = FrameSequence::open(folder.to_str().context("a folder whose name is text")?)?;
    let meshes = paths.paths().iter().take(FRAMES).map(|path| read_mesh(path, Unit::Metre));
    Ok(("dancer", 0.005, meshes.collect::<Result<_, _>>()?))
}

/// A whole codec with threads of its own.
struct Side {
    pool: ThreadPool,
    ingester: MeshIngester,
    sign: isv::ingest::SignDecision,
    header: StreamHeader,
    encoder: Encoder,
    decoder: Decoder,
}

impl Side {
    fn new(grid: Grid, threads: usize, meshes: &[TriangleMesh]) -> Result<Self> {
        let ingest = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
        let frame_rate = FrameRate { numerator: 30, denominator: 1 };
        let header = StreamHeader { profile: Profile::Main, grid, frame_rate };
        let settings = EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() };
        Ok(Self {
            pool: ThreadPoolBuilder::new().num_threads(threads).build()?,
            ingester: MeshIngester::new(ingest),
            sign: decide_sign(meshes.first().context("a take has frames")?, ingest.sign).0,
            header,
            encoder: Encoder::new(&header, settings),
            decoder: Decoder::new(&header, Limits::default()),
        })
    }

    /// Takes a frame through the codec; the hash of what comes out.
    fn code(&mut self, mesh: &TriangleMesh, times: &mut [f64; STAGES.len()]) -> Result<u64> {
        let Self { pool, ingester, sign, header, encoder, decoder } = self;
        let (volume, ingest_ms) = timed(|| pool.install(|| ingester.ingest(mesh, *sign)));
        let volume = volume?;
        let (frame, encode_ms) = timed(|| pool.install(|| encoder.encode(&volume)));
        let mut writer = PacketWriter::new(Vec::new(), header)?;
        writer.write_frame(frame.keyframe, 0, &frame.payload())?;
        let stream = writer.finish()?;
        let packet = PacketReader::new(&stream[..])?.next_frame()?.context("a frame")?;
        let (decoded, decode_ms) = timed(|| pool.install(|| decoder.decode(&packet)));
        let decoded = decoded?;
        let extract = || extract_surface(decoded.volume, &SurfaceOptions::default());
        let (_, surface_ms) = timed(|| pool.install(extract));
        *times = [ingest_ms, encode_ms, decode_ms, surface_ms];
        Ok(volume_hash(decoded.volume))
    }
}

fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

fn median(times: impl Iterator<Item = f64>) -> f64 {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}
