//! Motion vectors, predicted from the blocks before (Sec. 3.5: "motion side information").

use crate::shared::BitTally;
use crate::shared::syntax::{SyntaxError, check_overrun};
use isv_entropy::{IntegerModel, RangeDecoder};
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex};
use std::ops::Range;

/// Models of the difference between a vector's components and their prediction.
#[derive(Clone, Debug, Default)]
pub struct MotionModels {
    /// `components[spread][c]`: translation x, y, z, then rotation x, y, z, by how far apart the neighbours are.
    pub components: [[IntegerModel; 6]; SPREADS],
}

/// Classes of disagreement among the neighbouring vectors.
pub const SPREADS: usize = 3;

impl MotionModels {
    /// Reads the vectors of a slice's blocks, `range` of the frame's; blocks without a reference have none. `tally`: of these blocks.
    ///
    /// # Errors
    /// Vectors out of range, or bytes that end too early.
    #[expect(clippy::too_many_arguments, reason = "all that is known of the slice")]
    pub fn read(
        &mut self,
        bytes: &[u8],
        prediction: Prediction,
        edge: BlockEdge,
        range: Range<usize>,
        references: &[Option<u32>],
        neighbours: &CausalNeighbours,
        tally: &mut BitTally,
    ) -> Result<Vec<MotionVector>, SyntaxError> {
        let mut vectors = vec![MotionVector::ZERO; range.len()];
        if !prediction.has_motion() {
            return Ok(vectors);
        }
        let mut decoder = RangeDecoder::new(bytes);
        tally.begin(&decoder);
        let mut last = MotionVector::ZERO;
        for block in 0..range.len() {
            if references[block].is_none() {
                continue;
            }
            let (predicted, spread) = neighbours.predict(&range, block, references, &vectors, last);
            let models = &mut self.components[spread];
            let vector = &mut vectors[block];
            for c in 0..3 {
                vector.translation[c] =
                    read_component(&mut models[c], &mut decoder, predicted.translation[c])?;
            }
            if prediction == Prediction::SixDof {
                for c in 0..3 {
                    vector.rotation[c] =
                        read_component(&mut models[3 + c], &mut decoder, predicted.rotation[c])?;
                }
            }
            if !vector.in_range(edge) {
                return Err(SyntaxError("a motion vector is out of range"));
            }
            last = *vector;
            tally.charge(block, &decoder);
            check_overrun(&decoder, "the motion vectors end too early")?;
        }
        Ok(vectors)
    }
}

fn read_component(
    model: &mut IntegerModel,
    decoder: &mut RangeDecoder,
    predicted: i8,
) -> Result<i8, SyntaxError> {
    let value = model.decode(decoder) + i32::from(predicted);
    i8::try_from(value).map_err(|_| SyntaxError("a motion vector is out of range"))
}

/// For each block, the indices of the blocks at `x - 1`, `y - 1` and `z - 1`, which Morton order puts before it.
#[derive(Clone, Debug)]
pub struct CausalNeighbours {
    neighbours: Vec<[Option<u32>; 3]>,
}

impl CausalNeighbours {
    /// Finds the neighbours, if the frame has motion at all.
    #[must_use]
    pub fn new(coords: &[BlockCoord], has_motion: bool) -> Self {
        if !has_motion {
            return Self { neighbours: Vec::new() };
        }
        let index = BlockIndex::new(coords);
        let before = |c: &BlockCoord| [[-1, 0, 0], [0, -1, 0], [0, 0, -1]].map(|d| index.get(c.offset(d)));
        Self { neighbours: coords.iter().map(before).collect() }
    }

    /// Prediction of a block's vector, and how far the vectors it rests on are apart.
    ///
    /// Only blocks of the same slice count: `block`, `references` and `vectors` are relative to its first, `range.start`. Each
    /// component is the median of three neighbours, the mean of two (rounded towards minus infinity), or that of one alone.
    /// Without any, it is that of `last`, the vector coded before.
    #[must_use]
    pub fn predict(
        &self,
        range: &Range<usize>,
        block: usize,
        references: &[Option<u32>],
        vectors: &[MotionVector],
        last: MotionVector,
    ) -> (MotionVector, usize) {
        let mut known = [MotionVector::ZERO; 3];
        let mut count = 0;
        for neighbour in self.neighbours[range.start + block].into_iter().flatten() {
            let Some(local) = (neighbour as usize).checked_sub(range.start) else { continue };
            if references[local].is_some() {
                known[count] = vectors[local];
                count += 1;
            }
        }
        if count == 0 {
            return (last, SPREADS - 1);
        }
        let known = &known[..count];
        let component = |get: fn(&MotionVector) -> [i8; 3]| {
            std::array::from_fn(|c| middle(&known.iter().map(|v| get(v)[c]).collect::<Vec<_>>()))
        };
        let predicted =
            MotionVector { translation: component(|v| v.translation), rotation: component(|v| v.rotation) };
        (predicted, spread_class(known))
    }
}

/// Median of three, mean of two, or the only one.
fn middle(values: &[i8]) -> i8 {
    match *values {
        [a] => a,
        [a, b] => ((i32::from(a) + i32::from(b)) >> 1) as i8,
        [a, b, c] => a.min(b).max(a.max(b).min(c)),
        _ => unreachable!("one to three neighbours"),
    }
}

/// Class of how far the neighbours are apart on the worst axis of translation: 0 within a step, 1 within four, else 2. A single
/// neighbour has class 2.
fn spread_class(known: &[MotionVector]) -> usize {
    let apart = |axis: usize| {
        let values = known.iter().map(|v| i32::from(v.translation[axis]));
        values.clone().max().unwrap_or(0) - values.min().unwrap_or(0)
    };
    match ((0..3).map(apart).max().unwrap_or(0), known.len()) {
        (_, 1) => 2,
        (0..=1, _) => 0,
        (2..=4, _) => 1,
        _ => 2,
    }
}
