//! The GPU against the CPU, call by call, on streams that exercise every mode.

use crate::tests::{gpu_for_tests, grid};
use crate::{GpuBackend, GpuMainFrame, GpuPaperFrame, GpuVolume, VolumeStore};
use isv_decode::backend::{Backend, Cpu, CpuMainFrame, CpuPaperFrame, MainFrame};
use isv_decode::main::MainBlocks;
use isv_decode::main::activity::Activity;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_decode::{BackendError, DecodeError, Decoder, Limits, ReferenceBlocks};
use isv_encode::{Encoder, EncoderSettings};
use isv_format::{FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv_volume::{BlockCoord, BlockSet, SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Does everything on both, and compares.
#[derive(Debug)]
struct Both {
    cpu: Cpu,
    gpu: GpuBackend,
}

/// Panics where the volumes differ, with the first block that does.
fn compare(cpu: &SparseVolume, gpu: &GpuVolume) {
    let gpu = gpu.download().unwrap();
    assert!(cpu.coords() == gpu.coords(), "blocks");
    for (block, coord) in cpu.coords().iter().enumerate() {
        let differing = || {
            let pairs = cpu.block(block).iter().zip(gpu.block(block)).enumerate();
            pairs.filter(|(_, (a, b))| a != b).take(5).collect::<Vec<_>>()
        };
        assert!(cpu.block(block) == gpu.block(block), "block {block}, {coord:?}: {:?}", differing());
        assert!(cpu.unobserved(block) == gpu.unobserved(block), "mask of block {block}, {coord:?}");
    }
    assert!(*cpu == gpu);
}

impl Backend for Both {
    type Volume = SparseVolume;
    type Paper = (CpuPaperFrame, GpuPaperFrame);
    type Main = (CpuMainFrame, GpuMainFrame);

    fn reconstruct_paper(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&Self::Paper>,
    ) -> Result<Self::Paper, BackendError> {
        let cpu = self.cpu.reconstruct_paper(parameters, symbols.clone(), before.map(|b| &b.0))?;
        let gpu = self.gpu.reconstruct_paper(parameters, symbols, before.map(|b| &b.1))?;
        compare(Cpu::paper_volume(&cpu), GpuBackend::paper_volume(&gpu));
        Ok((cpu, gpu))
    }

    fn paper_blocks(frame: &Self::Paper) -> ReferenceBlocks<'_> {
        GpuBackend::paper_blocks(&frame.1)
    }

    fn paper_volume(frame: &Self::Paper) -> &SparseVolume {
        Cpu::paper_volume(&frame.0)
    }

    fn reconstruct_main(
        &mut self,
        frame: MainFrame<'_>,
        before: Option<&Self::Main>,
    ) -> Result<Self::Main, BackendError> {
        let MainFrame { parameters, header, ref symbols, causal, ref plan, predicts } = frame;
        let (symbols, plan) = (symbols.clone(), plan.clone());
        let copy = MainFrame { parameters, header, symbols, causal, plan, predicts };
        let cpu = self.cpu.reconstruct_main(copy, before.map(|b| &b.0))?;
        let gpu = self.gpu.reconstruct_main(frame, before.map(|b| &b.1))?;
        compare(Cpu::main_volume(&cpu), GpuBackend::main_volume(&gpu));
        let corners = self.cpu.crossed_corners(&cpu)?;
        assert!(corners == self.gpu.crossed_corners(&gpu)?, "corners of crossed cells");
        let cells = self.cpu.crossed_cells(&cpu)?;
        assert!(cells == self.gpu.crossed_cells(&gpu)?, "crossed cells");
        Ok((cpu, gpu))
    }

    fn main_blocks(frame: &Self::Main) -> MainBlocks<'_> {
        GpuBackend::main_blocks(&frame.1)
    }

    fn main_volume(frame: &Self::Main) -> &SparseVolume {
        Cpu::main_volume(&frame.0)
    }

    fn main_field(&mut self, frame: &Self::Main) -> Result<SparseVolume, BackendError> {
        self.gpu.main_field(&frame.1)
    }

    fn crossed_corners(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        self.gpu.crossed_corners(&frame.1)
    }

    fn crossed_cells(&mut self, frame: &Self::Main) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        self.gpu.crossed_cells(&frame.1)
    }

    fn add_masks(
        &mut self,
        frame: &mut Self::Main,
        masks: BTreeMap<u32, VoxelMask>,
    ) -> Result<(), BackendError> {
        self.cpu.add_masks(&mut frame.0, masks.clone())?;
        self.gpu.add_masks(&mut frame.1, masks)?;
        compare(Cpu::main_volume(&frame.0), GpuBackend::main_volume(&frame.1));
        // Those of a frame of which nothing stays as it is; the decoder asks with what does.
        self.expected_activity(frame, &BlockSet::default())?;
        Ok(())
    }

    fn expected_activity(
        &mut self,
        frame: &Self::Main,
        skipped: &BlockSet,
    ) -> Result<Vec<Activity>, BackendError> {
        let cpu = self.cpu.expected_activity(&frame.0, skipped)?;
        let gpu = self.gpu.expected_activity(&frame.1, skipped)?;
        for (block, (cpu, gpu)) in cpu.iter().zip(&gpu).enumerate() {
            assert!(cpu == gpu, "activity of block {block}: {cpu:?}, {gpu:?}");
        }
        assert!(cpu.len() == gpu.len());
        Ok(gpu)
    }

    fn hash(&mut self, volume: &SparseVolume) -> Result<u64, BackendError> {
        self.cpu.hash(volume)
    }
}

/// The folder of the conformance suite.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance")
}

/// The streams of the conformance suite, in order.
fn streams() -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let mut streams: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "isv")).collect();
    streams.sort();
    streams
}

fn open(path: &Path) -> PacketReader<BufReader<File>> {
    PacketReader::new(BufReader::new(File::open(path).unwrap())).unwrap()
}

#[test]
fn all_streams_decode_to_the_same_bits() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut decoded = 0;
    for path in streams() {
        let mut packets = open(&path);
        let header = *packets.header();
        let name = path.file_name().unwrap().display();
        let store = VolumeStore::new(&gpu).unwrap();
        let both = Both { cpu: Cpu::default(), gpu: GpuBackend::new(&store).unwrap() };
        let mut decoder = Decoder::with_backend(&header, Limits::default(), both);
        let mut frames = 0;
        while let Some(packet) = packets.next_frame().unwrap() {
            match decoder.decode_and_verify(&packet) {
                Ok(_) => frames += 1,
                Err(DecodeError::Backend(BackendError::Unsupported(what))) => {
                    println!("{name}: {what}");
                    break;
                }
                // Segments are small in tests.
                Err(DecodeError::Backend(BackendError::OutOfMemory(what))) => {
                    println!("{name}: {what}");
                    break;
                }
                Err(error) => panic!("{name}: {error}"),
            }
        }
        let none = name.to_string().starts_with("no_frames");
        assert!(frames > 0 || none || header.grid.edge.voxels() != 8, "{name}");
        println!("{name}: {frames} frames");
        decoded += frames;
    }
    assert!(decoded > 50, "{decoded} frames");
}

#[test]
fn colour_on_what_a_gpu_decodes_has_its_hashes() {
    let Some(gpu) = gpu_for_tests() else { return };
    let table = std::fs::read_to_string(folder().join("colour.txt")).unwrap();
    let mut expected: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in table.lines() {
        let [name, _, colour] = line.split(' ').collect::<Vec<_>>().try_into().expect("three words");
        expected.entry(name).or_default().push(colour);
    }
    let mut coloured = 0;
    for (name, colours) in expected {
        let mut packets = open(&folder().join(name));
        let store = VolumeStore::new(&gpu).unwrap();
        let backend = GpuBackend::new(&store).unwrap();
        let mut decoder = Decoder::with_backend(packets.header(), Limits::default(), backend);
        decoder.keep_colour(true);
        for colour in colours {
            let packet = packets.next_frame().unwrap().expect("a frame of each line");
            decoder.decode_and_verify(&packet).unwrap_or_else(|error| panic!("{name}: {error}"));
            let found = decoder.colour().map_or("-".to_owned(), |frame| format!("{:016x}", frame.hash()));
            assert_eq!(found, colour, "{name}");
            coloured += usize::from(colour != "-");
        }
    }
    assert!(coloured > 40, "{coloured} frames");
}

/// A keyframe of blocks in a row, each predicted from the one before: as many waves, more than are handed over together.
#[test]
fn long_chains_of_blocks_are_decoded() {
    let Some(gpu) = gpu_for_tests() else { return };
    let coords: Vec<_> = (0..300).map(|x| BlockCoord::from([x, 0, 0])).collect();
    let sample = |voxel: usize| {
        let [x, y, z] = [voxel / 512 * 8 + voxel % 8, voxel / 8 % 8, voxel / 64 % 8].map(|c| c as f64);
        (256.0 * (z - 3.5) + 40.0 * y * (0.3 * x).sin()) as i16
    };
    let samples = (0..300 * 512).map(sample).collect();
    let volume = SparseVolume::from_parts(grid(), coords, samples, BTreeMap::new());
    let frame_rate = FrameRate::DEFAULT;
    let header = StreamHeader::new(Profile::Main, grid(), frame_rate);
    let settings = EncoderSettings { checksums: true, ..EncoderSettings::default() };
    let frame = Encoder::new(&header, settings).encode(&volume);
    assert!(frame.payload().header.blocks >= 300);
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    writer.write_frame(true, 0, &frame.payload()).unwrap();
    let bytes = writer.finish().unwrap();
    let packet = PacketReader::new(&bytes[..]).unwrap().next_frame().unwrap().unwrap();
    let store = VolumeStore::new(&gpu).unwrap();
    let both = Both { cpu: Cpu::default(), gpu: GpuBackend::new(&store).unwrap() };
    let mut decoder = Decoder::with_backend(&header, Limits::default(), both);
    assert!(decoder.decode_and_verify(&packet).unwrap().stated_hash.is_some());
}
