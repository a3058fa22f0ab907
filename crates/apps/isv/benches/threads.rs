//! What a second thread brings: `cargo bench -p isv --bench threads`.
//!
//! A person is ingested, encoded, decoded and extracted by one thread and by two, frame by frame in turn, preset `realtime`. The capture
//! `dancer` where it is (`ISV_DATA`, else `../shared/data`), else the project's own figure. Medians of the frames after the first.

use anyhow::{Context, Result, ensure};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{EncodedFrame, Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, Packet, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, MeshIngester, Reach, SignDecision, decide_sign};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use isv_testkit::capture;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::time::Instant;

const FRAMES: usize = 16;
const THREADS: [usize; 2] = [1, 2];
const STAGES: [&str; 4] = ["ingest", "encode", "decode", "surface"];

fn main() -> Result<()> {
    let (name, voxel_m, meshes) = take()?;
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_m)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let mut sides = [Side::new(grid, THREADS[0], &meshes)?, Side::new(grid, THREADS[1], &meshes)?];
    let mut times = vec![[[0.0; STAGES.len()]; THREADS.len()]; meshes.len()];
    for (mesh, times) in meshes.iter().zip(&mut times) {
        for (side, times) in sides.iter_mut().zip(times) {
            [times[0], times[1]] = side.encode(mesh)?;
        }
    }
    let streams = sides.iter().map(Side::stream).collect::<Result<Vec<_>>>()?;
    ensure!(streams[0] == streams[1], "the number of threads changes the stream");
    let mut reader = PacketReader::new(&streams[0][..])?;
    for times in &mut times {
        let packet = reader.next_frame()?.context("as many packets as frames")?;
        for (side, times) in sides.iter_mut().zip(times) {
            [times[2], times[3]] = side.decode(&packet)?;
        }
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
    let Some(folder) = capture("dancer") else {
        let voxel = VoxelSize::from_metres(0.006)?;
        let meshes = (0..FRAMES).map(|n| isv_figure::figure_mesh(n as f64 / 30.0, voxel));
        return Ok(("figure", 0.006, meshes.collect()));
    };
    let paths = FrameSequence::open(&folder)?;
    let meshes = paths.paths().iter().take(FRAMES).map(|path| read_mesh(path, Unit::Metre));
    Ok(("dancer", 0.005, meshes.collect::<Result<_, _>>()?))
}

/// A whole codec with threads of its own.
struct Side {
    pool: ThreadPool,
    ingester: MeshIngester,
    sign: SignDecision,
    header: StreamHeader,
    encoder: Encoder,
    frames: Vec<EncodedFrame>,
    decoder: Decoder,
}

impl Side {
    fn new(grid: Grid, threads: usize, meshes: &[TriangleMesh]) -> Result<Self> {
        let ingest = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
        let frame_rate = FrameRate::DEFAULT;
        let header = StreamHeader::new(Profile::Main, grid, frame_rate);
        let settings = EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() };
        Ok(Self {
            pool: ThreadPoolBuilder::new().num_threads(threads).build()?,
            ingester: MeshIngester::new(ingest),
            sign: decide_sign(meshes.first().context("a take has frames")?, ingest.sign).0,
            header,
            encoder: Encoder::new(&header, settings),
            frames: Vec::new(),
            decoder: Decoder::new(&header, Limits::default()),
        })
    }

    /// How long a frame's ingest and encoding take, in milliseconds.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<[f64; 2]> {
        let Self { pool, ingester, sign, encoder, frames, .. } = self;
        let (volume, ingest_ms) = timed(|| pool.install(|| ingester.ingest(mesh, *sign)));
        let volume = volume?;
        let (frame, encode_ms) = timed(|| pool.install(|| encoder.encode(&volume)));
        frames.push(frame);
        Ok([ingest_ms, encode_ms])
    }

    fn stream(&self) -> Result<Vec<u8>> {
        let mut writer = PacketWriter::new(Vec::new(), &self.header)?;
        for (n, frame) in self.frames.iter().enumerate() {
            writer.write_frame(frame.keyframe, n as u64 * 33_333_333, &frame.payload())?;
        }
        Ok(writer.finish()?)
    }

    /// How long decoding a frame and extracting its surface take, in milliseconds.
    fn decode(&mut self, packet: &Packet) -> Result<[f64; 2]> {
        let Self { pool, decoder, .. } = self;
        let (frame, decode_ms) = timed(|| pool.install(|| decoder.decode(packet)));
        let volume = frame?.volume;
        let extract = || extract_surface(volume, &SurfaceOptions::default());
        let (_, surface_ms) = timed(|| pool.install(extract));
        Ok([decode_ms, surface_ms])
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
