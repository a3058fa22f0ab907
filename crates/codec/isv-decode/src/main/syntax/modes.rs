//! How blocks are predicted, and vectors.

use crate::main::{BlockMode, CausalBlocks, CodedBlock, MainBlocks, SliceBlocks, Vector};
use crate::shared::BitTally;
use crate::shared::syntax::SyntaxError;
use isv_entropy::{BitModel, IntegerModel, RangeDecoder};

/// Candidates to merge with: up to four vectors of neighbours, that of the frame before, none.
pub const MOST_CANDIDATES: usize = 6;
/// Candidates from neighbours at most.
const NEIGHBOUR_CANDIDATES: usize = 4;
/// Classes of how many levels a block had in the frame before: unknown, 0 to 7.
pub(crate) const BEFORE_CLASSES: usize = 9;

/// Models of modes and vectors.
#[derive(Clone, Debug, Default)]
pub struct ModeModels {
    spatial_by_neighbours: [[BitModel; 4]; 4],
    spatial_by_before: [[BitModel; BEFORE_CLASSES]; 4],
    new_by_neighbours: [[BitModel; 4]; 4],
    new_by_candidates: [[[BitModel; MOST_CANDIDATES + 1]; 4]; 4],
    merge: [BitModel; MOST_CANDIDATES],
    merge_by_candidates: [[[BitModel; 4]; MOST_CANDIDATES + 1]; MOST_CANDIDATES],
    components: [[IntegerModel; 2]; 3],
}

impl ModeModels {
    /// Models of whether a block is predicted from its neighbours.
    pub fn spatial(&mut self, context: &ModeContext) -> [&mut BitModel; 2] {
        let ModeContext { spatial, known, before, .. } = *context;
        [&mut self.spatial_by_neighbours[spatial][known], &mut self.spatial_by_before[spatial][before]]
    }

    /// Models of whether a block has a vector of its own.
    pub fn new_vector(&mut self, context: &ModeContext) -> [&mut BitModel; 2] {
        let ModeContext { spatial, new, known, .. } = *context;
        let candidates = context.candidates.len();
        [&mut self.new_by_neighbours[new][known], &mut self.new_by_candidates[spatial][new][candidates]]
    }

    /// Models of whether a block merges with a candidate, given that it merges with none before it.
    pub fn merge(&mut self, candidate: usize, context: &ModeContext) -> [&mut BitModel; 2] {
        let candidates = context.candidates.len();
        [&mut self.merge[candidate], &mut self.merge_by_candidates[candidate][candidates][context.new]]
    }

    /// Model of the difference between a component of a new vector and the first candidate's, in steps.
    pub fn component(&mut self, axis: usize, context: &ModeContext) -> &mut IntegerModel {
        &mut self.components[axis][usize::from(context.new > 0)]
    }

    /// Reads the modes of a slice's blocks. `reference`: the frame before, as far as the syntax looks at it. `step`: of new vectors, in
    /// quarter voxels. `tally`: of these blocks.
    ///
    /// # Errors
    /// Vectors out of range, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        SliceBlocks { coords, range, causal }: &SliceBlocks,
        reference: Option<MainBlocks>,
        step: i32,
        tally: &mut BitTally,
    ) -> Result<Vec<BlockMode>, SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        tally.begin(&decoder);
        let mut modes = Vec::with_capacity(range.len());
        for block in range.clone() {
            let before = reference.and_then(|reference| reference.coded(coords[block]));
            let context = ModeContext::new(block, causal, |n| modes[n - range.start], before);
            modes.push(self.read_mode(&mut decoder, &context, step)?);
            tally.charge(block - range.start, &decoder);
            if decoder.overran() {
                return Err(SyntaxError("the modes end too early"));
            }
        }
        Ok(modes)
    }

    /// Reads the mode of a block. `step`: of new vectors.
    ///
    /// # Errors
    /// A vector out of range.
    pub(crate) fn read_mode(
        &mut self,
        decoder: &mut RangeDecoder,
        context: &ModeContext,
        step: i32,
    ) -> Result<BlockMode, SyntaxError> {
        if decoder.decode_mixed(self.spatial(context)) {
            return Ok(BlockMode::Spatial);
        }
        if decoder.decode_mixed(self.new_vector(context)) {
            let mut vector = context.candidates.as_slice()[0];
            for axis in 0..3 {
                let difference = self.component(axis, context).decode(decoder);
                let component = i32::from(vector.0[axis]) + difference * step;
                vector.0[axis] = i16::try_from(component).unwrap_or(i16::MAX);
            }
            if !vector.in_range() {
                return Err(SyntaxError("a motion vector is out of range"));
            }
            return Ok(BlockMode::New { vector });
        }
        let last = context.candidates.len() - 1;
        let candidate = (0..last).find(|k| decoder.decode_mixed(self.merge(*k, context))).unwrap_or(last);
        let vector = context.candidates.as_slice()[candidate];
        Ok(BlockMode::Merged { candidate: candidate as u8, vector })
    }
}

/// Vectors that a block can merge with, all different; never empty.
#[derive(Clone, Copy, Debug)]
pub struct Candidates {
    vectors: [Vector; MOST_CANDIDATES],
    count: usize,
}

impl Candidates {
    /// The candidates in order.
    #[must_use]
    pub fn as_slice(&self) -> &[Vector] {
        &self.vectors[..self.count]
    }

    /// How many there are.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.count
    }

    fn add(&mut self, vector: Vector) {
        if !self.as_slice().contains(&vector) {
            self.vectors[self.count] = vector;
            self.count += 1;
        }
    }
}

/// What is known around a block when its mode is coded.
#[derive(Clone, Copy, Debug)]
pub struct ModeContext {
    /// Vectors of the neighbours before it, in order of [`super::super::MERGE_NEIGHBOURS`], of the frame before, and zero.
    pub candidates: Candidates,
    /// Number of the first three neighbours that are spatial.
    spatial: usize,
    /// Number of the first three neighbours that have new vectors.
    new: usize,
    /// Number of the first three neighbours that are there.
    known: usize,
    /// How many levels the block had in the frame before, and one; 0 if it was not coded.
    before: usize,
}

impl ModeContext {
    /// Context of a block, once the modes of the blocks before it are known. `coded`: the block in the frame before, as far as the
    /// syntax looks at it.
    #[must_use]
    pub fn new(
        block: usize,
        causal: &CausalBlocks,
        mode: impl Fn(usize) -> BlockMode,
        coded: Option<CodedBlock>,
    ) -> Self {
        let mut candidates = Candidates { vectors: [Vector::ZERO; MOST_CANDIDATES], count: 0 };
        let (mut spatial, mut new, mut known) = (0, 0, 0);
        for neighbour in causal.merge_neighbours(block).map(mode) {
            if known < 3 {
                spatial += usize::from(neighbour == BlockMode::Spatial);
                new += usize::from(matches!(neighbour, BlockMode::New { .. }));
                known += 1;
            }
            if let Some(vector) = neighbour.vector()
                && candidates.len() < NEIGHBOUR_CANDIDATES
            {
                candidates.add(vector);
            }
        }
        if let Some(vector) = coded.and_then(|coded| coded.vector) {
            candidates.add(vector);
        }
        candidates.add(Vector::ZERO);
        let before = coded.map_or(0, |coded| 1 + usize::from(coded.count).min(BEFORE_CLASSES - 2));
        Self { candidates, spatial, new, known, before }
    }
}
