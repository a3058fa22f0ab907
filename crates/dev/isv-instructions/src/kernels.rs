//! The kernels that are counted, each on input that is the same everywhere: balls, a sphere of triangles, seeded noise.

use anyhow::{Context, Error, Result};
use isv_decode::main::activity::{Activity, expected_activity};
use isv_decode::main::extension::DecodedBlocks;
use isv_decode::main::reconstruct::add_residual;
use isv_decode::main::syntax::block_set::BlockSetModels;
use isv_decode::main::{BlockLevels, BlockMode, COEFFICIENTS, FrameSymbols, MainParameters, MainReference};
use isv_decode::shared::syntax::SyntaxError;
use isv_decode::{Decoder, Limits};
use isv_encode::{Encoder, EncoderSettings, Preset, probe};
use isv_entropy::{BitModel, RangeDecoder, RangeEncoder};
use isv_format::{FrameRate, Packet, PacketReader, PacketWriter, Profile, StreamHeader};
use isv_ingest::{MeshIngest, decide_sign, ingest_mesh};
use isv_kernels::block8::Block;
use isv_kernels::deblock::{FaceFilter, smooth_face};
use isv_kernels::quant::{Quantizer, StepSize};
use isv_kernels::surface_fit::SurfaceFit;
use isv_kernels::warp::{MotionVector, StitchedReference};
use isv_kernels::window::{ROW, ROWS, WindowRows};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{Random, ball, sphere};
use isv_volume::{BlockCoord, BlockEdge, BlockSet, Grid, SparseVolume, Truncation, VoxelSize};
use std::collections::BTreeMap;
use std::hint::black_box;

/// What is given the work to count; it may run it more than once.
pub(super) type Counter<'a> = &'a mut dyn FnMut(&mut dyn FnMut());

/// A piece of work whose instructions are counted.
pub(super) struct Kernel {
    pub(super) name: &'static str,
    /// What the count is divided by.
    pub(super) unit: &'static str,
    /// Hands over the work, once, and says how many units one run of it is.
    pub(super) work: fn(&Inputs, Counter) -> usize,
}

/// All of them, in the order of the table.
pub(super) const KERNELS: [Kernel; 21] = [
    Kernel { name: "forward DCT", unit: "block", work: forward_dct },
    Kernel { name: "inverse DCT", unit: "block", work: inverse_dct },
    Kernel { name: "dequantization", unit: "level", work: dequantization },
    Kernel { name: "residual added to a prediction", unit: "block", work: residual },
    Kernel { name: "warp by quarter voxels, in a window", unit: "block", work: window },
    Kernel { name: "warp, 3-DoF, stitched", unit: "block", work: |_, counter| warp([0; 3], counter) },
    Kernel { name: "warp, 6-DoF, stitched", unit: "block", work: |_, counter| warp([5, -3, 2], counter) },
    Kernel { name: "spatial prediction", unit: "block", work: spatial_prediction },
    Kernel { name: "normal equations of Gauss-Newton", unit: "block", work: normal_equations },
    Kernel { name: "pursuit of levels", unit: "block", work: pursuit },
    Kernel { name: "range coder, encode", unit: "bit", work: range_encode },
    Kernel { name: "range coder, decode", unit: "bit", work: range_decode },
    Kernel { name: "deblocking", unit: "face", work: deblocking },
    Kernel { name: "extension of a frame", unit: "block made", work: extension },
    Kernel { name: "block set of a keyframe", unit: "block", work: keyframe_block_set },
    Kernel { name: "block set of a P-frame", unit: "block", work: later_block_set },
    Kernel { name: "marching cubes", unit: "surface block", work: marching_cubes },
    Kernel { name: "ingest, distance and sign", unit: "voxel", work: ingest },
    Kernel {
        name: "a whole keyframe, encoded",
        unit: "block",
        work: |inputs, counter| encode(inputs, 0, counter),
    },
    Kernel {
        name: "a whole P-frame, encoded",
        unit: "block",
        work: |inputs, counter| encode(inputs, 1, counter),
    },
    Kernel { name: "a whole P-frame, decoded", unit: "block", work: decode },
];

/// What kernels work on.
pub(super) struct Inputs {
    header: StreamHeader,
    /// Two frames of a ball.
    volumes: [SparseVolume; 2],
    /// Packets of the frames, coded at preset `realtime`.
    packets: Vec<Packet>,
    /// Their sets of coded blocks, and how many those are.
    block_sets: Vec<Vec<u8>>,
    blocks: Vec<usize>,
    /// The volume of the first, decoded, and which of its blocks were coded.
    decoded: SparseVolume,
    coded: Vec<BlockCoord>,
}

impl Inputs {
    pub(super) fn new() -> Result<Self> {
        let truncation = Truncation::DEFAULT;
        let grid = Grid { voxel_size: VoxelSize::from_metres(0.005)?, edge: BlockEdge::E8, truncation };
        let frame_rate = FrameRate::DEFAULT;
        let header = StreamHeader::new(Profile::Main, grid, frame_rate);
        let volumes = [0.0, 1.0].map(|t| ball(grid, t));
        let (mut encoder, mut writer) = (encoder(&header), PacketWriter::new(Vec::new(), &header)?);
        let (mut block_sets, mut blocks) = (Vec::new(), Vec::new());
        for volume in &volumes {
            let frame = encoder.encode(volume);
            block_sets.push(frame.payload().block_set.to_vec());
            blocks.push(frame.payload().header.blocks as usize);
            writer.write_frame(frame.keyframe, 0, &frame.payload())?;
        }
        let stream = writer.finish()?;
        let mut reader = PacketReader::new(&stream[..])?;
        let packets =
            (0..2).map(|_| reader.next_frame()?.context("two frames")).collect::<Result<Vec<_>>>()?;
        let mut decoder = Decoder::new(&header, Limits::default());
        let decoded = decoder.decode(&packets[0])?.volume.clone();
        let (_, coded) = BlockSetModels::default()
            .read(&block_sets[0], blocks[0], None, false, |_| no_activity())
            .map_err(|SyntaxError(why)| Error::msg(why))?;
        Ok(Self { header, volumes, packets, block_sets, blocks, decoded, coded })
    }

    /// The coded blocks of the first frame, as decoded.
    fn coded_volume(&self) -> SparseVolume {
        let index = self.decoded.index();
        let block = |coord| self.decoded.block(index.get(coord).expect("coded blocks are decoded") as usize);
        let samples = self.coded.iter().flat_map(|coord| block(*coord)).copied().collect();
        SparseVolume::from_parts(self.header.grid, self.coded.clone(), samples, BTreeMap::new())
    }
}

fn encoder(header: &StreamHeader) -> Encoder {
    Encoder::new(header, EncoderSettings { main: Preset::Realtime.settings(), ..EncoderSettings::default() })
}

/// A sloping surface with some noise, within the truncation.
fn block(seed: u64) -> Block {
    let mut random = Random::new(seed);
    let (slope, offset) = (random.point() * 200.0, random.signed() * 600.0);
    std::array::from_fn(|v| {
        let [x, y, z] = [v % 8, v / 8 % 8, v / 64].map(|c| c as f64 - 3.5);
        (offset + slope.x * x + slope.y * y + slope.z * z + 30.0 * random.signed()).clamp(-2048.0, 2048.0)
            as i16
    })
}

/// Levels as the encoder likes them: a handful, small, of low frequencies.
fn levels() -> [i32; COEFFICIENTS] {
    let mut levels = [0; COEFFICIENTS];
    [(0, 5), (1, -2), (2, 1), (3, 1), (6, -1), (11, 1)].into_iter().for_each(|(k, level)| levels[k] = level);
    levels
}

fn forward_dct(inputs: &Inputs, counter: Counter) -> usize {
    let transform = MainParameters::new(inputs.header.grid).transform;
    let residual = block(1);
    counter(&mut || transform.forward(black_box(&mut residual.clone())));
    1
}

fn inverse_dct(inputs: &Inputs, counter: Counter) -> usize {
    let transform = MainParameters::new(inputs.header.grid).transform;
    let mut coefficients = block(1);
    transform.forward(&mut coefficients);
    counter(&mut || transform.inverse(black_box(&mut coefficients.clone())));
    1
}

fn dequantization(inputs: &Inputs, counter: Counter) -> usize {
    let exponent = MainParameters::new(inputs.header.grid).transform.coefficient_exponent();
    let quantizer = Quantizer::new(StepSize::new(9011).expect("a step in range"), exponent);
    let levels = levels();
    counter(&mut || {
        for level in &levels {
            black_box(quantizer.dequantize(black_box(*level)));
        }
    });
    levels.len()
}

fn residual(inputs: &Inputs, counter: Counter) -> usize {
    let parameters = MainParameters::new(inputs.header.grid);
    let (quantizer, mut coded, mut samples) = (parameters.quantizer(9011), BlockLevels::default(), block(1));
    coded.push(&levels());
    counter(&mut || add_residual(&parameters, &quantizer, black_box(coded.of(0)), &mut samples));
    1
}

fn window(_: &Inputs, counter: Counter) -> usize {
    let mut window = WindowRows { first: 3, ..WindowRows::default() };
    for (row, samples) in window.samples.as_flattened_mut().chunks_mut(512).enumerate() {
        samples.copy_from_slice(&block(row as u64)[..samples.len()]);
    }
    assert_eq!(window.samples.as_flattened().len(), ROW * ROWS);
    counter(&mut || black_box(&window).translate(black_box([1, 2, 3]), black_box(&mut [0; 512])));
    1
}

fn warp(rotation: [i8; 3], counter: Counter) -> usize {
    let mut stitched = StitchedReference::new(BlockEdge::E8);
    (0..27).for_each(|slot| stitched.put_block(slot, &block(slot as u64)));
    let motion = MotionVector { translation: [5, -6, 7], rotation };
    counter(&mut || stitched.warp(black_box(motion), black_box(&mut [0; 512])));
    1
}

/// From the thirteen neighbours before a block.
fn spatial_prediction(_: &Inputs, counter: Counter) -> usize {
    let blocks: Vec<Block> = (0..13).map(block).collect();
    counter(&mut || {
        let mut fit = SurfaceFit::new();
        for (slot, block) in (0..).zip(&blocks) {
            fit.add_neighbour([slot % 3 - 1, slot / 3 % 3 - 1, slot / 9 - 1], block);
        }
        black_box(fit.predict(2048, black_box(&mut [0; 512])));
    });
    1
}

fn normal_equations(inputs: &Inputs, counter: Counter) -> usize {
    probe::normal_equations(&inputs.volumes[0], &inputs.volumes[1], counter).len()
}

fn pursuit(inputs: &Inputs, counter: Counter) -> usize {
    probe::pursuit(&inputs.volumes[0], &inputs.volumes[1], counter).len()
}

/// Bits and the contexts that they come in: each context has a likelier side.
fn bits() -> Vec<(usize, bool)> {
    let mut random = Random::new(3);
    let bit = |i: usize| (i * 7 % 32, random.signed() > (i * 7 % 32) as f64 / 16.0 - 0.9);
    (0..4096).map(bit).collect()
}

fn write_bits(bits: &[(usize, bool)]) -> Vec<u8> {
    let (mut models, mut encoder) = ([BitModel::default(); 32], RangeEncoder::new());
    bits.iter().for_each(|(context, bit)| encoder.encode(&mut models[*context], *bit));
    encoder.finish()
}

fn range_encode(_: &Inputs, counter: Counter) -> usize {
    let bits = bits();
    counter(&mut || drop(black_box(write_bits(&bits))));
    bits.len()
}

fn range_decode(_: &Inputs, counter: Counter) -> usize {
    let bits = bits();
    let bytes = write_bits(&bits);
    counter(&mut || {
        let (mut models, mut decoder) = ([BitModel::default(); 32], RangeDecoder::new(&bytes));
        bits.iter().for_each(|(context, _)| {
            black_box(decoder.decode(&mut models[*context]));
        });
    });
    bits.len()
}

/// One along each axis.
fn deblocking(inputs: &Inputs, counter: Counter) -> usize {
    let filter = FaceFilter::new(13, 38, inputs.header.grid.truncation).expect("a strength in range");
    let (lower, upper): (Block, Block) = ([40; 512], [-40; 512]);
    counter(&mut || {
        for axis in 0..3 {
            black_box(smooth_face(axis, &mut black_box(lower), &mut black_box(upper), filter));
        }
    });
    3
}

fn extension(inputs: &Inputs, counter: Counter) -> usize {
    let coded = inputs.coded_volume();
    counter(&mut || drop(black_box(DecodedBlocks::from_coded(&coded))));
    DecodedBlocks::from_coded(&coded).volume().block_count() - coded.block_count()
}

/// Nothing is expected without a frame before.
fn no_activity() -> Result<Vec<Activity>, SyntaxError> {
    Ok(Vec::new())
}

fn keyframe_block_set(inputs: &Inputs, counter: Counter) -> usize {
    let (bytes, count) = (&inputs.block_sets[0], inputs.blocks[0]);
    let models = BlockSetModels::default();
    counter(&mut || drop(black_box(models.clone().read(bytes, count, None, false, |_| no_activity()))));
    inputs.blocks[0]
}

/// With the reference that the decoder has, as far as the set of blocks depends on it.
fn later_block_set(inputs: &Inputs, counter: Counter) -> usize {
    let mut models = BlockSetModels::default();
    let first = models.read(&inputs.block_sets[0], inputs.blocks[0], None, false, |_| no_activity());
    first.expect("a set of our own");
    let count = inputs.coded.len();
    let mut none = BlockLevels::with_capacity(count);
    (0..count).for_each(|_| none.push(&[]));
    let (coords, modes) = (inputs.coded.clone(), vec![BlockMode::Spatial; count]);
    let symbols = FrameSymbols { coords, modes, levels: none, ..FrameSymbols::default() };
    let reference =
        MainReference::new(DecodedBlocks::from_coded(&inputs.coded_volume()), symbols, BTreeMap::new());
    counter(&mut || {
        let activity = |skipped: &BlockSet| Ok::<_, SyntaxError>(expected_activity(&reference, skipped));
        let (bytes, count) = (&inputs.block_sets[1], inputs.blocks[1]);
        let read = models.clone().read(bytes, count, Some(reference.blocks()), false, activity);
        assert_eq!(read.map(|(_, coords)| coords.len()), Ok(count), "the set as it was written");
    });
    inputs.blocks[1]
}

fn marching_cubes(inputs: &Inputs, counter: Counter) -> usize {
    let options = SurfaceOptions::default();
    counter(&mut || drop(black_box(extract_surface(&inputs.volumes[0], &options))));
    inputs.blocks[0]
}

/// A sphere of 7.5 cm, closed, of triangles about as large as voxels.
fn ingest(inputs: &Inputs, counter: Counter) -> usize {
    let mesh = sphere(0.075, 40);
    let settings = MeshIngest::new(inputs.header.grid);
    let sign = decide_sign(&mesh, settings.sign).0;
    let volume = || ingest_mesh(&mesh, &settings, sign).expect("a small sphere");
    counter(&mut || drop(black_box(volume())));
    volume().sample_count()
}

/// The frame after so many others, each run with an encoder of its own.
fn encode(inputs: &Inputs, before: usize, counter: Counter) -> usize {
    let mut encoders = [encoder(&inputs.header), encoder(&inputs.header)];
    for encoder in &mut encoders {
        inputs.volumes[..before].iter().for_each(|volume| drop(encoder.encode(volume)));
    }
    let mut fresh = encoders.iter_mut();
    counter(&mut || {
        let encoder = fresh.next().expect("one run to warm up and one to count");
        drop(black_box(encoder.encode(&inputs.volumes[before])));
    });
    inputs.blocks[before]
}

fn decode(inputs: &Inputs, counter: Counter) -> usize {
    let mut decoders = [0; 2].map(|_| Decoder::new(&inputs.header, Limits::default()));
    for decoder in &mut decoders {
        decoder.decode(&inputs.packets[0]).expect("a frame of our own");
    }
    let mut fresh = decoders.iter_mut();
    counter(&mut || {
        let decoder = fresh.next().expect("one run to warm up and one to count");
        black_box(decoder.decode(&inputs.packets[1]).expect("a frame of our own").volume);
    });
    inputs.blocks[1]
}
