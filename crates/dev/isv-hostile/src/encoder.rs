//! Small volumes, encoded. The decoder gets what the encoder says that it gets. Slices, threads and
//! instructions change nothing that they must not. After a loss, blocks that are said to be exact are.

use crate::differential::TWO_THREADS;
use isv::raw::decode::{Decoder, volume_hash};
use isv::raw::encode::{
    Band, Encoder, EncoderSettings, FrameQuality, MainSettings, MotionMode, Preset, Refresh, SearchEffort,
    Tools,
};
use isv::raw::format::{
    FrameRate, PacketReader, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader,
};
use isv::raw::kernels::simd::{self, Instructions};
use isv::raw::volume::{
    BlockCoord, BlockEdge, COORD_LIMIT, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;

/// Frames of a stream.
const FRAMES: usize = 3;
/// Most blocks of a frame.
const BLOCKS: u8 = 10;

/// Bytes: the header, the settings, then volumes, block after block. They are encoded in several slices and in one other way: in
/// one slice, on two threads, or with a set of vector instructions. Which way is for the bytes to say, so that each costs two
/// encodings.
pub(crate) fn round_trip(bytes: &[u8]) {
    let mut fields = Fields(bytes);
    let header = header(&mut fields);
    // Bit 8 of the hash: the bits below say which way they are encoded again.
    let header = match crc32fast::hash(bytes) >> 8 & 1 {
        1 => StreamHeader::newest(header.profile, header.grid, header.frame_rate),
        _ => header,
    };
    let settings = settings(&mut fields);
    let volumes: Vec<_> = (0..FRAMES).map(|_| volume(&mut fields, header.grid)).collect();
    let settings = EncoderSettings { slices: Some(2 + u16::from(fields.below(4))), ..settings };
    let stream = encode(&header, settings, &volumes);
    keep(&stream);
    let decoded = decode(&stream);
    if header.profile == Profile::Main && settings.main.refresh == Refresh::Gradual {
        lose_a_frame(&stream, &decoded);
    }
    let sets: Vec<Instructions> = Instructions::available().collect();
    let best = sets[sets.len() - 1];
    match crc32fast::hash(bytes) as usize % (sets.len() + 2) {
        0 | 1 => {
            let whole = encode(&header, EncoderSettings { slices: Some(1), ..settings }, &volumes);
            keep(&whole);
            let of_whole = decode(&whole);
            // In profile `main` slices bound what a block may be predicted from. In `paper` they are a matter of syntax alone,
            // unless the shorter of several ways is taken.
            let may_differ = header.profile == Profile::Main || settings.motion == MotionMode::Auto;
            let hashes = |volumes: &[SparseVolume]| volumes.iter().map(volume_hash).collect::<Vec<_>>();
            assert!(may_differ || hashes(&of_whole) == hashes(&decoded), "one slice against several");
        }
        2 => assert!(
            TWO_THREADS.install(|| encode(&header, settings, &volumes)) == stream,
            "two threads against one"
        ),
        way => {
            let instructions = sets[way - 3];
            simd::choose(instructions).expect("the machine has them");
            let other = encode(&header, settings, &volumes);
            simd::choose(best).expect("the machine has them");
            assert!(other == stream, "{instructions} against {best}");
        }
    }
}

/// Writes a stream to the folder that `FUZZ_STREAMS` names, if it does: what is encoded on purpose is a seed for what decodes.
fn keep(stream: &[u8]) {
    static FOLDER: LazyLock<Option<PathBuf>> =
        LazyLock::new(|| std::env::var_os("FUZZ_STREAMS").map(Into::into));
    if let Some(folder) = &*FOLDER {
        let path = folder.join(format!("{:08x}", crc32fast::hash(stream)));
        std::fs::write(path, stream).expect("a folder that can be written to");
    }
}

/// The stream, each frame with the hash of what the encoder reconstructed.
fn encode(header: &StreamHeader, settings: EncoderSettings, volumes: &[SparseVolume]) -> Vec<u8> {
    let mut encoder = Encoder::new(header, settings);
    let mut writer = PacketWriter::new(Vec::new(), header).expect("memory takes bytes");
    for (frame, volume) in volumes.iter().enumerate() {
        let coded = encoder.encode(volume);
        let timestamp = header.frame_rate.timestamp_ns(frame as u64);
        writer.write_frame(coded.keyframe, timestamp, &coded.payload()).expect("memory takes bytes");
    }
    writer.finish().expect("memory takes bytes")
}

/// The frames, each of the hash that its packet states.
fn decode(bytes: &[u8]) -> Vec<SparseVolume> {
    let mut reader = PacketReader::new(bytes).expect("a whole stream");
    let header = *reader.header();
    let mut decoder = Decoder::new(&header, crate::stream::LIMITS);
    let mut volumes = Vec::new();
    while let Some(packet) = reader.next_frame().expect("a whole stream") {
        let frame = decoder.decode_and_verify(&packet).expect("what was encoded is decoded");
        assert!(frame.stated_hash.is_some(), "frames state hashes");
        crate::stream::check(frame.volume);
        volumes.push(frame.volume.clone());
    }
    assert_eq!(volumes.len(), FRAMES);
    volumes
}

/// Decodes without the second frame, and holds blocks that are said to be exact against those of all frames.
fn lose_a_frame(bytes: &[u8], whole: &[SparseVolume]) {
    let mut reader = PacketReader::new(bytes).expect("a whole stream");
    let header = *reader.header();
    let mut decoder = Decoder::new(&header, crate::stream::LIMITS);
    decoder.recover(true);
    for (frame, whole) in whole.iter().enumerate() {
        let packet = reader.next_frame().expect("a whole stream").expect("as many frames as before");
        if frame == 1 {
            continue;
        }
        let volume =
            decoder.decode_and_verify(&packet).expect("each frame can be gone on from").volume.clone();
        assert!(volume.coords() == whole.coords(), "the block set is exact");
        for block in 0..volume.block_count() {
            if decoder.exact_blocks().is_none_or(|exact| exact.contains(block)) {
                assert!(volume.block(block) == whole.block(block), "frame {frame}, block {block}");
            }
        }
    }
}

fn header(fields: &mut Fields) -> StreamHeader {
    let is_main = fields.flag();
    let edges = [BlockEdge::E8, BlockEdge::E4, BlockEdge::E16];
    let edge = edges[usize::from(fields.below(3)) * usize::from(!is_main)];
    let profile = if is_main {
        Profile::Main
    } else {
        let coefficients = 1 + fields.u16() % (edge.block_voxels() as u16);
        let mut step = || 1 << fields.below(21);
        Profile::Paper(PaperParameters { coefficients, dc_step: step(), ac_step: step() })
    };
    let truncation = Truncation::from_voxels(2 + u32::from(fields.below(15))).expect("2 to 16");
    let voxel_size = VoxelSize::from_metres(0.005).expect("in range");
    let frame_rate = FrameRate::DEFAULT;
    StreamHeader::new(profile, Grid { voxel_size, edge, truncation }, frame_rate)
}

fn settings(fields: &mut Fields) -> EncoderSettings {
    let motion = match fields.below(5) {
        4 => MotionMode::Auto,
        kind => MotionMode::Fixed(Prediction::ALL[usize::from(kind)]),
    };
    let kind = fields.u8();
    let preset = if kind.is_multiple_of(16) { Preset::Archive } else { Preset::Realtime };
    let refresh = if kind & 16 == 0 { Refresh::Keyframes } else { Refresh::Gradual };
    let tools = fields.u8();
    let used = |tool: u8| tools >> tool & 1 == 0;
    let main = MainSettings {
        quality: FrameQuality::of_step(f32::from(fields.u8()) / 16.0 + 0.01),
        band: if fields.flag() { Band::Full } else { Band::Surface },
        tools: Tools {
            spatial: used(0),
            motion: used(1),
            merging: used(2),
            pursuit: used(3),
            weights: used(4),
            signs: used(5),
            filter: used(6),
            skip: used(7),
        },
        effort: if fields.flag() { SearchEffort::THOROUGH } else { SearchEffort::QUICK },
        filter: (fields.below(26), fields.u8()),
        half_voxel_vectors: fields.flag(),
        refresh,
        ..preset.settings()
    };
    EncoderSettings { motion, gop: 1 + u32::from(fields.below(4)), checksums: true, slices: None, main }
}

/// Blocks of planes, of noise and of constants, near each other or at the ends of the range.
fn volume(fields: &mut Fields, grid: Grid) -> SparseVolume {
    let mut blocks = BTreeMap::new();
    for _ in 0..fields.below(BLOCKS + 1) {
        let place = fields.u8();
        let near = [place & 3, place >> 2 & 3, place >> 4 & 3].map(|c| i32::from(c) - 2);
        let coord = match place >> 6 {
            2 => near.map(|c| if c < 0 { c + COORD_LIMIT } else { c }),
            3 => near.map(|c| if c < 0 { c } else { c - COORD_LIMIT }),
            _ => near,
        };
        blocks.insert(coord, block(fields, grid));
    }
    let mut builder = VolumeBuilder::new(grid);
    for (coord, (samples, mask)) in blocks {
        builder.push(BlockCoord::from(coord), samples, mask);
    }
    builder.finish()
}

fn block(fields: &mut Fields, grid: Grid) -> (Vec<i16>, Option<VoxelMask>) {
    let (edge, limit) = (grid.edge.voxels(), i32::from(grid.truncation.codes()));
    let kind = fields.u8();
    let normal = [fields.u8(), fields.u8(), fields.u8()].map(|c| i32::from(c.cast_signed()) * 4);
    let offset = i32::from(fields.u16().cast_signed()) / 8;
    let mut noise = u32::from(fields.u8());
    let sample = |voxel: usize| {
        let at = [voxel % edge, voxel / edge % edge, voxel / edge / edge].map(|c| c as i32);
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let rough = if kind & 1 == 0 { 0 } else { (noise >> 20) as i32 - 2048 };
        let plane: i32 = (0..3).map(|axis| normal[axis] * at[axis]).sum();
        (plane + offset + rough).clamp(-limit, limit) as i16
    };
    let samples = (0..grid.edge.block_voxels()).map(sample).collect();
    let mask = (kind & 6 == 6).then(|| {
        let mut mask = VoxelMask::empty(grid.edge);
        let step = 1 + usize::from(kind >> 3);
        (0..grid.edge.block_voxels()).step_by(step).for_each(|voxel| mask.insert(voxel));
        mask
    });
    (samples, mask)
}

/// Numbers off the bytes; zeros past their end.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn u8(&mut self) -> u8 {
        self.0.split_off_first().copied().unwrap_or(0)
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes([self.u8(), self.u8()])
    }

    fn flag(&mut self) -> bool {
        self.u8() % 2 == 1
    }

    fn below(&mut self, end: u8) -> u8 {
        self.u8() % end
    }
}
