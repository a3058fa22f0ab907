//! Streams of profile `main`: what the encoder makes of small scenes, and symbols drawn at random.

use super::{Stream, encode, header};
use anyhow::{Result, ensure};
use isv::raw::decode::{DecodeError, Decoder, Limits, volume_hash};
use isv::raw::encode::{Band, Encoder, EncoderSettings, FrameQuality, MainSettings, Refresh, Tools};
use isv::raw::format::{
    FormatError, FrameCoding, FrameHeader, FrameKind, FramePayload, MainFrameHeader, PacketReader,
    PacketWriter, Profile, SlicePayload, StreamHeader,
};
use isv::raw::volume::{BlockCoord, Grid, SparseVolume, VolumeBuilder};
use isv_entropy::{BitModel, IntegerModel, RangeEncoder};
use isv_testkit::{Random, ball, still_and_moving_ball, volume_of};

/// All of them, by name.
pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    let usual = MainSettings::default();
    let quarters = MainSettings { half_voxel_vectors: false, filter: (0, 0), ..usual };
    let strong = MainSettings { filter: (25, 6), quality: FrameQuality::of_step(1.1), ..usual };
    // Nothing moves in it, but is coded again.
    let tools = Tools { skip: false, ..Tools::ALL };
    let fine = MainSettings { quality: FrameQuality::of_step(0.001), band: Band::Full, tools, ..usual };
    let whole = MainSettings { band: Band::Full, ..quarters };
    Ok(vec![
        ("main_intra", moving_ball(8, 1, 1, usual)?),
        ("main_inter", moving_ball(8, 4, 1, usual)?),
        ("main_quarter_vectors", moving_ball(8, 4, 1, quarters)?),
        ("main_three_slices", moving_ball(8, 4, 3, strong)?),
        ("main_whole_band", moving_ball(2, 4, 2, whole)?),
        ("main_fine_steps", scenes(16, &[[0; 3], [0; 3]], fine)?),
        ("main_scene_jumps", scenes(8, &JUMPS, usual)?),
        ("main_still_cells", still_and_moving(8, usual)?),
        ("main_settled", foreign(include_bytes!("main_settled.isv"))?),
        ("main_noise", noise(8, 1, 1, false)?),
        ("main_noise_slices", noise(16, 4, 2, false)?),
        ("main_noise_still_cells", noise(8, 2, 3, true)?),
        ("main_resilient", refreshed_ball()?),
        ("main_noise_resilient", resilient_noise(8, 2, 4, false)?),
        ("main_refreshed", refreshed_ball()?),
        ("main_noise_refreshed", resilient_noise(8, 2, 5, true)?),
    ])
}

/// Frames of the moving ball with its hole.
fn moving_ball(truncation: u32, gop: u32, slices: u16, main: MainSettings) -> Result<Stream> {
    let header = header(Profile::Main, 8, truncation)?;
    let volumes: Vec<_> = (0..gop.max(2)).map(|frame| ball(header.grid, f64::from(frame))).collect();
    encode(&header, EncoderSettings { gop, slices: Some(slices), main, ..Default::default() }, &volumes)
}

/// The moving ball with gradual refresh: resilient frames after the first, and all refreshed in three of them.
fn refreshed_ball() -> Result<Stream> {
    let header = header(Profile::Main, 8, 8)?;
    let volumes: Vec<_> = (0..5).map(|frame| ball(header.grid, f64::from(frame))).collect();
    let main = MainSettings { refresh: Refresh::Gradual, ..MainSettings::default() };
    encode(&header, EncoderSettings { gop: 3, slices: Some(2), main, ..Default::default() }, &volumes)
}

/// One GOP of a ball that stays and another one that passes by, stops and goes on.
fn still_and_moving(truncation: u32, main: MainSettings) -> Result<Stream> {
    let header = header(Profile::Main, 8, truncation)?;
    let volumes = [0.0, 1.0, 2.0, 2.0, 4.0].map(|t| still_and_moving_ball(header.grid, t));
    encode(&header, EncoderSettings { main, ..Default::default() }, &volumes)
}

/// A stream of random symbols that another implementation wrote, from the specification alone. It has what no
/// scene of ours has, such as settled masks beside blocks that change.
pub(super) fn foreign(bytes: &[u8]) -> Result<Stream> {
    let mut reader = PacketReader::new(bytes)?;
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    let mut hashes = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        hashes.push(volume_hash(decoder.decode(&packet)?.volume));
    }
    Ok((bytes.to_vec(), hashes))
}

/// Places of the small ball, in blocks: in the middle, nowhere, back again, then in corners of the range of
/// coordinates.
const JUMPS: [[i32; 3]; 6] = [
    [0; 3],
    NOWHERE,
    [0; 3],
    [-(1 << 20) + 1; 3],
    [(1 << 20) - 1, -(1 << 20) + 1, 7],
    [(1 << 20) - 2, 3, -9],
];
/// No ball.
const NOWHERE: [i32; 3] = [i32::MAX; 3];

/// One GOP of a small ball at places.
fn scenes(truncation: u32, places: &[[i32; 3]], main: MainSettings) -> Result<Stream> {
    let header = header(Profile::Main, 8, truncation)?;
    let small = volume_of(header.grid, 1, |[x, y, z]| (x * x + 1.3 * y * y + z * z).sqrt() - 5.2, |_| false);
    let volumes: Vec<_> = places.iter().map(|place| moved(&small, *place)).collect();
    encode(&header, EncoderSettings { main, ..Default::default() }, &volumes)
}

/// The volume at another place, but for what falls off the range of coordinates.
pub(super) fn moved(volume: &SparseVolume, place: [i32; 3]) -> SparseVolume {
    let mut builder = VolumeBuilder::new(*volume.grid());
    for (block, coord) in volume.coords().iter().enumerate().filter(|_| place != NOWHERE) {
        let coord = coord.offset(place);
        if coord.in_range() {
            builder.push(coord, volume.block(block).to_vec(), None);
        }
    }
    builder.finish()
}

/// Frames of a stream of random symbols.
const NOISE_FRAMES: usize = 4;
/// Most blocks of such a frame.
const NOISE_BLOCKS: u32 = 160;

/// A stream whose segments are random bytes but for a first block. Any bytes are symbols, among them many that no encoder
/// would choose; what is refused is drawn again. `skip_cells`: whether frames that predict have them.
fn noise(truncation: u32, slices: u16, seed: u64, skip_cells: bool) -> Result<Stream> {
    let header = header(Profile::Main, 8, truncation)?;
    let mut random = Random::new(seed);
    let mut frames = vec![NoiseFrame::first(&header)];
    let mut hashes = decode_noise(&header, &frames)?;
    while frames.len() < NOISE_FRAMES {
        frames.push(NoiseFrame::draw(&mut random, frames.len(), slices, skip_cells));
        match announce(&header, &mut frames) {
            Some(found) => hashes = found,
            None => drop(frames.pop()),
        }
    }
    for (frame, hash) in frames.iter_mut().zip(&hashes) {
        frame.header.volume_hash = Some(*hash);
    }
    ensure!(decode_noise(&header, &frames)? == hashes, "hashes do not change what is decoded");
    Ok((write_noise(&header, &frames)?, hashes))
}

/// Noise with resilient frames of a ball's blocks, and others after them, whose models and contexts go on
/// from there. `no_spatial_prediction`: of the resilient frames, as our encoder has it since `main_resilient`
/// was made.
fn resilient_noise(truncation: u32, slices: u16, seed: u64, no_spatial_prediction: bool) -> Result<Stream> {
    let header = header(Profile::Main, 8, truncation)?;
    let mut random = Random::new(seed);
    let mut frames = vec![NoiseFrame::first(&header)];
    let mut hashes = decode_noise(&header, &frames)?;
    while frames.len() < 6 {
        let number = frames.len();
        let found = if matches!(number, 1 | 2 | 5) {
            let mut frame = NoiseFrame::resilient(&mut random, &header, number, slices);
            if let FrameCoding::Main(main) = &mut frame.header.coding {
                main.no_spatial_prediction = no_spatial_prediction;
            }
            frames.push(frame);
            decode_noise(&header, &frames).ok()
        } else {
            frames.push(NoiseFrame::draw(&mut random, number + 1, slices, number == 4));
            announce(&header, &mut frames)
        };
        match found {
            Some(found) => hashes = found,
            None => drop(frames.pop()),
        }
    }
    for (frame, hash) in frames.iter_mut().zip(&hashes) {
        frame.header.volume_hash = Some(*hash);
    }
    Ok((write_noise(&header, &frames)?, hashes))
}

/// Has the last frame announce as many blocks as its flags hold, which is found by trying. Hashes of all frames, unless something
/// else is refused.
fn announce(header: &StreamHeader, frames: &mut [NoiseFrame]) -> Option<Vec<u64>> {
    for blocks in 0..NOISE_BLOCKS {
        frames.last_mut()?.header.blocks = blocks;
        match decode_noise(header, frames) {
            Err(DecodeError::Malformed { what, .. }) if what.contains("more blocks than announced") => {}
            decoded => return decoded.ok(),
        }
    }
    None
}

/// A frame's payload, owned.
struct NoiseFrame {
    header: FrameHeader,
    block_set: Vec<u8>,
    masks: Vec<u8>,
    slices: Vec<[Vec<u8>; 2]>,
}

impl NoiseFrame {
    /// A keyframe of one block with the largest level.
    fn first(header: &StreamHeader) -> Self {
        let volume = one_block(header.grid);
        let main = MainSettings { band: Band::Full, ..Default::default() };
        let mut encoder = Encoder::new(header, EncoderSettings { main, ..Default::default() });
        let frame = encoder.encode(&volume);
        let FramePayload { header, block_set, masks, .. } = frame.payload();
        let slices = vec![[Vec::new(), largest_level()]];
        Self { header, block_set: block_set.to_vec(), masks: masks.to_vec(), slices }
    }

    /// A frame after it; every third one does without prediction.
    fn draw(random: &mut Random, frame: usize, slices: u16, skip_cells: bool) -> Self {
        let mut bytes = |count: usize| (0..count).map(|_| (random.signed() * 128.0) as i8 as u8).collect();
        let kind = match frame.is_multiple_of(3) {
            true => FrameKind::Intra,
            false => FrameKind::Predicted { skip_cells },
        };
        let main = MainFrameHeader {
            kind,
            step: [4096, 9000, 30_000, 1 << 20, 700][frame % 5],
            filter: [25, 13, 0, 7, 20][frame % 5],
            filter_limit: [255, 38, 0, 3, 90][frame % 5],
            half_voxel_vectors: frame.is_multiple_of(2),
            no_spatial_prediction: frame == 1,
        };
        let coding = FrameCoding::Main(main);
        let block_set = bytes(60);
        Self {
            header: FrameHeader { blocks: 0, slices, coding, volume_hash: None },
            block_set,
            // No masks: a random one is too often empty.
            masks: vec![0x80],
            slices: (0..slices).map(|_| [far_vector(&bytes(80)), bytes(900 / usize::from(slices))]).collect(),
        }
    }

    /// A resilient frame of the blocks of a small ball that moves, whose other symbols are random.
    fn resilient(random: &mut Random, header: &StreamHeader, frame: usize, slices: u16) -> Self {
        let place = [frame as i32 - 2, 0, 1];
        let small =
            volume_of(header.grid, 1, |[x, y, z]| (x * x + 1.3 * y * y + z * z).sqrt() - 5.2, |_| false);
        let mut encoder = Encoder::new(header, EncoderSettings::default());
        let keyframe = encoder.encode(&moved(&small, place));
        let keyframe = keyframe.payload();
        let Self { header: drawn, masks, slices: segments, .. } =
            Self::draw(random, 3 * frame + 1, slices, false);
        let FrameCoding::Main(main) = drawn.coding else { unreachable!("frames of profile main are drawn") };
        let main = MainFrameHeader { kind: FrameKind::Resilient, ..main };
        let header = FrameHeader { blocks: keyframe.header.blocks, coding: FrameCoding::Main(main), ..drawn };
        Self { header, block_set: keyframe.block_set.to_vec(), masks, slices: segments }
    }

    fn payload(&self) -> FramePayload<'_> {
        let Self { header, block_set, masks, slices } = self;
        let slices = slices.iter().map(|[modes, coefficients]| SlicePayload { modes, coefficients });
        FramePayload { header: *header, block_set, masks, slices: slices.collect() }
    }
}

/// Random modes after a first block with a vector of its own that leads far, as long as all models are fresh.
fn far_vector(random: &[u8]) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut BitModel::default(), false);
    encoder.encode(&mut BitModel::default(), true);
    for component in [55, -41, 30] {
        IntegerModel::default().encode(&mut encoder, component);
    }
    random.iter().for_each(|byte| encoder.encode_raw(u32::from(*byte), 8));
    encoder.finish()
}

/// The coefficients of a block, under fresh models, of which the second is as large as can be written, and negative.
fn largest_level() -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    let mut decide = |bit| encoder.encode(&mut BitModel::default(), bit);
    // One level, not the first, but the second; beyond the unary code.
    [false, true, false, true].into_iter().chain([false; 14]).for_each(&mut decide);
    // An exponent of 20, its bits, the sign.
    for (value, count) in [((1 << 20) - 1, 20), ((1 << 20) - 1, 20), (1, 1)] {
        encoder.encode_raw(value, count);
    }
    encoder.finish()
}

/// A block that a plane cuts.
fn one_block(grid: Grid) -> SparseVolume {
    let mut builder = VolumeBuilder::new(grid);
    let plane = |voxel: i16| 180 * (voxel % 8) + 90 * (voxel / 8 % 8) - 60 * (voxel / 64) - 500;
    builder.push(BlockCoord::from([-1, 0, 2]), (0..512).map(plane).collect(), None);
    builder.finish()
}

fn write_noise(header: &StreamHeader, frames: &[NoiseFrame]) -> Result<Vec<u8>, FormatError> {
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    for (index, frame) in frames.iter().enumerate() {
        writer.write_frame(index == 0, header.frame_rate.timestamp_ns(index as u64), &frame.payload())?;
    }
    writer.finish()
}

/// Hashes of the frames as decoded.
fn decode_noise(header: &StreamHeader, frames: &[NoiseFrame]) -> Result<Vec<u64>, DecodeError> {
    let bytes = write_noise(header, frames)?;
    let mut reader = PacketReader::new(&bytes[..])?;
    let mut decoder = Decoder::new(header, Limits::default());
    let mut hashes = Vec::new();
    while let Some(packet) = reader.next_frame()? {
        hashes.push(volume_hash(decoder.decode(&packet)?.volume));
    }
    Ok(hashes)
}
