//! Profile `main`: every field and every symbol at its ends, and symbols drawn at random.

use super::super::Stream;
use super::super::raw::{RawFrame, RawStream, judge, segment, stream_of};
use super::{FIRST, LAST, MAIN, PREDICTED, frame_of_ones, header, keyframe, small_main};
use anyhow::{Result, bail};
use isv::raw::decode::DecodeError;
use isv::raw::format::{FrameCoding, FrameKind, MainFrameHeader, Prediction, Profile, StreamHeader};
use isv::raw::volume::BlockEdge;
use isv_entropy::{BitModel, IntegerModel};
use isv_testkit::Random;

pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    Ok(vec![
        ("main_octree", octrees()?),
        ("main_vectors", vectors()?),
        ("main_levels", levels()?),
        ("main_masks", masks()?),
        ("main_no_blocks", no_blocks()?),
        ("main_ends", random(2, 11, &ENDS)?),
        ("main_ends_wide", random(16, 12, &ENDS)?),
        ("main_random_gop", random(8, 13, &LONG)?),
        ("main_random_still_cells", random(5, 14, &SKIPS)?),
        ("main_masks_without_prediction", random(4, 15, &MASKED)?),
        ("main_filter_across_slices", random(8, 16, &FILTERED)?),
    ])
}

/// Roots of every kind: the whole range, a single block, and one that is larger than it has to be.
fn octrees() -> Result<Stream> {
    let header = header(Profile::Main, BlockEdge::E8, 2, true)?;
    let corners: Vec<[i32; 3]> = (0..8)
        .map(|corner| [0, 1, 2].map(|axis| if corner >> axis & 1 == 0 { FIRST } else { LAST }))
        .collect();
    let frames = [
        (true, keyframe(&header, &corners, 21)),
        (true, keyframe(&header, &[[FIRST; 3]], 0)),
        (true, keyframe(&header, &[[LAST; 3]], 0)),
        (true, keyframe(&header, &[[0; 3]], 21)),
        (true, keyframe(&header, &[[-1, LAST, FIRST], [-1, LAST - 1, FIRST]], 7)),
        // All blocks of a cell of 4x4x4.
        (true, keyframe(&header, &(0..64).map(|i| [i & 3, i >> 2 & 3, i >> 4]).collect::<Vec<_>>(), 2)),
    ];
    stream_of(&header, &frames)
}

/// Vectors of their own as long as they may be, in halves and quarters, to where there are blocks and to where there are none.
fn vectors() -> Result<Stream> {
    let header = small_main()?;
    let mut frames = Vec::new();
    let mut random = Draws(Random::new(5));
    for (vector, half) in [
        ([128, -128, 128], false),
        ([-128, 128, -128], true),
        ([-127, 16, 1], false),
        ([2, -16, -18], true),
        ([0, 0, 0], false),
    ] {
        frames.push((true, with_coefficients(keyframe(&header, &[[0; 3], [3, -3, 2]], 21), &mut random)));
        let main = MainFrameHeader { half_voxel_vectors: half, ..PREDICTED };
        frames.push((false, drawn(&header, &frames, || far_vectors(&header, main, vector, &mut random))?));
    }
    stream_of(&header, &frames)
}

/// A frame of all blocks that there are, of which the first has this vector in quarter voxels; the others are random.
fn far_vectors(
    header: &StreamHeader,
    main: MainFrameHeader,
    vector: [i32; 3],
    random: &mut Draws,
) -> RawFrame {
    let mut frame = frame_of_ones(header, Prediction::ThreeDof, 54);
    frame.header.coding = FrameCoding::Main(main);
    frame.slices[0][0] = segment(|encoder| {
        // Not spatial, a vector of its own; the models are fresh.
        encoder.encode(&mut BitModel::default(), false);
        encoder.encode(&mut BitModel::default(), true);
        for component in vector {
            let steps = if main.half_voxel_vectors { component / 2 } else { component };
            IntegerModel::default().encode(encoder, steps);
        }
        random.bytes(7).iter().for_each(|byte| encoder.encode_raw(u32::from(*byte), 8));
    });
    frame.slices[0][0].extend([0; 40]);
    frame
}

/// The first frame drawn that is not refused.
fn drawn(
    header: &StreamHeader,
    before: &[(bool, RawFrame)],
    mut draw: impl FnMut() -> RawFrame,
) -> Result<RawFrame> {
    for _ in 0..ATTEMPTS {
        let frame = draw();
        let mut stream = RawStream::new(header);
        for (keyframe, frame) in
            before.iter().map(|(keyframe, frame)| (*keyframe, frame)).chain([(false, &frame)])
        {
            stream.frame(keyframe, 0, false, &frame.to_bytes());
        }
        if judge(&stream.finish()).1.is_none() {
            return Ok(frame);
        }
    }
    bail!("frame {} was refused {ATTEMPTS} times", before.len())
}

/// A keyframe with levels drawn at random.
fn with_coefficients(mut frame: RawFrame, random: &mut Draws) -> RawFrame {
    frame.slices[0][1] = random.bytes(200);
    frame
}

/// A block with all 162 levels, one with none; levels as large as they may be, under the least and the largest step.
fn levels() -> Result<Stream> {
    let header = header(Profile::Main, BlockEdge::E8, 16, false)?;
    let mut random = Draws(Random::new(6));
    let mut frames = Vec::new();
    for step in [1, 1 << 20, 3000] {
        let mut frame = keyframe(&header, &[[0; 3], [40, 0, 0]], 21);
        frame.header.coding = FrameCoding::Main(MainFrameHeader { step, ..MAIN });
        let all = segment(|encoder| {
            // The models of a first block's count see the same decisions, so their mean is one model.
            let mut counts = [BitModel::default(); 21];
            (0..162).for_each(|count: usize| encoder.encode(&mut counts[count.min(20)], false));
            random.bytes(500).iter().for_each(|byte| encoder.encode_raw(u32::from(*byte), 8));
        });
        frame.slices[0][1] = [all, vec![0; 40]].concat();
        frames.push((true, frame));
        let mut largest = keyframe(&header, &[[0; 3]], 0);
        largest.header.coding = FrameCoding::Main(MainFrameHeader { step, ..MAIN });
        largest.slices[0][1] = segment(|encoder| {
            let mut decide = |bit| encoder.encode(&mut BitModel::default(), bit);
            // One level, the first; beyond the unary code.
            [false, true, true].into_iter().chain([false; 14]).for_each(&mut decide);
            // An exponent of 20, its bits, the sign.
            for (value, count) in [((1 << 20) - 1, 20), ((1 << 20) - 1, 20), (step & 1, 1)] {
                encoder.encode_raw(value, count);
            }
        });
        frames.push((true, largest));
    }
    stream_of(&header, &frames)
}

/// Masks of every voxel that can be in one: zeros decode to ones.
fn masks() -> Result<Stream> {
    let header = header(Profile::Main, BlockEdge::E8, 4, false)?;
    let mut random = Draws(Random::new(7));
    let coords: Vec<[i32; 3]> = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2]).collect();
    let mut frames = Vec::new();
    for frame in 0..4 {
        let mut next = match frame {
            0 => keyframe(&header, &coords, 2),
            _ => frame_of_ones(&header, Prediction::ThreeDof, [64, 216, 512][frame - 1]),
        };
        next = with_coefficients(next, &mut random);
        next.slices[0][1].extend([0; 100]);
        next.masks = vec![0; 400];
        frames.push((frame == 0, next));
    }
    stream_of(&header, &frames[..2])
}

/// Frames without a block, of a reference without one and with one.
fn no_blocks() -> Result<Stream> {
    let header = small_main()?;
    let mut frames = Vec::new();
    for (kind, slices) in [(INTRA, 256), (INTER, 1), (SKIPPING, 256), (INTRA, 2)] {
        let mut frame = frame_of_ones(&header, Prediction::None, 0);
        frame.header.slices = slices;
        frame.header.coding = FrameCoding::Main(MainFrameHeader { kind, ..MAIN });
        frame.block_set.clear();
        frame.slices = vec![[Vec::new(), Vec::new()]; usize::from(slices)];
        frames.push((frames.is_empty(), frame));
    }
    // A block, one that stays, and one that goes: flags of blocks that are all zero.
    frames.push((true, keyframe(&header, &[[7, -7, 0]], 0)));
    let mut stays = frame_of_ones(&header, Prediction::ThreeDof, 0);
    stays.header.coding = FrameCoding::Main(MainFrameHeader { kind: SKIPPING, ..MAIN });
    frames.push((false, stays));
    let mut goes = frame_of_ones(&header, Prediction::ThreeDof, 0);
    goes.block_set = vec![0xff; 40];
    frames.push((false, goes));
    stream_of(&header, &frames)
}

/// What a random frame states.
struct Draw {
    keyframe: bool,
    slices: u16,
    main: MainFrameHeader,
    /// Whether it has masks for sure.
    masks: bool,
}

const fn draw(kind: FrameKind, slices: u16, main: MainFrameHeader) -> Draw {
    Draw { keyframe: false, slices, main: MainFrameHeader { kind, ..main }, masks: false }
}

const INTRA: FrameKind = FrameKind::Intra;
const INTER: FrameKind = FrameKind::Predicted { skip_cells: false };
const SKIPPING: FrameKind = FrameKind::Predicted { skip_cells: true };

/// Every field of the frame header at its ends; slices that come and go within a GOP, and a frame without prediction.
const ENDS: [Draw; 7] = [
    Draw { keyframe: true, ..draw(INTRA, 2, MAIN) },
    draw(INTER, 7, MainFrameHeader { filter: 25, filter_limit: 255, ..QUARTERS }),
    draw(INTER, 1, MainFrameHeader { filter: 25, filter_limit: 0, step: 1, ..MAIN }),
    draw(INTRA, 3, MainFrameHeader { filter: 1, filter_limit: 1, ..QUARTERS }),
    Draw { keyframe: true, ..draw(INTRA, 1, MainFrameHeader { step: 2, ..QUARTERS }) },
    draw(INTER, 2, MainFrameHeader { step: 1 << 20, ..MAIN }),
    draw(INTER, 256, MainFrameHeader { filter: 12, filter_limit: 255, ..QUARTERS }),
];

/// A GOP of many symbols.
const LONG: [Draw; 5] = [
    Draw { keyframe: true, ..draw(INTRA, 1, MAIN) },
    draw(INTER, 1, QUARTERS),
    draw(INTRA, 1, MainFrameHeader { filter: 20, filter_limit: 30, ..MAIN }),
    draw(INTER, 1, MainFrameHeader { step: 700, ..QUARTERS }),
    draw(INTER, 1, MAIN),
];

/// Skip cells that become and cease to be.
const SKIPS: [Draw; 3] =
    [Draw { keyframe: true, ..draw(INTRA, 1, MAIN) }, draw(SKIPPING, 1, SKIPPED), draw(SKIPPING, 2, SKIPPED)];

/// Masks of frames without prediction, whose contexts are those of the frame before all the same.
const MASKED: [Draw; 3] = [
    Draw { keyframe: true, masks: true, ..draw(INTRA, 1, MAIN) },
    Draw { masks: true, ..draw(INTRA, 1, MAIN) },
    Draw { masks: true, ..draw(INTRA, 2, MAIN) },
];

/// Slices that the filter reaches across: every face of a keyframe is one that it smooths.
const FILTERED: [Draw; 2] = [
    Draw { keyframe: true, ..draw(INTRA, 4, MainFrameHeader { filter: 25, filter_limit: 255, ..MAIN }) },
    draw(INTRA, 5, MainFrameHeader { filter: 19, filter_limit: 60, ..MAIN }),
];

const QUARTERS: MainFrameHeader =
    MainFrameHeader { half_voxel_vectors: false, no_spatial_prediction: true, ..MAIN };
const SKIPPED: MainFrameHeader = MainFrameHeader { filter: 9, filter_limit: 12, ..MAIN };

/// Most blocks of a random frame.
const MOST_BLOCKS: u32 = 1000;
/// Attempts at a random frame.
const ATTEMPTS: usize = 4000;

/// A stream whose segments are random bytes, which are symbols whatever they are; what is refused is drawn again.
fn random(truncation: u32, seed: u64, draws: &[Draw]) -> Result<Stream> {
    let header = header(Profile::Main, BlockEdge::E8, truncation, seed.is_multiple_of(2))?;
    let mut random = Draws(Random::new(seed));
    let mut frames: Vec<(bool, RawFrame)> = Vec::new();
    for draw in draws {
        let drawn = (0..ATTEMPTS).find_map(|_| {
            let frame = random.frame(&header, draw);
            announced(&header, &frames, draw.keyframe, frame)
        });
        match drawn {
            Some(frame) => frames.push((draw.keyframe, frame)),
            None => bail!("frame {} was refused {ATTEMPTS} times", frames.len()),
        }
    }
    stream_of(&header, &frames)
}

/// The frame with as many blocks as its flags hold, which is found by trying; nothing if something else is refused.
fn announced(
    header: &StreamHeader,
    before: &[(bool, RawFrame)],
    keyframe: bool,
    mut frame: RawFrame,
) -> Option<RawFrame> {
    let mut stream = RawStream::new(header);
    // Of the frames before, those of the GOP matter.
    let first = before.iter().rposition(|(keyframe, _)| *keyframe).unwrap_or(0);
    for (keyframe, frame) in before[first..].iter().filter(|_| !keyframe) {
        stream.frame(*keyframe, 0, false, &frame.to_bytes());
    }
    let mut try_with = |blocks: u32| {
        frame.header.blocks = blocks;
        let mut stream = stream.clone();
        stream.frame(keyframe, 0, false, &frame.to_bytes());
        judge(&stream.finish()).1
    };
    let too_few = |error: &Option<DecodeError>| matches!(error, Some(DecodeError::Malformed { what, .. }) if what.contains("more blocks than announced"));
    let (mut least, mut most) = if keyframe { (8, 8) } else { (0, MOST_BLOCKS) };
    while least < most {
        let middle = least.midpoint(most);
        if too_few(&try_with(middle)) {
            least = middle + 1;
        } else {
            most = middle;
        }
    }
    try_with(least).is_none().then_some(frame)
}

/// Random bytes.
struct Draws(Random);

impl Draws {
    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| (self.0.signed() * 128.0) as i8 as u8).collect()
    }

    fn frame(&mut self, header: &StreamHeader, draw: &Draw) -> RawFrame {
        let coords = [[0; 3], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [2, 3, 0], [-4, 0, 0]];
        let mut frame = if draw.keyframe {
            keyframe(header, &coords, 21)
        } else {
            let mut frame = frame_of_ones(header, Prediction::None, 0);
            frame.block_set = self.bytes(250);
            frame
        };
        frame.header.coding = FrameCoding::Main(draw.main);
        frame.header.slices = draw.slices;
        // Random masks are often empty, which is malformed: then there are none.
        if self.0.signed() < -0.6 || draw.masks {
            frame.masks = [self.bytes(700), vec![0; 200]].concat();
            frame.masks[0] &= 0x7f;
        }
        let bytes = (1200 / usize::from(draw.slices)).max(16);
        // Behind them zeros, which are ones: spatial blocks without levels.
        let mut segment = |bytes| [self.bytes(bytes), vec![0; 12 + 60 / usize::from(draw.slices)]].concat();
        frame.slices = (0..draw.slices).map(|_| [segment(bytes / 24), segment(bytes)]).collect();
        frame
    }
}
