//! A GPU that is lost in the middle of a job: with the CPU to fall back on, and without.

use super::super::{DecodedVolume, IngestFault, OpenDevice};
use super::*;
use crate::encode::default_grid;
use crate::{Event, Observer};
use glam::{DMat4, DVec2};
use isv_decode::Lod;
use isv_encode::{FrameWriter, MotionMode};
use isv_format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Prediction, Profile};
use isv_ingest::ingest_mesh;
use isv_testkit::{Need, ball, sheet, skip, sphere};
use isv_volume::{CameraPose, Intrinsics};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Mutex;

const PAPER: Profile = Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 2048 });

/// A GPU of a test's own, which it may lose, and what was said of devices.
struct Bench {
    gpu: Gpu,
    device: OpenDevice,
    observer: Arc<dyn Observer>,
    told: Arc<Mutex<Vec<String>>>,
}

impl Bench {
    /// Opens a GPU, software or not; the test is skipped where there is none.
    fn open(falls_back: bool) -> Option<Self> {
        match Gpu::open(&GpuChoice { software: true, ..GpuChoice::default() }) {
            Ok(gpu) => Some(Self::with_gpu(gpu, falls_back)),
            Err(error) => {
                skip(Need::Gpu, error);
                None
            }
        }
    }

    fn with_gpu(gpu: Gpu, falls_back: bool) -> Self {
        let workers: Arc<dyn GpuWorkers> = Arc::new(OpenGpu(VolumeStore::new(&gpu).unwrap()));
        let told = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&told);
        let observer: Arc<dyn Observer> =
            Arc::new(move |event: &Event| heard.lock().unwrap().push(event.to_string()));
        Self { gpu, device: OpenDevice { gpu: Some(workers), falls_back }, observer, told }
    }

    /// Number of events that say that the CPU goes on.
    fn falls(&self) -> usize {
        let told = self.told.lock().unwrap();
        told.iter().filter(|sentence| sentence.ends_with("working on the CPU")).count()
    }
}

fn header(profile: Profile) -> StreamHeader {
    StreamHeader::new(profile, default_grid(), FrameRate::DEFAULT)
}

/// Decodes a stream whose GPU is lost before frame 2.
fn decode_with_a_loss(name: &str, falls_back: bool) -> Option<Result<usize, DecodeError>> {
    let bench = Bench::open(falls_back)?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance").join(name);
    let mut packets = PacketReader::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let header = *packets.header();
    let limits = Limits::default();
    let mut decoder = bench.device.decoder(&header, limits, Lod::Full, false, &bench.observer).unwrap();
    let mut oracle = Decoder::new(&header, limits);
    let mut frames = 0;
    while let Some(packet) = packets.next_frame().unwrap() {
        if frames == 2 {
            bench.gpu.lose();
        }
        let frame = match decoder.decode_and_verify(&packet) {
            Ok(frame) => frame,
            Err(error) => return Some(Err(error)),
        };
        assert_eq!(matches!(frame.volume, DecodedVolume::Device(_)), frames < 2);
        assert_eq!(bench.falls(), usize::from(frames >= 2));
        assert!(frame.volume.into_sparse().unwrap() == *oracle.decode(&packet).unwrap().volume);
        frames += 1;
    }
    Some(Ok(frames))
}

#[test]
fn a_decoder_goes_on_from_the_last_keyframe() {
    for name in ["3dof.isv", "main_still_cells.isv"] {
        match decode_with_a_loss(name, true) {
            Some(frames) => assert!(frames.unwrap() >= 4, "{name}"),
            None => return,
        }
    }
}

#[test]
fn a_decoder_fails_where_a_gpu_was_asked_for() {
    let Some(result) = decode_with_a_loss("main_still_cells.isv", false) else { return };
    assert!(matches!(result, Err(DecodeError::Backend(BackendError::DeviceFailed(_)))), "{result:?}");
}

/// All frames decode on the CPU to what the encoder had.
#[test]
fn a_coder_goes_on_with_a_keyframe() {
    for profile in [PAPER, Profile::Main] {
        let Some(bench) = Bench::open(true) else { return };
        let header = header(profile);
        let motion = MotionMode::Fixed(Prediction::ThreeDof);
        let settings = EncoderSettings { checksums: true, motion, ..EncoderSettings::default() };
        let mut coder = bench.device.coder(&header, settings, &bench.observer).unwrap();
        let (mut frames, mut writer) =
            (FrameWriter::default(), PacketWriter::new(Vec::new(), &header).unwrap());
        let mut keyframes = Vec::new();
        for frame in 0..4 {
            if frame == 2 {
                bench.gpu.lose();
            }
            let coded = frames.write(coder.code(&ball(header.grid, f64::from(frame))).unwrap());
            assert_eq!(bench.falls(), usize::from(frame >= 2));
            keyframes.push(coded.keyframe);
            writer.write_frame(coded.keyframe, 0, &coded.payload()).unwrap();
        }
        assert_eq!(keyframes, [true, false, true, false]);
        let bytes = writer.finish().unwrap();
        let mut packets = PacketReader::new(&bytes[..]).unwrap();
        let mut decoder = Decoder::new(&header, Limits::default());
        while let Some(packet) = packets.next_frame().unwrap() {
            assert!(decoder.decode_and_verify(&packet).unwrap().stated_hash.is_some());
        }
    }
}

#[test]
fn a_coder_fails_where_a_gpu_was_asked_for() {
    for profile in [PAPER, Profile::Main] {
        let Some(bench) = Bench::open(false) else { return };
        let header = header(profile);
        let mut coder = bench.device.coder(&header, EncoderSettings::default(), &bench.observer).unwrap();
        coder.code(&ball(header.grid, 0.0)).unwrap();
        bench.gpu.lose();
        let error = coder.code(&ball(header.grid, 1.0)).err().unwrap();
        assert!(error.to_string().contains("lost"), "{error}");
        assert_eq!(bench.falls(), 0);
    }
}

#[test]
fn meshes_become_the_volumes_of_the_cpu() {
    const CLOSED: SignDecision = SignDecision::Closed { flipped: false };
    let Some(bench) = Bench::open(true) else { return };
    let settings = MeshIngest::new(default_grid());
    let strict = Bench::with_gpu(bench.gpu.clone(), false);
    let [mut auto, mut strict] =
        [&bench, &strict].map(|bench| bench.device.mesh_ingest(settings, &bench.observer).unwrap());
    let mesh = sphere(0.03, 12);
    let expected = ingest_mesh(&mesh, &settings, CLOSED).unwrap();
    assert!(auto.ingest(&mesh, CLOSED).unwrap().coords() == expected.coords());
    // Single sheets are made on the CPU, which is no failure of the GPU.
    let sheets = ingest_mesh(&sheet(0.05), &settings, SignDecision::Sheet).unwrap();
    for worker in [&mut auto, &mut strict] {
        assert!(worker.ingest(&sheet(0.05), SignDecision::Sheet).unwrap() == sheets);
    }
    assert_eq!(bench.falls(), 0);
    bench.gpu.lose();
    assert!(matches!(strict.ingest(&mesh, CLOSED), Err(IngestFault::Device(_))));
    assert!(auto.ingest(&mesh, CLOSED).unwrap() == expected);
    assert!(auto.ingest(&mesh, CLOSED).unwrap() == expected);
    assert_eq!(bench.falls(), 1);
}

/// A wall 1 m away.
fn wall() -> DepthImage {
    let (focal, principal) = (DVec2::splat(50.0), DVec2::new(15.5, 11.5));
    let lens = Intrinsics { width: 32, height: 24, focal, principal };
    DepthImage::new(lens, CameraPose::from_matrix(DMat4::IDENTITY).unwrap(), vec![1.0; 32 * 24]).unwrap()
}

#[test]
fn depth_images_are_fused_within_the_frame() {
    let Some(bench) = Bench::open(true) else { return };
    let strict = Bench::with_gpu(bench.gpu.clone(), false);
    let (wall, settings) = ([wall()], FusionSettings::new(default_grid()));
    let [mut fuser, mut strict] = [&bench, &strict].map(|bench| bench.device.fuser(&bench.observer).unwrap());
    // Images that cannot be fused are no fault of the GPU.
    let none = FusionSettings { max_depth_m: 0.5, ..settings };
    assert!(matches!(fuser.fuse(&wall, &none), Err(FusionError::NoReading { .. })));
    for lost in [false, true, true] {
        if lost {
            bench.gpu.lose();
        }
        assert!(fuser.fuse(&wall, &settings).unwrap().block_count() > 0);
        assert_eq!(bench.falls(), usize::from(lost));
    }
    assert!(matches!(strict.fuse(&wall, &settings), Err(FusionError::Backend(_))));
}

#[test]
fn images_are_accumulated_on_a_gpu_that_was_asked_for_and_else_on_the_cpu() {
    let Some(bench) = Bench::open(false) else { return };
    let auto = Bench::with_gpu(bench.gpu.clone(), true);
    let settings = FusionSettings::new(default_grid());
    let [ours, cpus] = [&bench, &auto].map(|bench| {
        let mut integrator = bench.device.integrator(settings, &bench.observer).unwrap();
        assert_eq!(integrator.volume().unwrap().block_count(), 0);
        integrator.integrate(&[wall()]).unwrap();
        integrator.volume().unwrap()
    });
    assert!(cpus.block_count() > 0 && cpus.coords() == ours.coords());
    assert_eq!(*auto.told.lock().unwrap(), ["depth images are accumulated on the CPU"]);
}
