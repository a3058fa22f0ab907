//! Many frames through one encoder and one decoder. Memory stays as it was after the first loop of the take,
//! and every frame has the hash that the encoder states. A decoder that begins anew ends where this one does.
//!
//! Three loops of 30 frames a run, or as many as `ISV_SOAK_FRAMES` says; `docs/results/soak.md` has those of 10,000.

use isv::raw::decode::{Decoder, Limits, volume_hash};
use isv::raw::encode::{Encoder, EncoderSettings, Preset};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, decide_sign, ingest_mesh};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use isv_testkit::{Need, capture, skip, still_and_moving_ball};
use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// No keyframe but the first.
const ONE_GROUP: u32 = u32::MAX;
/// Frames of a take, which is looped forth and back.
const TAKE: usize = 16;

fn frames() -> u64 {
    std::env::var("ISV_SOAK_FRAMES").map_or(90, |frames| frames.parse().expect("a number of frames"))
}

fn grid(voxel_m: f64) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

fn ingest(meshes: &[TriangleMesh], voxel_m: f64) -> Vec<SparseVolume> {
    let settings = MeshIngest::new(grid(voxel_m));
    let sign = decide_sign(&meshes[0], settings.sign).0;
    meshes.iter().map(|mesh| ingest_mesh(mesh, &settings, sign).unwrap()).collect()
}

/// A ball that stands still and one that moves: most cells stay as they were, however long ago that was.
fn balls() -> Option<Vec<SparseVolume>> {
    Some((0..TAKE).map(|frame| still_and_moving_ball(grid(0.005), frame as f64)).collect())
}

/// The project's own figure, all of which moves.
fn figure() -> Option<Vec<SparseVolume>> {
    let voxel = VoxelSize::from_metres(0.012).unwrap();
    let meshes: Vec<_> = (0..TAKE).map(|frame| isv_figure::figure_mesh(frame as f64 / 30.0, voxel)).collect();
    Some(ingest(&meshes, 0.012))
}

/// A capture, if there is one.
fn dancer() -> Option<Vec<SparseVolume>> {
    let paths = FrameSequence::open(capture("dancer")?).unwrap();
    let meshes: Vec<_> =
        paths.paths()[..TAKE].iter().map(|path| read_mesh(path, Unit::Metre).unwrap()).collect();
    Some(ingest(&meshes, 0.01))
}

fn paper() -> Profile {
    Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 })
}

/// Memory of this process in MB, where the system says it.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes =
        status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?.trim().strip_suffix(" kB")?;
    Some(kilobytes.parse::<f64>().ok()? * 1024.0 / 1e6)
}

/// The frame of the take that comes at a place: forth, back, and forth again.
fn looped(place: u64, take: &[SparseVolume]) -> &SparseVolume {
    let (turn, last) = (2 * (take.len() as u64 - 1), take.len() as u64 - 1);
    let step = place % turn;
    &take[step.min(turn - step).min(last) as usize]
}

/// Codes and decodes the take over and over, by way of a file that grows.
fn soak(name: &str, profile: Profile, gop: u32, take: impl FnOnce() -> Option<Vec<SparseVolume>>) {
    static TURN: Mutex<()> = Mutex::new(());
    // Memory is that of the process: one at a time, its take included.
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(take) = take() else { return };
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("soak-{name}.isv"));
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(profile, *take[0].grid(), frame_rate);
    let main = Preset::Realtime.settings();
    let settings = EncoderSettings { gop, checksums: true, main, ..EncoderSettings::default() };
    let mut encoder = Encoder::new(&header, settings);
    let mut writer = PacketWriter::new(File::create(&path).unwrap(), &header).unwrap();
    let mut reader = PacketReader::new(File::open(&path).unwrap()).unwrap();
    let mut decoder = Decoder::new(&header, Limits::default());
    let (frames, loop_frames, started) = (frames(), 2 * (take.len() as u64 - 1), Instant::now());
    let (mut first_loop, mut after) = (0.0f64, 0.0f64);
    let (mut bytes, mut bytes_first_loop) = (0, 0);
    let mut hash = 0;
    for frame in 0..frames {
        let coded = encoder.encode(looped(frame, &take));
        assert_eq!(coded.keyframe, frame % u64::from(gop) == 0, "{name}: frame {frame}");
        bytes +=
            writer.write_frame(coded.keyframe, frame_rate.timestamp_ns(frame), &coded.payload()).unwrap();
        let packet = reader.next_frame().unwrap().expect("the packet that was just written");
        let decoded = decoder.decode_and_verify(&packet).unwrap();
        assert!(decoded.stated_hash.is_some());
        hash = volume_hash(decoded.volume);
        let memory = memory_mb().unwrap_or(0.0);
        if frame < loop_frames {
            (first_loop, bytes_first_loop) = (first_loop.max(memory), bytes);
        } else {
            after = after.max(memory);
        }
        if (frame + 1) % (frames / 10).max(1) == 0 {
            println!("{name}: {} frames, {memory:.1} MB, {bytes} bytes", frame + 1);
        }
    }
    writer.finish().unwrap();
    assert!(reader.next_frame().unwrap().is_none() && reader.complete());
    let seconds = started.elapsed().as_secs_f64();
    let mut reader = PacketReader::new(std::io::BufReader::new(File::open(&path).unwrap())).unwrap();
    let mut fresh = Decoder::new(&header, Limits::default());
    let mut count = 0;
    while let Some(packet) = reader.next_frame().unwrap() {
        fresh.decode_and_verify(&packet).unwrap();
        count += 1;
    }
    assert_eq!((count, volume_hash(fresh.volume().unwrap())), (frames, hash), "{name}");
    std::fs::remove_file(&path).unwrap();
    println!(
        "| {name} | {frames} | {first_loop:.1} | {after:.1} | {:.0} | {:.0} | {:.1} | `{hash:016x}` |",
        bytes_first_loop as f64 / loop_frames as f64,
        bytes as f64 / frames as f64,
        seconds * 1e3 / frames as f64,
    );
    match memory_mb() {
        None => skip(Need::MemoryUse, "this system does not say how much memory a process has"),
        Some(_) => {
            let allowed = 1.05 * first_loop + 8.0;
            assert!(after <= allowed, "{name}: {first_loop:.1} MB in the first loop, {after:.1} MB after it");
        }
    }
}

#[test]
fn balls_in_main() {
    soak("balls_in_main", Profile::Main, EncoderSettings::default().gop, balls);
}

#[test]
fn balls_in_main_in_one_group() {
    soak("balls_in_main_in_one_group", Profile::Main, ONE_GROUP, balls);
}

#[test]
fn balls_in_paper() {
    soak("balls_in_paper", paper(), EncoderSettings::default().gop, balls);
}

#[test]
fn balls_in_paper_in_one_group() {
    soak("balls_in_paper_in_one_group", paper(), ONE_GROUP, balls);
}

#[test]
fn figure_in_main() {
    soak("figure_in_main", Profile::Main, EncoderSettings::default().gop, figure);
}

#[test]
fn figure_in_main_in_one_group() {
    soak("figure_in_main_in_one_group", Profile::Main, ONE_GROUP, figure);
}

#[test]
fn figure_in_paper_in_one_group() {
    soak("figure_in_paper_in_one_group", paper(), ONE_GROUP, figure);
}

#[test]
fn capture_in_main() {
    soak("capture_in_main", Profile::Main, EncoderSettings::default().gop, dancer);
}

#[test]
fn capture_in_main_in_one_group() {
    soak("capture_in_main_in_one_group", Profile::Main, ONE_GROUP, dancer);
}
