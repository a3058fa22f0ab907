//! Quantized coefficients, block after block: how many are not zero, where they are, and what they are.

use super::modes::BEFORE_CLASSES;
use crate::main::{
    BlockLevels, BlockMode, COEFFICIENTS, CausalBlocks, MainBlocks, MainParameters, SliceBlocks,
};
use crate::shared::BitTally;
use crate::shared::syntax::SyntaxError;
use isv_entropy::{BitModel, MAGNITUDE_LIMIT, RangeDecoder};
use isv_volume::BlockCoord;

/// Counts from here on share models.
const COUNT_CLASSES: usize = 21;
/// Classes of how many levels the neighbours have: unknown, then twice their mean up to 15.
const AROUND_CLASSES: usize = 17;
/// Classes of how many levels are still to come: 1 to 6.
const REMAINING_CLASSES: usize = 6;
/// Magnitudes in unary; what is beyond is an Exp-Golomb code of order 0.
pub const UNARY_MAGNITUDES: u32 = 14;
/// Places in scan order from here on share the models of magnitudes.
const PLACE_CLASSES: usize = 41;
/// Classes of how many levels a block has, in the models of magnitudes.
const LEVEL_COUNT_CLASSES: usize = 11;
/// Index sums 0 to 8.
const INDEX_SUMS: usize = 9;

/// Models of a block's levels, for those predicted from the frame before and for spatially predicted ones.
#[derive(Clone, Debug)]
pub struct CoefficientModels {
    count: Vec<BitModel>,
    count_by_around: Vec<BitModel>,
    count_by_before: Vec<BitModel>,
    place: Vec<BitModel>,
    place_by_remaining: Vec<BitModel>,
    place_by_lower: Vec<BitModel>,
    magnitude_by_place: Vec<BitModel>,
    magnitude_by_count: Vec<BitModel>,
    magnitude_by_sum: Vec<BitModel>,
}

impl Default for CoefficientModels {
    fn default() -> Self {
        let models = |count: usize| vec![BitModel::default(); 2 * count];
        let unary = UNARY_MAGNITUDES as usize;
        Self {
            count: models(COUNT_CLASSES),
            count_by_around: models(COUNT_CLASSES * AROUND_CLASSES),
            count_by_before: models(COUNT_CLASSES * BEFORE_CLASSES),
            place: models(COEFFICIENTS),
            place_by_remaining: models(COEFFICIENTS * REMAINING_CLASSES),
            place_by_lower: models(INDEX_SUMS * 4 * 4),
            magnitude_by_place: models(unary * PLACE_CLASSES),
            magnitude_by_count: models(unary * LEVEL_COUNT_CLASSES),
            magnitude_by_sum: models(unary * INDEX_SUMS),
        }
    }
}

impl CoefficientModels {
    /// Models of whether a block has no more levels than `count`, given that it has as many.
    pub fn count(&mut self, count: usize, context: &CountContext) -> [&mut BitModel; 3] {
        let row = context.spatial * COUNT_CLASSES + count.min(COUNT_CLASSES - 1);
        [
            &mut self.count[row],
            &mut self.count_by_around[row * AROUND_CLASSES + context.around],
            &mut self.count_by_before[row * BEFORE_CLASSES + context.before],
        ]
    }

    /// Models of whether the level at a place is not zero.
    ///
    /// `remaining`: levels still to come, 1 or more. `lower`: how many of the frequencies one lower along an axis are not zero.
    pub fn place(
        &mut self,
        spatial: usize,
        k: usize,
        index_sum: usize,
        remaining: usize,
        lower: usize,
    ) -> [&mut BitModel; 3] {
        let row = spatial * COEFFICIENTS + k;
        let by_lower = ((spatial * INDEX_SUMS + index_sum) * 4 + lower) * 4 + remaining.min(4) - 1;
        [
            &mut self.place[row],
            &mut self.place_by_remaining[row * REMAINING_CLASSES + remaining.min(REMAINING_CLASSES) - 1],
            &mut self.place_by_lower[by_lower],
        ]
    }

    /// Models of whether a magnitude is no more than `magnitude`, given that it is as much: 1 to [`UNARY_MAGNITUDES`].
    pub fn magnitude(
        &mut self,
        spatial: usize,
        magnitude: u32,
        k: usize,
        count: usize,
        index_sum: usize,
    ) -> [&mut BitModel; 3] {
        let row = spatial * UNARY_MAGNITUDES as usize + magnitude as usize - 1;
        [
            &mut self.magnitude_by_place[row * PLACE_CLASSES + k.min(PLACE_CLASSES - 1)],
            &mut self.magnitude_by_count[row * LEVEL_COUNT_CLASSES + count.min(LEVEL_COUNT_CLASSES - 1)],
            &mut self.magnitude_by_sum[row * INDEX_SUMS + index_sum],
        ]
    }

    /// Reads the levels of a slice's blocks. `modes`, `tally`: of the slice's blocks.
    ///
    /// # Errors
    /// Bytes that end too early.
    pub fn read(
        &mut self,
        parameters: &MainParameters,
        bytes: &[u8],
        SliceBlocks { coords, range, causal }: &SliceBlocks,
        modes: &[BlockMode],
        reference: Option<MainBlocks>,
        tally: &mut BitTally,
    ) -> Result<BlockLevels, SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        tally.begin(&decoder);
        let mut levels = BlockLevels::with_capacity(range.len());
        let mut dense = [0; COEFFICIENTS];
        for block in range.clone() {
            let local = block - range.start;
            let context = CountContext::new(
                coords[block],
                block,
                modes[local],
                causal,
                |n| levels.count(n - range.start),
                reference,
            );
            let count = self.read_block(parameters, &mut decoder, &context, &mut dense);
            tally.charge(local, &decoder);
            if count == 0 {
                levels.push(&[]);
            } else {
                levels.push(&dense);
                dense = [0; COEFFICIENTS];
            }
            if decoder.overran() {
                return Err(SyntaxError("the coefficients end too early"));
            }
        }
        Ok(levels)
    }

    /// Reads the levels of a block into zeros. How many there are.
    fn read_block(
        &mut self,
        parameters: &MainParameters,
        decoder: &mut RangeDecoder,
        context: &CountContext,
        levels: &mut [i32],
    ) -> usize {
        let mut count = 0;
        while count < COEFFICIENTS && !decoder.decode_mixed(self.count(count, context)) {
            count += 1;
        }
        let mut remaining = count;
        let mut k = 0;
        while remaining > 0 {
            // As many places as levels are left: all of them are taken.
            let certain = COEFFICIENTS - k == remaining;
            let (sum, lower) = (parameters.index_sum(k), nonzero_lower(parameters, levels, k));
            if certain || decoder.decode_mixed(self.place(context.spatial, k, sum, remaining, lower)) {
                levels[k] = self.read_level(decoder, context.spatial, k, count, sum);
                remaining -= 1;
            }
            k += 1;
        }
        count
    }

    fn read_level(
        &mut self,
        decoder: &mut RangeDecoder,
        spatial: usize,
        k: usize,
        count: usize,
        sum: usize,
    ) -> i32 {
        let mut magnitude = 1;
        while magnitude <= UNARY_MAGNITUDES
            && !decoder.decode_mixed(self.magnitude(spatial, magnitude, k, count, sum))
        {
            magnitude += 1;
        }
        if magnitude > UNARY_MAGNITUDES {
            magnitude += read_exp_golomb(decoder);
        }
        let magnitude = magnitude.min(MAGNITUDE_LIMIT) as i32;
        if decoder.decode_raw(1) != 0 { -magnitude } else { magnitude }
    }
}

/// An Exp-Golomb code of order 0, up to [`MAGNITUDE_LIMIT`] and what its exponent allows beyond.
fn read_exp_golomb(decoder: &mut RangeDecoder) -> u32 {
    let mut exponent = 0;
    while exponent < MAGNITUDE_LIMIT.ilog2() && decoder.decode_raw(1) != 0 {
        exponent += 1;
    }
    (1 << exponent) - 1 + decoder.decode_raw(exponent)
}

/// How many of the frequencies one lower along an axis have a level.
#[must_use]
pub fn nonzero_lower(parameters: &MainParameters, levels: &[i32], k: usize) -> usize {
    parameters.lower[k].iter().flatten().filter(|place| levels[usize::from(**place)] != 0).count()
}

/// What is known around a block when its number of levels is coded.
#[derive(Clone, Copy, Debug)]
pub struct CountContext {
    /// 1 for spatially predicted blocks, else 0.
    pub spatial: usize,
    around: usize,
    before: usize,
}

impl CountContext {
    /// Context of a block, once the counts of the blocks before it are known.
    #[must_use]
    pub fn new(
        coord: BlockCoord,
        block: usize,
        mode: BlockMode,
        causal: &CausalBlocks,
        count: impl Fn(usize) -> u8,
        reference: Option<MainBlocks>,
    ) -> Self {
        let neighbours = causal.merge_neighbours(block).take(4).map(|n| usize::from(count(n)));
        let (sum, known) = neighbours.fold((0, 0), |(sum, known), count| (sum + count, known + 1));
        let twice_mean = (2 * sum).checked_div(known);
        let around = twice_mean.map_or(0, |mean: usize| 1 + mean.min(AROUND_CLASSES - 2));
        let coded = reference.and_then(|reference| reference.coded(coord));
        let before = coded.map_or(0, |coded| 1 + usize::from(coded.count).min(BEFORE_CLASSES - 2));
        Self { spatial: usize::from(mode == BlockMode::Spatial), around, before }
    }
}
