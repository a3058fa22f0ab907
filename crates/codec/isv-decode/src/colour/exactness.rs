//! Which colour blocks are what they would be without loss (`docs/spec/format.md`, section 7.14.12).
//!
//! A block can be wrong only through the samples that it is predicted from. The decoder's own prediction tells which these are: it reads
//! marks in place of colours. A mark of an inexact sample shows in every mean that has the sample, however small its weight.

use super::compensation::{MotionField, VectorsAround, predict_block, vectors_around};
use super::frame::{ColourFrame, ColourShape, SAMPLE_RANGE, Sample};
use super::reader::Reader;
use super::reference::CARRIED_OVER;
use crate::main::{BlockMode, Vector};
use isv_format::ColourKind;
use isv_kernels::simd::vectorized;
use isv_volume::NeighbourFinder;
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 32;
/// Mark of samples of exact blocks: the lowest blue difference, and no luma, which grey has.
const EXACT: i16 = SAMPLE_RANGE[1].0 as i16;
/// Mark of other samples: the highest blue difference. One of these among the 2^15 parts of a mean, and the rest exact, is rounded up.
const INEXACT: i16 = SAMPLE_RANGE[1].1 as i16;

/// Which blocks of a frame's colour are exact: as a decoder without loss has them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ExactColour {
    /// No block, and it is not known either which cells and depths there are.
    #[default]
    Nothing,
    /// Cells and depths, and the samples of these blocks.
    Blocks(Vec<bool>),
    /// The whole frame, or that there is none.
    Whole,
}

impl ExactColour {
    /// Whether the frame is exact.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        *self == Self::Whole
    }

    /// Whether a block is exact, by its index among the frame's.
    #[must_use]
    pub fn contains(&self, block: usize) -> bool {
        match self {
            Self::Nothing => false,
            Self::Blocks(exact) => exact.get(block).is_some_and(|exact| *exact),
            Self::Whole => true,
        }
    }

    /// The exact blocks of a frame whose volume is exact and whose colour part was read. `before`: the frame before, and what of it is
    /// exact.
    #[must_use]
    pub fn of_frame(
        kind: ColourKind,
        shape: &ColourShape,
        modes: &[BlockMode],
        (before, exact_before): (&ColourFrame, &Self),
    ) -> Self {
        if kind == ColourKind::Intra || exact_before.is_whole() {
            return Self::Whole;
        }
        let source = exact_before.source(before);
        let of_chunk = |(chunk, modes_of_chunk): (usize, &[BlockMode])| {
            let mut reader = source.as_ref().map(|source| source.reader(shape));
            let first = chunk * CHUNK;
            let of_block = move |(block, mode): (usize, &BlockMode)| match (mode, &mut reader) {
                (BlockMode::Spatial, _) => true,
                (_, Some(reader)) => reader.predicts(block, modes),
                (_, None) => false,
            };
            (first..).zip(modes_of_chunk).map(of_block).collect::<Vec<_>>()
        };
        let mut exact: Vec<bool> = modes.par_chunks(CHUNK).enumerate().flat_map_iter(of_chunk).collect();
        if exact.iter().all(|exact| *exact) {
            return Self::Whole;
        }
        if !kind.constrains_intra() {
            // Spatial blocks are predicted from any others, and these from one another.
            let of_temporal = exact.iter_mut().zip(modes);
            of_temporal.for_each(|(exact, mode)| *exact &= *mode != BlockMode::Spatial);
        }
        Self::Blocks(exact)
    }

    /// The exact blocks of a frame whose volume is exact and that was carried over from one `before`, of which this is exact.
    #[must_use]
    pub(super) fn carried_over(&self, before: &ColourFrame, frame: &ColourFrame) -> Self {
        if *self == Self::Nothing {
            // The depths of the blocks are those of the frame before.
            return Self::Nothing;
        }
        let modes = vec![CARRIED_OVER; frame.shape.depths().len()];
        Self::of_frame(ColourKind::Predicted, &frame.shape, &modes, (before, self))
    }

    /// The exact blocks of a frame as something to predict from; `None` if nothing that is predicted from it is exact.
    #[must_use]
    pub fn source(&self, frame: &ColourFrame) -> Option<ExactSource> {
        (*self != Self::Nothing).then(|| ExactSource { marks: self.marks(frame) })
    }

    /// The frame with a mark in place of each sample.
    fn marks(&self, frame: &ColourFrame) -> ColourFrame {
        let shape = frame.shape.clone();
        let mut layers = shape.layers();
        for (block, depth) in shape.depths().iter().enumerate() {
            let mark = if self.contains(block) { EXACT } else { INEXACT };
            for layer in 0..=*depth {
                let samples = shape.block_samples(block, layer);
                let marks = &mut layers[usize::from(layer)][samples.clone()];
                for (to, sample) in marks.iter_mut().zip(&frame.layers[usize::from(layer)][samples]) {
                    // All values are 0 where there is no sample.
                    *to = if sample[3] == 0 { [0; 4] } else { [0, mark, 0, 1] };
                }
            }
        }
        ColourFrame { shape, layers }
    }
}

/// A frame that is predicted from, of which some blocks are exact.
#[derive(Debug)]
pub struct ExactSource {
    marks: ColourFrame,
}

impl ExactSource {
    /// Begins to tell which blocks of the next frame are predicted from exact samples.
    #[must_use]
    pub fn reader<'a>(&'a self, shape: &'a ColourShape) -> ExactReader<'a> {
        let (finder, reader) = (NeighbourFinder::new(shape.cells().index()), Reader::new(&self.marks));
        ExactReader { shape, finder, reader, marks: Vec::new() }
    }
}

/// Tells which blocks of a frame are predicted from exact samples alone.
#[derive(Debug)]
pub struct ExactReader<'a> {
    shape: &'a ColourShape,
    finder: NeighbourFinder<'a>,
    reader: Reader<'a>,
    marks: Vec<Sample>,
}

impl ExactReader<'_> {
    /// Whether a temporal block is. `modes`: of all blocks of the frame.
    #[must_use]
    pub fn predicts(&mut self, block: usize, modes: &[BlockMode]) -> bool {
        self.finder.turn_to(self.shape.cells().coords()[block]);
        let around = vectors_around(&self.finder, modes);
        self.predicts_along(block, &around)
    }

    /// Whether a block is if the vectors around it are the same as its own.
    #[must_use]
    pub fn predicts_under(&mut self, block: usize, vector: Vector) -> bool {
        let mut around = [None; 27];
        around[13] = Some(vector);
        self.predicts_along(block, &around)
    }

    fn predicts_along(&mut self, block: usize, around: &VectorsAround) -> bool {
        let field = MotionField::new(around);
        let (reader, shape, marks) = (&mut self.reader, self.shape, &mut self.marks);
        vectorized(
            #[inline(always)]
            || predict_block(reader, shape, block, &field, marks),
        );
        // Grey, which a block without any samples to read is, has luma.
        self.marks.iter().all(|mark| mark[3] == 0 || mark[0] != 0 || mark[1] == EXACT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::frame::{GREY, mean};

    #[test]
    fn one_inexact_sample_shows_in_every_mean() {
        let (exact, inexact) = (i32::from(EXACT), i32::from(INEXACT));
        for all in 1..=1 << 15 {
            let found = mean([0, (all - 1) * exact + inexact, 0, all]);
            assert_ne!(found[1], EXACT, "one of {all}");
            assert_eq!(mean([0, all * exact, 0, all])[1], EXACT);
        }
        assert_ne!(GREY[0], 0, "grey is told from marks");
    }
}
