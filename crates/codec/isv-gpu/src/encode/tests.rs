//! The GPU against the CPU: the same levels and frames under the same vectors, and vectors that are as good.

use crate::tests::{gpu_alone, gpu_for_tests, gpu_with_segments, grid, noise};
use crate::{Gpu, GpuBackend, GpuError, GpuVolume, VolumeStore, frame_coder};
use isv_decode::backend::{Backend, Cpu, CpuPaperFrame};
use isv_decode::paper::reconstruct::predict;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_decode::{BackendError, Decoder, Limits, volume_hash};
use isv_encode::{
    EncodeBackend, EncodedFrame, Encoder, EncoderSettings, FrameWriter, MotionMode, PaperCoder,
    surface_rms_voxels,
};
use isv_format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader};
use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv_io::{Unit, read_mesh};
use isv_kernels::warp::MotionVector;
use isv_testkit::{ball, capture};
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation};

const PAPER: PaperParameters = PaperParameters { coefficients: 64, dc_step: 819, ac_step: 2048 };

/// Bytes of a segment where a person is coded: four hold several frames of thousands of blocks.
pub(super) const PERSON_BYTES: u64 = 16 << 20;
/// Levels that a decoder's kernels take in the small buffers of tests.
const MOST_LEVELS: usize = 1 << 18;

fn backend(gpu: &Gpu) -> GpuBackend {
    GpuBackend::new(&VolumeStore::new(gpu).unwrap()).unwrap()
}

/// The first frames of a captured person, if the data is there; says so plainly if it is not.
fn captured(frames: usize) -> Option<Vec<SparseVolume>> {
    let volume = |frame| {
        let path = capture(&format!("dancer/frame_{frame:04}.ply"))?;
        let mesh = read_mesh(&path, Unit::Metre).expect("a mesh");
        let (decision, _) = decide_sign(&mesh, SignMode::Paper);
        Some(ingest_mesh(&mesh, &MeshIngest::new(grid()), decision).unwrap())
    };
    (0..frames).map(volume).collect()
}

/// Frames of a ball that moves and breathes, and of a captured person.
pub(super) fn sequences(frames: usize) -> Vec<(&'static str, Vec<SparseVolume>)> {
    let balls = (0..frames).map(|t| ball(grid(), t as f64)).collect();
    let captured = captured(frames).map(|volumes| ("dancer", volumes));
    [("ball", balls)].into_iter().chain(captured).collect()
}

/// Any vectors in range, some of which do not move and some of which do not turn.
fn vectors(count: usize) -> Vec<MotionVector> {
    let random =
        |i: usize| (i as u32).wrapping_mul(2_654_435_761).rotate_left(15).wrapping_mul(2_246_822_519) >> 8;
    let component = |i: usize, limit: u32| (random(i) % (2 * limit + 1)) as i8 - limit as i8;
    let vector = |block: usize| MotionVector {
        translation: [0, 1, 2]
            .map(|c| if block.is_multiple_of(7) { 0 } else { component(6 * block + c, 28) }),
        rotation: [3, 4, 5].map(|c| if block.is_multiple_of(3) { 0 } else { component(6 * block + c, 32) }),
    };
    (0..count).map(vector).collect()
}

/// What is known of a frame before it is coded.
fn symbols_of(volume: &SparseVolume, prediction: Prediction, before: Option<&CpuPaperFrame>) -> FrameSymbols {
    let coords = volume.coords().to_vec();
    let references = FrameSymbols::find_references(&coords, prediction, before.map(Cpu::paper_blocks));
    let motion = vec![MotionVector::ZERO; coords.len()];
    let unobserved = volume.unobserved_masks().clone();
    FrameSymbols { prediction, coords, unobserved, references, motion, levels: Vec::new() }
}

/// Codes frames on both, the second from the first by any vectors, and compares.
fn compare_code(gpu: &Gpu, paper: PaperParameters, volumes: [&SparseVolume; 2]) {
    let parameters = CodingParameters::new(*volumes[0].grid(), &paper);
    let (mut cpu, mut gpu) = (Cpu::default(), backend(gpu));
    let mut before = None;
    for volume in volumes {
        let prediction = if before.is_none() { Prediction::None } else { Prediction::SixDof };
        let mut symbols = symbols_of(volume, prediction, before.as_ref().map(|(cpu, _)| cpu));
        let moves = vectors(symbols.coords.len()).into_iter().zip(&symbols.references);
        symbols.motion = moves.map(|(vector, from)| from.map_or(MotionVector::ZERO, |_| vector)).collect();
        let mut same = symbols.clone();
        let (cpu_source, gpu_source) = (cpu.upload(volume).unwrap(), gpu.upload(volume).unwrap());
        let (cpu_before, gpu_before) = before.as_ref().map(|(cpu, gpu)| (cpu, gpu)).unzip();
        let on_cpu = cpu.code_paper(&parameters, &cpu_source, &mut symbols, cpu_before).unwrap();
        let on_gpu = gpu.code_paper(&parameters, &gpu_source, &mut same, gpu_before).unwrap();
        let differing = symbols.levels.iter().zip(&same.levels).position(|(a, b)| a != b);
        assert_eq!(differing, None, "{paper:?}, {prediction:?}: a level");
        assert!(symbols == same, "{paper:?}, {prediction:?}");
        assert!(symbols.levels.iter().any(|level| *level != 0));
        let (expected, found) = (Cpu::paper_volume(&on_cpu), GpuBackend::paper_volume(&on_gpu));
        assert!(*expected == found.download().unwrap(), "{paper:?}, {prediction:?}");
        // A decoder makes the same of it.
        if same.levels.iter().filter(|level| **level != 0).count() <= MOST_LEVELS {
            let decoded = gpu.reconstruct_paper(&parameters, same, gpu_before).unwrap();
            assert!(*expected == GpuBackend::paper_volume(&decoded).download().unwrap());
        }
        before = Some((on_cpu, on_gpu));
    }
}

#[test]
fn levels_and_frames_are_the_cpus() {
    let Some(gpu) = gpu_for_tests() else { return };
    let of = |coefficients, dc_step, ac_step| PaperParameters { coefficients, dc_step, ac_step };
    // A kernel writes the levels of 512 blocks of 512 coefficients at most here: those of noise take several dispatches.
    for paper in [of(512, 1, 1), of(512, 16, 333), PAPER, of(1, 819, 2048), of(20, 1 << 20, 5)] {
        if paper.dc_step < 1 << 20 {
            compare_code(&gpu, paper, [&noise(700, 1), &noise(650, 2)]);
        }
        for voxels in [2, 8, 16] {
            let grid = Grid { truncation: Truncation::from_voxels(voxels).unwrap(), ..grid() };
            compare_code(&gpu, paper, [&ball(grid, 0.0), &ball(grid, 1.0)]);
        }
    }
}

/// Sum of squared errors of a prediction.
fn squared_error(volume: &SparseVolume, prediction: &[i16]) -> f64 {
    let pairs = volume.samples().zip(prediction);
    pairs.map(|(a, b)| (f64::from(a) - f64::from(*b)).powi(2)).sum()
}

#[test]
fn vectors_predict_as_well_as_the_cpus() {
    let Some(gpu) = gpu_with_segments(PERSON_BYTES) else { return };
    let parameters = CodingParameters::new(grid(), &PAPER);
    for (name, volumes) in sequences(2) {
        let (mut cpu, mut gpu) = (Cpu::default(), backend(&gpu));
        let (cpu_source, gpu_source) = (cpu.upload(&volumes[0]).unwrap(), gpu.upload(&volumes[0]).unwrap());
        let mut first = symbols_of(&volumes[0], Prediction::None, None);
        let on_cpu = cpu.code_paper(&parameters, &cpu_source, &mut first, None).unwrap();
        let on_gpu = gpu.code_paper(&parameters, &gpu_source, &mut first, None).unwrap();
        let (cpu_source, gpu_source) = (cpu.upload(&volumes[1]).unwrap(), gpu.upload(&volumes[1]).unwrap());
        for prediction in [Prediction::ThreeDof, Prediction::SixDof] {
            let mut symbols = symbols_of(&volumes[1], prediction, Some(&on_cpu));
            let mut error_under = |motion: &[MotionVector]| {
                symbols.motion = motion.to_vec();
                squared_error(&volumes[1], &predict(&parameters, &symbols, on_cpu.reference()))
            };
            let standing_still = error_under(&vec![MotionVector::ZERO; volumes[1].block_count()]);
            let references = FrameSymbols::find_references(
                volumes[1].coords(),
                prediction,
                Some(Cpu::paper_blocks(&on_cpu)),
            );
            let expected = cpu.search_motion(prediction, &cpu_source, &references, &on_cpu).unwrap();
            let found = gpu.search_motion(prediction, &gpu_source, &references, &on_gpu).unwrap();
            assert_eq!(expected.len(), found.len());
            let differing = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
            let (expected, found) = (error_under(&expected), error_under(&found));
            println!(
                "{name}, {prediction:?}: {:+.4} % of squared error, {:.1} % of standing still's; {differing} of {} vectors differ",
                100.0 * (found / expected - 1.0),
                100.0 * expected / standing_still,
                references.len(),
            );
            assert!((found / expected - 1.0).abs() < 0.005 && found < 0.9 * standing_still);
        }
    }
}

/// A stream in the making, with the sum of its frames' errors.
pub(super) struct Stream {
    header: StreamHeader,
    pub(super) writer: PacketWriter<Vec<u8>>,
    frames: u64,
    pub(super) error: f64,
}

impl Stream {
    pub(super) fn new(header: StreamHeader) -> Self {
        Self { header, writer: PacketWriter::new(Vec::new(), &header).unwrap(), frames: 0, error: 0.0 }
    }

    pub(super) fn add(&mut self, frame: &EncodedFrame, source: &SparseVolume, decoded: &SparseVolume) {
        let timestamp = self.header.frame_rate.timestamp_ns(self.frames);
        self.writer.write_frame(frame.keyframe, timestamp, &frame.payload()).unwrap();
        self.frames += 1;
        self.error += surface_rms_voxels(source, decoded);
    }
}

#[test]
fn streams_decode_on_the_cpu_and_are_as_good() {
    let Some(gpu) = gpu_with_segments(PERSON_BYTES) else {
        return;
    };
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(Profile::Paper(PAPER), grid(), frame_rate);
    let modes =
        [MotionMode::Fixed(Prediction::ThreeDof), MotionMode::Fixed(Prediction::SixDof), MotionMode::Auto];
    for (name, volumes) in sequences(4) {
        for motion in modes.into_iter().take(if name == "ball" { 3 } else { 2 }) {
            let settings = EncoderSettings { motion, gop: 3, checksums: true, ..EncoderSettings::default() };
            let mut on_cpu = Encoder::new(&header, settings);
            let mut on_gpu = PaperCoder::new(header.grid, &PAPER, settings, backend(&gpu));
            let mut writer = FrameWriter::default();
            let [mut expected, mut found] = [Stream::new(header), Stream::new(header)];
            let mut hashes = Vec::new();
            for volume in &volumes {
                let frame = on_cpu.encode(volume);
                expected.add(&frame, volume, on_cpu.reconstruction().unwrap());
                let frame = writer.write(on_gpu.code(volume).unwrap());
                let decoded = on_gpu.reconstruction().unwrap().download().unwrap();
                found.add(&frame, volume, &decoded);
                hashes.push(volume_hash(&decoded));
            }
            let (errors, streams) =
                ([&expected, &found].map(|s| s.error), [expected, found].map(|s| s.writer.finish().unwrap()));
            let mut packets = PacketReader::new(&streams[1][..]).unwrap();
            let mut decoder = Decoder::new(&header, Limits::default());
            for hash in hashes {
                let packet = packets.next_frame().unwrap().unwrap();
                assert_eq!(volume_hash(decoder.decode_and_verify(&packet).unwrap().volume), hash);
            }
            let bytes = streams.each_ref().map(|stream| stream.len() as f64);
            let [bytes, error] = [bytes, errors].map(|[expected, found]| found / expected - 1.0);
            let total = streams[0].len();
            println!(
                "{name}, {motion:?}: {:+.3} % of {total} bytes, {:+.3} % of error",
                100.0 * bytes,
                100.0 * error
            );
            assert!(bytes.abs() < 0.02 && error.abs() < 0.02);
        }
    }
}

#[test]
fn an_empty_frame_and_a_frame_after_it_are_coded() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut coder = PaperCoder::new(grid(), &PAPER, EncoderSettings::default(), backend(&gpu));
    for volume in [ball(grid(), 0.0), noise(0, 1), ball(grid(), 1.0)] {
        coder.code(&volume).unwrap();
        let found: &GpuVolume = coder.reconstruction().unwrap();
        assert_eq!(found.download().unwrap().coords(), volume.coords());
    }
}

#[test]
fn other_blocks_are_not_supported() {
    let Some(gpu) = gpu_for_tests() else { return };
    let grid = Grid { edge: BlockEdge::E4, ..grid() };
    let mut coder = PaperCoder::new(grid, &PAPER, EncoderSettings::default(), backend(&gpu));
    let error = coder.code(&ball(grid, 0.0)).unwrap_err();
    assert!(matches!(error, BackendError::Unsupported(_)), "{error}");
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(gpu) = gpu_alone() else { return };
    let mut coder = PaperCoder::new(grid(), &PAPER, EncoderSettings::default(), backend(&gpu));
    coder.code(&ball(grid(), 0.0)).unwrap();
    gpu.lose();
    for t in [1.0, 2.0] {
        assert!(matches!(coder.code(&ball(grid(), t)), Err(BackendError::DeviceFailed(_))));
    }
}

#[test]
fn blocks_of_another_edge_are_not_coded_on_a_gpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let grid = Grid { edge: BlockEdge::E16, ..grid() };
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(Profile::Paper(PAPER), grid, frame_rate);
    let coder = frame_coder(&header, EncoderSettings::default(), &VolumeStore::new(&gpu).unwrap());
    assert!(matches!(coder, Err(GpuError::Unsupported(_))));
}
