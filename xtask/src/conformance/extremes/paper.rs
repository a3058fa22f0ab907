//! Profile `paper`: every symbol at its ends.

use super::super::raw::{RawFrame, segment, sorted, stream_of};
use super::super::{Stream, encode};
use super::{FIRST, LAST, frame_of_ones, header, keyframe};
use anyhow::Result;
use isv::raw::decode::ReferenceBlocks;
use isv::raw::decode::paper::FrameSymbols;
use isv::raw::decode::paper::syntax::EntropyState;
use isv::raw::encode::paper::syntax::write_symbols;
use isv::raw::encode::{EncoderSettings, MotionMode};
use isv::raw::format::{FrameCoding, FrameHeader, PaperParameters, Prediction, Profile, StreamHeader};
use isv::raw::kernels::warp::{MotionVector, ROTATION_LIMIT};
use isv::raw::volume::{BlockCoord, BlockEdge, BlockIndex, SparseVolume, VoxelMask};
use isv_entropy::BitModel;
use isv_testkit::{Random, ball};
use std::collections::BTreeMap;

/// Parameters of a stream, and the slices of its frames.
struct Case {
    name: &'static str,
    edge: BlockEdge,
    truncation: u32,
    coefficients: u16,
    /// DC and AC step in sixteenths of a code.
    steps: [u32; 2],
    slices: [u16; 7],
}

const CASES: [Case; 6] = [
    Case {
        name: "paper_ends_edge_4",
        edge: BlockEdge::E4,
        truncation: 2,
        coefficients: 64,
        steps: [1, 1 << 20],
        slices: [1, 256, 3, 2, 7, 256, 1],
    },
    Case {
        name: "paper_ends_edge_4_wide",
        edge: BlockEdge::E4,
        truncation: 16,
        coefficients: 1,
        steps: [1 << 20, 1],
        slices: [256, 1, 2, 1, 1, 4, 12],
    },
    Case {
        name: "paper_ends_edge_8",
        edge: BlockEdge::E8,
        truncation: 2,
        coefficients: 1,
        steps: [900, 1],
        slices: [2, 1, 2, 3, 4, 5, 1],
    },
    Case {
        name: "paper_ends_edge_8_wide",
        edge: BlockEdge::E8,
        truncation: 16,
        coefficients: 512,
        steps: [1, 1],
        slices: [1, 128, 1, 2, 3, 1, 128],
    },
    Case {
        name: "paper_ends_edge_16",
        edge: BlockEdge::E16,
        truncation: 2,
        coefficients: 4096,
        steps: [1 << 20, 1 << 20],
        slices: [16, 1, 2, 3, 1, 1, 2],
    },
    Case {
        name: "paper_ends_edge_16_wide",
        edge: BlockEdge::E16,
        truncation: 16,
        coefficients: 300,
        steps: [5, 700],
        slices: [1, 218, 1, 2, 3, 4, 5],
    },
];

/// How their frames are predicted. The first and the last are keyframes.
const PREDICTIONS: [Prediction; 7] = [
    Prediction::None,
    Prediction::SixDof,
    Prediction::ThreeDof,
    Prediction::None,
    Prediction::ZeroMotion,
    Prediction::SixDof,
    Prediction::None,
];

pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    let mut streams = Vec::new();
    for (seed, case) in (1..).zip(&CASES) {
        let [dc_step, ac_step] = case.steps;
        let parameters = PaperParameters { coefficients: case.coefficients, dc_step, ac_step };
        let header = header(Profile::Paper(parameters), case.edge, case.truncation, seed % 2 == 0)?;
        streams.push((case.name, stream_of(&header, &frames(case, &header, seed))?));
    }
    streams.push(("paper_no_blocks", no_blocks()?));
    streams.push(("paper_empty_between", empty_between()?));
    streams.push(("paper_level_beyond", level_beyond()?));
    Ok(streams)
}

/// The blocks of a frame before, as the next one sees them.
struct Before {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    masks: BTreeMap<u32, VoxelMask>,
}

fn frames(case: &Case, header: &StreamHeader, seed: u64) -> Vec<(bool, RawFrame)> {
    let mut random = Draws(Random::new(seed));
    let mut entropy = EntropyState::new(usize::from(case.coefficients));
    let mut before: Option<Before> = None;
    let mut frames = Vec::new();
    for (frame, prediction) in PREDICTIONS.into_iter().enumerate() {
        let keyframe = frame == 0 || frame + 1 == PREDICTIONS.len();
        if keyframe {
            (entropy, before) = (EntropyState::new(usize::from(case.coefficients)), None);
        }
        let reference = before.as_ref().map(|before| ReferenceBlocks {
            coords: &before.coords,
            index: &before.index,
            unobserved: &before.masks,
        });
        let symbols = random.symbols(case, header.grid.edge, frame, prediction, reference);
        let slices = usize::from(case.slices[frame]);
        let written = write_symbols(&mut entropy, header.grid.edge, &symbols, slices, reference);
        let slices = written.slices.into_iter().map(|slice| [slice.modes, slice.coefficients]).collect();
        let FrameSymbols { coords, unobserved: masks, .. } = symbols;
        let frame_header = FrameHeader {
            blocks: coords.len() as u32,
            slices: case.slices[frame],
            coding: FrameCoding::Paper { prediction },
            volume_hash: None,
        };
        before = Some(Before { index: BlockIndex::new(&coords), coords, masks });
        let block_set = written.block_set;
        frames.push((keyframe, RawFrame { header: frame_header, block_set, masks: written.masks, slices }));
    }
    frames
}

/// Random symbols, more at their ends than between them.
struct Draws(Random);

impl Draws {
    /// Below a bound.
    fn below(&mut self, end: i32) -> i32 {
        (((self.0.signed() + 1.0) / 2.0 * f64::from(end)) as i32).min(end - 1)
    }

    /// Within a bound, often at it.
    fn within(&mut self, limit: i32) -> i32 {
        match self.below(5) {
            0 => limit,
            1 => -limit,
            2 => 0,
            _ => self.below(2 * limit + 1) - limit,
        }
    }

    /// Level of any magnitude, mostly 0: the more so, the more there are.
    fn level(&mut self, coefficients: u16) -> i32 {
        let magnitude = match self.below(60 + i32::from(coefficients) / 8) {
            0 => 1 << 20,
            1..4 => {
                let end = 1 << self.below(21);
                1 + self.below(end)
            }
            _ => return 0,
        };
        if self.below(2) == 0 { magnitude } else { -magnitude }
    }

    fn symbols(
        &mut self,
        case: &Case,
        edge: BlockEdge,
        frame: usize,
        prediction: Prediction,
        reference: Option<ReferenceBlocks>,
    ) -> FrameSymbols {
        let coords = self.blocks(frame);
        let references = FrameSymbols::find_references(&coords, prediction, reference);
        let translation = MotionVector::translation_limit(edge);
        let motion = references.iter().map(|source| {
            let mut vector = MotionVector::ZERO;
            if source.is_some() && prediction.has_motion() {
                vector.translation = std::array::from_fn(|_| self.within(translation) as i8);
                if prediction == Prediction::SixDof {
                    vector.rotation = std::array::from_fn(|_| self.within(ROTATION_LIMIT) as i8);
                }
            }
            vector
        });
        let motion = motion.collect();
        let levels = 0..coords.len() * usize::from(case.coefficients);
        let levels = levels.map(|_| self.level(case.coefficients)).collect();
        let unobserved = if frame == 4 { BTreeMap::new() } else { self.masks(edge, coords.len()) };
        FrameSymbols { prediction, unobserved, references, motion, levels, coords }
    }

    /// A few blocks side by side, some of which come and go, and some at the ends of the range of coordinates.
    fn blocks(&mut self, frame: usize) -> Vec<BlockCoord> {
        let mut coords: Vec<[i32; 3]> = vec![[FIRST; 3], [LAST; 3], [FIRST, LAST, 0], [LAST, -1, FIRST]];
        coords.extend((0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2]));
        coords.push([self.below(4) - 2, self.below(4) - 2, -1]);
        if frame % 2 == 1 {
            coords.remove(5);
        }
        sorted(&coords)
    }

    /// A whole block, one voxel, half of the voxels.
    fn masks(&mut self, edge: BlockEdge, blocks: usize) -> BTreeMap<u32, VoxelMask> {
        let mut one = VoxelMask::empty(edge);
        one.insert(edge.block_voxels() - 1);
        let mut half = VoxelMask::empty(edge);
        (0..edge.block_voxels()).filter(|_| self.below(2) == 0).for_each(|voxel| half.insert(voxel));
        let masks = [VoxelMask::full(edge), one, half, VoxelMask::full(edge)];
        let masks = masks.into_iter().map(|mask| (self.below(blocks as i32) as u32, mask));
        masks.collect()
    }
}

/// Frames without a block: in one slice, in the most, with every prediction.
fn no_blocks() -> Result<Stream> {
    let header = super::small_paper()?;
    let frames =
        Prediction::ALL.into_iter().chain([Prediction::None]).enumerate().map(|(frame, prediction)| {
            let mut empty = frame_of_ones(&header, prediction, 0);
            empty.header.slices = [1, 256, 1, 256, 2][frame];
            (empty.block_set, empty.masks) = (Vec::new(), vec![0x80]);
            empty.slices = vec![[Vec::new(), Vec::new()]; usize::from(empty.header.slices)];
            (frame % 4 == 0, empty)
        });
    stream_of(&header, &frames.collect::<Vec<_>>())
}

/// A GOP of a ball in which a frame without a block lies between others: what follows it has a reference, and an empty one.
fn empty_between() -> Result<Stream> {
    let parameters = PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 };
    let header = header(Profile::Paper(parameters), BlockEdge::E8, 8, false)?;
    let nothing = SparseVolume::empty(header.grid);
    let volumes = [ball(header.grid, 0.0), nothing, ball(header.grid, 1.0), ball(header.grid, 2.0)];
    let motion = MotionMode::Fixed(Prediction::SixDof);
    encode(&header, EncoderSettings { motion, slices: Some(2), ..Default::default() }, &volumes)
}

/// Levels whose bits say more than 2^20, either way, where the step is so fine that the limit can be told from what they say.
fn level_beyond() -> Result<Stream> {
    let parameters = PaperParameters { coefficients: 8, dc_step: 1, ac_step: 1 };
    let header = header(Profile::Paper(parameters), BlockEdge::E16, 16, false)?;
    let frame = |negative: bool, bits: u32| {
        let mut frame = keyframe(&header, &[[0; 3]], 0);
        frame.slices[0][1] = segment(|encoder| {
            let mut decide = |bit| encoder.encode(&mut BitModel::default(), bit);
            // Not zero, the sign, an exponent of 20, two bits of the mantissa: each the first that its model sees.
            [false, negative]
                .into_iter()
                .chain([true; 20])
                .chain([bits >> 19 & 1 != 0, bits >> 18 & 1 != 0])
                .for_each(&mut decide);
            encoder.encode_raw(bits & ((1 << 18) - 1), 18);
        });
        // Zeros, which are ones: the other levels are 0.
        frame.slices[0][1].extend([0; 8]);
        (true, frame)
    };
    stream_of(
        &header,
        &[frame(false, (1 << 20) - 1), frame(true, (1 << 20) - 1), frame(true, 0), frame(false, 1)],
    )
}
