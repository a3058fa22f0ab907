//! Profile `main` with its motion from the GPU against the CPU alone: blocks found as well, streams that are as good.

use super::GpuMotionSearch;
use super::tests::{PERSON_BYTES, Stream, sequences};
use crate::VolumeStore;
use crate::tests::{gpu_alone, gpu_with_segments, grid, noise};
use isv_decode::main::MainReference;
use isv_decode::{BackendError, Decoder, Limits, volume_hash};
use isv_encode::{
    BlockShifts, Encoder, EncoderSettings, MainEncoder, MotionQuery, Preset, SearchBackend, probe,
};
use isv_format::{FrameRate, MaskCoding, PacketReader, Profile, StreamHeader};
use isv_testkit::{ball, still_and_moving_ball};
use isv_volume::SparseVolume;

#[test]
fn blocks_are_found_as_well_as_on_the_cpu() {
    let Some(gpu) = gpu_with_segments(PERSON_BYTES) else { return };
    let mut search = GpuMotionSearch::new(&VolumeStore::new(&gpu).unwrap()).unwrap();
    for (name, volumes) in sequences(2) {
        let found = probe::shifts(&volumes[0], &volumes[1], &mut search).unwrap();
        let apart =
            |[(a, _), (b, _)]: &&[([f32; 3], f32); 2]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.25);
        let differing = found.iter().filter(apart).count();
        let errors = [0, 1].map(|whose| found.iter().map(|shifts| f64::from(shifts[whose].1)).sum::<f64>());
        println!(
            "{name}: {:+.3} % of squared error; {differing} of {} blocks by another quarter voxel",
            100.0 * (errors[1] / errors[0] - 1.0),
            found.len(),
        );
        assert!(errors[1] < 1.01 * errors[0] && 5 * differing < found.len());
    }
}

#[test]
fn streams_decode_on_the_cpu_and_are_as_good() {
    let Some(gpu) = gpu_with_segments(PERSON_BYTES) else {
        return;
    };
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(Profile::Main, grid(), frame_rate);
    for (name, volumes) in sequences(3) {
        for preset in
            [Preset::Balanced, Preset::Realtime].into_iter().take(if name == "ball" { 2 } else { 1 })
        {
            let settings =
                EncoderSettings { main: preset.settings(), checksums: true, ..EncoderSettings::default() };
            let search = GpuMotionSearch::new(&VolumeStore::new(&gpu).unwrap()).unwrap();
            let mut on_cpu = Encoder::new(&header, settings);
            let mut on_gpu = MainEncoder::new(header.grid, header.mask_coding, settings, search);
            let [mut expected, mut found] = [Stream::new(header), Stream::new(header)];
            let mut hashes = Vec::new();
            for volume in &volumes {
                let frame = on_cpu.encode(volume);
                expected.add(&frame, volume, on_cpu.reconstruction().unwrap());
                let frame = on_gpu.encode(volume).unwrap();
                let decoded = on_gpu.reconstruction().unwrap();
                found.add(&frame, volume, decoded);
                hashes.push(volume_hash(decoded));
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
            println!(
                "{name}, {preset}: {:+.3} % of {} bytes, {:+.3} % of error",
                100.0 * bytes,
                streams[0].len(),
                100.0 * error
            );
            assert!(bytes < 0.02 && error < 0.02);
        }
    }
}

/// A search that checks what it has of each frame.
#[derive(Debug)]
struct Checked(GpuMotionSearch);

impl SearchBackend for Checked {
    fn keep(&mut self, frame: &MainReference) -> Result<(), BackendError> {
        self.0.keep(frame)?;
        let found = self.0.before.as_ref().unwrap().download().unwrap();
        assert!(found.coords() == frame.volume().coords() && found.samples().eq(frame.volume().samples()));
        Ok(())
    }

    fn find_shifts(&mut self, frame: &MotionQuery) -> Result<Option<Vec<BlockShifts>>, BackendError> {
        self.0.find_shifts(frame)
    }
}

fn checked_encoder(gpu: &crate::Gpu, settings: EncoderSettings) -> MainEncoder<Checked> {
    let search = GpuMotionSearch::new(&VolumeStore::new(gpu).unwrap()).unwrap();
    MainEncoder::new(grid(), MaskCoding::Cells, settings, Checked(search))
}

/// Some of each frame stays as it is, and is not copied again.
#[test]
fn the_frame_before_is_the_cpus() {
    let Some(gpu) = gpu_with_segments(PERSON_BYTES) else { return };
    let settings = EncoderSettings { gop: 3, ..EncoderSettings::default() };
    let mut encoder = checked_encoder(&gpu, settings);
    let frames: Vec<SparseVolume> = (0..6).map(|t| still_and_moving_ball(grid(), f64::from(t))).collect();
    for frame in frames.iter().chain([&frames[5], &noise(0, 1), &frames[0]]) {
        encoder.encode(frame).unwrap();
    }
}

#[test]
fn a_lost_device_leaves_the_encoder_as_it_was() {
    let Some(gpu) = gpu_alone() else { return };
    let mut encoder = checked_encoder(&gpu, EncoderSettings::default());
    encoder.encode(&ball(grid(), 0.0)).unwrap();
    let before = encoder.reconstruction().cloned();
    gpu.lose();
    for t in [1.0, 2.0] {
        assert!(matches!(encoder.encode(&ball(grid(), t)), Err(BackendError::DeviceFailed(_))));
        assert!(encoder.reconstruction() == before.as_ref());
    }
}
