//! How time and memory grow with a scene: `cargo bench -p isv --bench scale`.
//!
//! - Waves on water, 1 to 64 times the area: what a frame costs for each of its blocks, all of which move.
//! - A street of 100 x 100 x 20 m at 5 cm in which cars drive, and the building `monastery` at 5 mm. The
//!   building is measured if it is there (`ISV_DATA`, else `../shared/data`). Measured are the time of a
//!   keyframe and of the frames after it, and memory at its peak.
//!
//! Preset `realtime`. Each scene is measured in a process of its own, so that its peak memory is its own. With the name of a scene,
//! only that one is.

use anyhow::{Context, Result, ensure};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, MeshIngester, Reach, decide_sign};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use isv_testkit::capture;
use std::process::Command;
use std::time::Instant;

/// Along an edge of the water, in metres: 1 to 64 times the area.
const SIDES_M: [f64; 4] = [4.0, 8.0, 16.0, 32.0];
const WAVES_VOXEL_M: f64 = 0.02;
/// Frames of the water and of the scenes. The first one is a keyframe.
const WAVES_FRAMES: usize = 9;
const SCENE_FRAMES: usize = 4;
const FRAME_S: f64 = 1.0 / 30.0;
/// Tells a process which scene is its own.
const SCENE: &str = "ISV_SCALE_SCENE";
/// More blocks than ingest makes if it is not told to.
const MAX_BLOCKS: usize = 1 << 23;

fn main() -> Result<()> {
    if let Ok(scene) = std::env::var(SCENE) {
        return measure(&scene);
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    println!(
        "{} threads; milliseconds a frame, and microseconds a coded block",
        std::thread::available_parallelism()?
    );
    println!(
        "\n| scene | blocks, coded first and later | ingest | encode | decode | ingest, later | encode, later | decode, later | \
         µs a block later: ingest | encode | decode | kB, first and later | peak encoding | decoding, MB |\n|{}",
        "---|".repeat(14)
    );
    let waves = SIDES_M.map(|side_m| format!("waves {side_m}"));
    for scene in waves.iter().map(String::as_str).chain(["street", "monastery"]) {
        if wanted.is_empty() || wanted.iter().any(|name| scene.starts_with(name)) {
            let status = Command::new(std::env::current_exe()?).env(SCENE, scene).status()?;
            ensure!(status.success(), "{scene}: {status}");
        }
    }
    Ok(())
}

/// A scene: its voxels, and its frames.
struct Scene {
    voxel_m: f64,
    frames: usize,
    mesh: Box<dyn Fn(usize) -> Result<TriangleMesh>>,
}

/// The scene of a name, unless it is a capture that is not there.
fn scene(name: &str) -> Result<Option<Scene>> {
    if let Some(side_m) = name.strip_prefix("waves ") {
        let side_m = side_m.parse()?;
        let mesh = move |n| Ok(isv_testkit::waves(side_m, n as f64 * FRAME_S));
        return Ok(Some(Scene { voxel_m: WAVES_VOXEL_M, frames: WAVES_FRAMES, mesh: Box::new(mesh) }));
    }
    if name == "street" {
        let mesh = |n| Ok(isv_testkit::street(100.0, n as f64 * FRAME_S));
        return Ok(Some(Scene { voxel_m: 0.05, frames: SCENE_FRAMES, mesh: Box::new(mesh) }));
    }
    let Some(folder) = capture(name) else { return Ok(None) };
    let paths = FrameSequence::open(&folder)?;
    let mesh = move |n: usize| Ok(read_mesh(&paths.paths()[n], Unit::Metre)?);
    Ok(Some(Scene { voxel_m: 0.005, frames: SCENE_FRAMES, mesh: Box::new(mesh) }))
}

/// Milliseconds of the first frame and the median of those after it.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn of<T>(&mut self, step: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = step();
        self.0.push(start.elapsed().as_secs_f64() * 1e3);
        result
    }

    fn first(&self) -> f64 {
        self.0[0]
    }

    fn later(&self) -> f64 {
        let mut later = self.0[1..].to_vec();
        later.sort_by(f64::total_cmp);
        later[later.len() / 2]
    }
}

fn measure(name: &str) -> Result<()> {
    let Some(Scene { voxel_m, frames, mesh }) = scene(name)? else { return Ok(()) };
    let truncation = Truncation::DEFAULT;
    let grid = Grid { voxel_size: VoxelSize::from_metres(voxel_m)?, edge: BlockEdge::E8, truncation };
    let header = StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT);
    let settings = MeshIngest { reach: Reach::Surface, max_blocks: MAX_BLOCKS, ..MeshIngest::new(grid) };
    let mut ingester = MeshIngester::new(settings);
    let settings = EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() };
    let mut encoder = Encoder::new(&header, settings);
    let mut writer = PacketWriter::new(Vec::new(), &header)?;
    let (mut ingest, mut encode, mut decode) = (Times::default(), Times::default(), Times::default());
    let (mut blocks, mut sizes, mut sign) = (Vec::new(), Vec::new(), None);
    for n in 0..frames {
        let mesh = mesh(n)?;
        let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, Default::default()).0);
        let volume = ingest.of(|| ingester.ingest(&mesh, sign))?;
        let frame = encode.of(|| encoder.encode(&volume));
        blocks.push(frame.payload().header.blocks);
        sizes.push(frame.payload().to_bytes().len() / 1000);
        writer.write_frame(frame.keyframe, header.frame_rate.timestamp_ns(n as u64), &frame.payload())?;
    }
    drop((encoder, ingester));
    let encoding_mb = peak_mb(true)?;
    let stream = writer.finish()?;
    let (mut reader, mut decoder) =
        (PacketReader::new(&stream[..])?, Decoder::new(&header, Limits::default()));
    while let Some(packet) = reader.next_frame()? {
        decode.of(|| decoder.decode(&packet).map(drop))?;
    }
    let decoding_mb = peak_mb(false)?;
    let (last, later_blocks) = (frames - 1, f64::from(blocks[frames - 1].max(1)));
    let [a, b, c] = [&ingest, &encode, &decode].map(|times| format!("{:.1}", times.first()));
    let [d, e, f] = [&ingest, &encode, &decode].map(|times| format!("{:.1}", times.later()));
    let [g, h, i] =
        [&ingest, &encode, &decode].map(|times| format!("{:.2}", times.later() * 1e3 / later_blocks));
    println!(
        "| {name} | {}, {} | {a} | {b} | {c} | {d} | {e} | {f} | {g} | {h} | {i} | {}, {} | {encoding_mb} | {decoding_mb} |",
        blocks[0], blocks[last], sizes[0], sizes[last]
    );
    Ok(())
}

/// Most memory that the process had at one time, in megabytes, since it began or since this was last asked
/// with `forget`. It is `-` where the system does not tell.
fn peak_mb(forget: bool) -> Result<String> {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return Ok("-".to_owned()) };
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes: u64 = peak.and_then(|peak| peak.split_whitespace().next()).context("a peak")?.parse()?;
    if forget {
        std::fs::write("/proc/self/clear_refs", "5")?;
    }
    Ok((kilobytes * 1024 / 1_000_000).to_string())
}
