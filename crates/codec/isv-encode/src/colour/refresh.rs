//! Intra refresh of colour: how a decoder that has lost something has all colours again, without an intra frame.
//!
//! Over a cycle of frames colour is made exact, whatever it was (`docs/spec/format.md`, section 7.14.12). In the `n`-th of `N` frames, the
//! first `n / N` of the colour blocks must be, in Morton order. A block among these is predicted from the frame before only where that
//! is exact already, else from its own frame.

use isv_decode::colour::{ColourFrame, ColourShape, ExactColour, ExactReader, ExactSource};
use isv_decode::main::{BlockMode, Vector};
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 32;

/// Which blocks of a frame must be exact after it.
#[derive(Debug)]
pub(super) struct Refreshed {
    /// The first this many in Morton order.
    blocks: usize,
    /// The frame before, if any of it is exact.
    source: Option<ExactSource>,
}

impl Refreshed {
    /// The blocks of a frame of `blocks` blocks, which is frame `position` of a cycle of `cycle`, counted from 0. `before`: the frame
    /// before, and what of it is exact in a decoder that had nothing when the cycle began.
    pub(super) fn new(
        (position, cycle): (u32, u32),
        blocks: usize,
        (before, exact): (&ColourFrame, &ExactColour),
    ) -> Self {
        let share = (u64::from(position) + 1) * blocks as u64;
        Self { blocks: share.div_ceil(u64::from(cycle)) as usize, source: exact.source(before) }
    }

    /// Begins to tell which vectors blocks can have.
    pub(super) fn allowed<'a>(&'a self, shape: &'a ColourShape) -> AllowedVectors<'a> {
        AllowedVectors { blocks: self.blocks, reader: self.reader(shape) }
    }

    fn reader<'a>(&'a self, shape: &'a ColourShape) -> Option<ExactReader<'a>> {
        self.source.as_ref().map(|source| source.reader(shape))
    }

    /// Makes all blocks spatial that must be exact and are not. `modes`: of all blocks, chosen each by itself. With the vectors between
    /// them interpolated, blocks are read from somewhat elsewhere.
    pub(super) fn settle(&self, shape: &ColourShape, modes: &mut [BlockMode]) {
        let first: Vec<usize> = (0..self.blocks.min(modes.len())).collect();
        loop {
            let is_wrong = |reader: &mut Option<ExactReader>, block: &&usize| {
                let mode = &modes[**block];
                *mode != BlockMode::Spatial && !reader.as_mut().is_some_and(|r| r.predicts(**block, modes))
            };
            let of_chunk = |chunk: &[usize]| {
                let mut reader = self.reader(shape);
                chunk.iter().filter(|block| is_wrong(&mut reader, block)).copied().collect::<Vec<_>>()
            };
            let wrong: Vec<usize> = first.par_chunks(CHUNK).flat_map_iter(of_chunk).collect();
            if wrong.is_empty() {
                return;
            }
            // Others lose a neighbour's vector by this, and are read from elsewhere again.
            wrong.into_iter().for_each(|block| modes[block] = BlockMode::Spatial);
        }
    }
}

/// The vectors that blocks can have without a prediction from what is not exact.
#[derive(Debug)]
pub(super) struct AllowedVectors<'a> {
    blocks: usize,
    reader: Option<ExactReader<'a>>,
}

impl AllowedVectors<'_> {
    /// Whether a block can have a vector, if the blocks around it have the same.
    pub(super) fn contain(&mut self, block: usize, vector: Vector) -> bool {
        block >= self.blocks || self.reader.as_mut().is_some_and(|r| r.predicts_under(block, vector))
    }
}
