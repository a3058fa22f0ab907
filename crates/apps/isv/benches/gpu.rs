//! What the GPU takes for each frame: `cargo bench -p isv --features gpu --bench gpu`.
//!
//! The best GPU that there is, be it one in software, or the one whose name has `ISV_GPU` in it. The
//! project's own figure is always measured. Captures are measured if they are there (`ISV_DATA`, else
//! `../shared/data`): a person, the same person with nine times the faces, and a building. For each, meshes
//! become volumes. Frames of profile `main` at preset `realtime`, and of profile `paper` with 3-DoF, are
//! encoded and decoded on the CPU and on the GPU. Their surfaces are extracted there too; the first frame is
//! not counted. Kernels are timed by the GPU's own clock in a run of their own. The least that they must read
//! and write is set against the rate at which the GPU copies.

use anyhow::{Context, Result};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{EncodedFrame, Encoder, EncoderSettings, FrameWriter, MotionMode, Preset};
use isv::raw::format::{
    FrameRate, Packet, PacketReader, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader,
};
use isv::raw::gpu::{
    Gpu, GpuBackend, GpuChoice, GpuError, GpuMeshIngester, GpuSurfaceExtractor, KernelTime, VolumeStore,
    frame_coder,
};
use isv::raw::ingest::{MeshIngest, MeshIngester, Reach, SignDecision, SignMode, decide_sign};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use isv_testkit::capture;
use std::collections::BTreeMap;
use std::time::Instant;

/// Frames of a take, the first of which is not counted.
const FRAMES: usize = 9;
const LARGE_FRAMES: usize = 3;
/// How deep the fine person is dented, in metres.
const DENTS_M: f64 = 0.0005;

fn main() -> Result<()> {
    let gpu = match open() {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("skipped: {error}");
            return Ok(());
        }
    };
    let (report, copy_rate) = (gpu.report(), gpu.copy_rate()?);
    println!(
        "{} ({}, {}, {}); copies {:.1} GB/s",
        report.name,
        report.kind,
        report.api,
        report.driver,
        copy_rate / 1e9
    );
    let figure = (0..FRAMES).map(|n| isv_figure::figure_mesh(n as f64 / 30.0, voxels(0.006)));
    measure("figure", 0.006, &figure.collect::<Vec<_>>(), copy_rate)?;
    for (name, voxel_m, frames) in [("dancer", 0.005, FRAMES), ("monastery", 0.01, LARGE_FRAMES)] {
        let Some(folder) = capture(name) else { continue };
        let paths = FrameSequence::open(&folder)?;
        let meshes = paths.paths().iter().take(frames).map(|path| read_mesh(path, Unit::Metre));
        let meshes = meshes.collect::<Result<Vec<_>, _>>()?;
        measure(name, voxel_m, &meshes, copy_rate)?;
        if name == "dancer" {
            let fine: Vec<_> = meshes.iter().map(|mesh| isv_testkit::finer(mesh, DENTS_M)).collect();
            measure("dancer, nine times the faces", voxel_m, &fine, copy_rate)?;
        }
    }
    Ok(())
}

/// The best GPU, or the one that is named.
fn open() -> Result<Gpu, GpuError> {
    let name = std::env::var("ISV_GPU").ok();
    Gpu::open(&GpuChoice { name, software: true, ..GpuChoice::default() })
}

fn voxels(metres: f64) -> VoxelSize {
    VoxelSize::from_metres(metres).expect("a voxel size in range")
}

/// Measures a take in both profiles.
fn measure(name: &str, voxel_m: f64, meshes: &[TriangleMesh], copy_rate: f64) -> Result<()> {
    let truncation = Truncation::DEFAULT;
    let grid = Grid { voxel_size: voxels(voxel_m), edge: BlockEdge::E8, truncation };
    let paper = PaperParameters { coefficients: 48, dc_step: 819, ac_step: 8192 };
    let profiles = [("main", Profile::Main, Reach::Surface), ("paper", Profile::Paper(paper), Reach::Band)];
    for (profile_name, profile, reach) in profiles {
        let header = StreamHeader::new(profile, grid, FrameRate::DEFAULT);
        let ingest = Ingest::new(grid, reach, meshes)?;
        let (volumes, ingest_on_cpu) = ingest.on_cpu()?;
        let (stream, encode_on_cpu) = encode(&header, &volumes, |settings| {
            let mut encoder = Encoder::new(&header, settings);
            Ok(move |volume: &SparseVolume| Ok(encoder.encode(volume)))
        })?;
        let packets = packets(&stream)?;
        // Opened for itself, so that the most memory is that of this take and profile.
        let gpu = &open()?;
        let [cpu_decode, cpu_surface] = on_cpu(&header, &packets)?;
        let [gpu_decode, gpu_surface] = on_gpu(&header, &packets, gpu)?;
        let ingest_on_gpu = ingest.on_gpu(gpu)?;
        gpu.start_timing();
        on_gpu(&header, &packets, gpu)?;
        ingest.on_gpu(gpu)?;
        let mut kernels = gpu.take_times();
        let encode_on_gpu = || {
            let store = VolumeStore::new(gpu)?;
            let encoder = |settings| {
                let mut coder = frame_coder(&header, settings, &store)?;
                let mut writer = FrameWriter::default();
                anyhow::Ok(move |volume: &SparseVolume| Ok(writer.write(coder.code(volume)?)))
            };
            anyhow::Ok(encode(&header, &volumes, encoder)?.1)
        };
        let encode_ms = encode_on_gpu()?;
        let overlapped_ms = overlapped(&header, &volumes, gpu)?;
        gpu.start_timing();
        encode_on_gpu()?;
        kernels.extend(gpu.take_times());
        println!("\n## {name}, {} mm, profile {profile_name}\n", voxel_m * 1e3);
        println!("| ms a frame | CPU | GPU |\n|---|---|---|");
        println!("| mesh to volume, which stays there | {ingest_on_cpu:.2} | {ingest_on_gpu:.2} |");
        println!("| encode, volume to bytes | {encode_on_cpu:.2} | {encode_ms:.2} |");
        println!(
            "| encode, the mean of the take, symbols written while the next frame is coded | | {overlapped_ms:.2} |"
        );
        println!("| decode | {cpu_decode:.2} | {gpu_decode:.2} |");
        println!("| surface, which stays there | {cpu_surface:.2} | {gpu_surface:.2} |");
        let bytes = gpu.memory().peak;
        println!("\nmost memory of the GPU: {} MB\n", bytes.div_ceil(1_000_000));
        print_kernels(&kernels, packets.len(), copy_rate);
    }
    Ok(())
}

/// The meshes of a take on their way to volumes.
struct Ingest<'a> {
    settings: MeshIngest,
    sign: SignDecision,
    meshes: &'a [TriangleMesh],
}

impl<'a> Ingest<'a> {
    fn new(grid: Grid, reach: Reach, meshes: &'a [TriangleMesh]) -> Result<Self> {
        // Sheets are left to the CPU.
        let settings = MeshIngest { reach, sign: SignMode::Paper, ..MeshIngest::new(grid) };
        let sign = decide_sign(meshes.first().context("a take has frames")?, settings.sign).0;
        Ok(Self { settings, sign, meshes })
    }

    /// The volumes, and the median of the times.
    fn on_cpu(&self) -> Result<(Vec<SparseVolume>, f64)> {
        let mut ingester = MeshIngester::new(self.settings);
        let (mut volumes, mut times) = (Vec::new(), Vec::new());
        for mesh in self.meshes {
            let (volume, ms) = timed(|| ingester.ingest(mesh, self.sign));
            volumes.push(volume?);
            times.push([ms]);
        }
        let [median] = medians(&times);
        Ok((volumes, median))
    }

    /// The median of the times.
    fn on_gpu(&self, gpu: &Gpu) -> Result<f64> {
        let mut ingester = GpuMeshIngester::new(&VolumeStore::new(gpu)?, self.settings)?;
        let mut times = Vec::new();
        for mesh in self.meshes {
            let (done, ms) = timed(|| {
                let volume = ingester.ingest_to_gpu(mesh, self.sign)?;
                gpu.wait()?;
                anyhow::Ok(volume)
            });
            drop(done?);
            times.push([ms]);
        }
        let [median] = medians(&times);
        Ok(median)
    }
}

/// How streams are encoded.
fn settings() -> EncoderSettings {
    let motion = MotionMode::Fixed(Prediction::ThreeDof);
    EncoderSettings { main: Preset::Realtime.settings(), motion, ..EncoderSettings::default() }
}

/// The mean time of a frame where one thread codes and another writes.
fn overlapped(header: &StreamHeader, volumes: &[SparseVolume], gpu: &Gpu) -> Result<f64> {
    let mut coder = frame_coder(header, settings(), &VolumeStore::new(gpu)?)?;
    let (sender, frames) = std::sync::mpsc::sync_channel(1);
    let (coded, ms) = timed(|| {
        std::thread::scope(|scope| {
            let coding = scope.spawn(move || -> Result<()> {
                for volume in volumes {
                    sender.send(coder.code(volume)?).context("somebody writes as long as frames come")?;
                }
                Ok(())
            });
            let mut writer = FrameWriter::default();
            frames.iter().for_each(|frame| drop(writer.write(frame)));
            coding.join().expect("a coder does not panic")
        })
    });
    coded?;
    Ok(ms / volumes.len() as f64)
}

/// The stream that an encoder makes, and the median of its times, uploads included.
fn encode<E: FnMut(&SparseVolume) -> Result<EncodedFrame>>(
    header: &StreamHeader,
    volumes: &[SparseVolume],
    encoder: impl FnOnce(EncoderSettings) -> Result<E>,
) -> Result<(Vec<u8>, f64)> {
    let mut encode = encoder(settings())?;
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    let mut times = Vec::new();
    for (n, volume) in volumes.iter().enumerate() {
        let (frame, ms) = timed(|| encode(volume));
        let frame = frame?;
        writer.write_frame(frame.keyframe, n as u64 * 33_333_333, &frame.payload())?;
        times.push([ms]);
    }
    let [median] = medians(&times);
    Ok((writer.finish()?, median))
}

fn packets(stream: &[u8]) -> Result<Vec<Packet>> {
    let mut reader = PacketReader::new(stream)?;
    let mut packets = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        packets.push(packet);
    }
    Ok(packets)
}

/// Medians of decoding and of the surface.
fn on_cpu(header: &StreamHeader, packets: &[Packet]) -> Result<[f64; 2]> {
    let mut decoder = Decoder::new(header, Limits::default());
    let mut times = Vec::new();
    for packet in packets {
        let (frame, decode) = timed(|| decoder.decode(packet));
        let volume = frame?.volume;
        let (_, surface) = timed(|| extract_surface(volume, &SurfaceOptions::default()));
        times.push([decode, surface]);
    }
    Ok(medians(&times))
}

/// Times of decoding and surfaces on a GPU.
fn on_gpu(header: &StreamHeader, packets: &[Packet], gpu: &Gpu) -> Result<[f64; 2]> {
    let store = VolumeStore::new(gpu)?;
    let mut decoder = Decoder::with_backend(header, Limits::default(), GpuBackend::new(&store)?);
    let mut extractor = GpuSurfaceExtractor::new(&store, SurfaceOptions::default())?;
    let mut times = Vec::new();
    for packet in packets {
        let (frame, decode) = timed(|| {
            let frame = decoder.decode(packet)?;
            gpu.wait()?;
            Ok::<_, anyhow::Error>(frame)
        });
        let volume = frame?.volume;
        let (surface, ms) = timed(|| {
            let mesh = extractor.extract(volume)?;
            gpu.wait()?;
            Ok::<_, anyhow::Error>(mesh)
        });
        drop(surface?);
        times.push([decode, ms]);
    }
    Ok(medians(&times))
}

/// Medians of all but the first, if there are more.
fn medians<const WHICH: usize>(times: &[[f64; WHICH]]) -> [f64; WHICH] {
    let counted = &times[usize::from(times.len() > 1)..];
    std::array::from_fn(|which| {
        let mut times: Vec<f64> = counted.iter().map(|times| times[which]).collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    })
}

fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}

/// The least bytes that a workgroup of a kernel reads and writes: samples, of two bytes, and what it makes of them.
fn least_bytes(kernel: &str) -> Option<u64> {
    let (block, window) = (2 * 512, 2 * 729);
    match kernel {
        "temporal" | "warp" | "search" => Some(window + block),
        "code" => Some(window + 2 * block),
        // Four layers around the block.
        "spatial" => Some(2 * (16 * 16 * 16 - 512) + block),
        // Three layers on either side, read and written.
        "face_filter" => Some(2 * 2 * 6 * 64),
        "extrapolate" => Some(2 * block),
        "crossed_cells" => Some(2 * 9 * 9 * 9 + 64),
        "expected_activity" => Some(window + 4),
        "find_signs" => Some(block + 132),
        "wind" => Some(block),
        "measure" => Some(2 * block),
        _ => None,
    }
}

fn print_kernels(kernels: &BTreeMap<&'static str, KernelTime>, frames: usize, copy_rate: f64) {
    if kernels.is_empty() {
        println!("no times of kernels: the device has no clock");
        return;
    }
    println!(
        "| kernel | ms a frame | dispatches | workgroups | least bytes at, of the rate of copies |\n|---|---|---|---|---|"
    );
    for (name, time) in kernels {
        let frames = frames as f64;
        // A copy reads and writes each byte.
        let share = least_bytes(name).map(|bytes| {
            bytes as f64 * time.workgroups as f64 / (time.nanoseconds * 1e-9) / (2.0 * copy_rate)
        });
        println!(
            "| {name} | {:.3} | {:.1} | {:.0} | {} |",
            time.nanoseconds / 1e6 / frames,
            f64::from(time.dispatches) / frames,
            time.workgroups as f64 / frames,
            share.map_or_else(String::new, |share| format!("{:.0} %", 100.0 * share)),
        );
    }
}
