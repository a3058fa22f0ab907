//! The vector of each block: from where in the frame before its colour comes.

use super::quantizer::SAMPLE_SCALE;
use crate::main::syntax::modes::{self as main_modes, merge_bits};
use isv_decode::colour::Reader;
use isv_decode::colour::compensation::{predict_cell, reach};
use isv_decode::colour::morton::position;
use isv_decode::colour::{ColourFrame, ColourShape, Sample};
use isv_decode::main::syntax::modes::{ModeContext, ModeModels};
use isv_decode::main::{BlockMode, Vector};
use isv_entropy::BitCount;
use isv_kernels::simd::vectorized;
use isv_volume::NeighbourFinder;
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 16;
/// Squared error of a leaf beyond which more makes no difference: what is hidden in the frame before cannot be predicted.
const MOST_ERROR: f32 = 900.0;
/// Squared error of a leaf without prediction.
const MISSING_ERROR: f32 = 900.0;
/// Weight of the squared error of either colour difference.
const CHROMA: f32 = 0.5;
/// Neighbours across the faces of a block.
const FACES: [usize; 6] = [4, 10, 12, 14, 16, 22];

/// How hard vectors are searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSearch {
    /// Cells of a block that are compared at most.
    pub cells: usize,
    /// Steps of the search in eighths of a voxel, from coarse to fine, each as often as it stands here.
    pub steps: &'static [i16],
    /// Mean squared error, in squared quantizer steps, at which a block's vector is good enough to search no further.
    pub enough: f32,
}

impl ColourSearch {
    /// Search for quality.
    pub const FULL: Self = Self { cells: usize::MAX, steps: &[12, 6, 6, 3, 3, 2, 1, 1], enough: 0.0 };
    /// Search in little time.
    pub const QUICK: Self = Self { cells: 16, steps: &[4, 1], enough: 0.04 };
}

/// A cell to be predicted.
#[derive(Clone, Copy, Debug)]
struct Probe {
    cell: u32,
    voxel: [u8; 3],
    /// The parts of it that the surface crosses.
    leaves: u64,
    /// First of the values wanted of these.
    wanted: u32,
}

/// Searches for the vectors of a frame's blocks.
#[derive(Debug)]
pub(crate) struct MotionSearch<'a> {
    shape: &'a ColourShape,
    before: &'a ColourFrame,
    wanted: &'a [&'a [[f32; 3]]],
    probes: Vec<Vec<Probe>>,
    /// Squared error that a bit may cost, in 8-bit steps.
    lambda: f32,
    /// Squared error that is good enough, in 8-bit steps.
    enough: f32,
}

impl<'a> MotionSearch<'a> {
    /// Prepares a search. `wanted`: the values of each block's leaves. `step`: the quantizer's; `lambda`: squared steps that a bit may cost.
    pub(crate) fn new(
        shape: &'a ColourShape,
        before: &'a ColourFrame,
        wanted: &'a [&'a [[f32; 3]]],
        search: &ColourSearch,
        (step, lambda): (f32, f32),
    ) -> Self {
        let of_block = |block: usize| {
            let cells = &shape.cells().blocks()[block];
            // Evenly over the block.
            let stride = cells.count().div_ceil(search.cells).max(1);
            let mut probes = Vec::new();
            let mut first = 0;
            for (number, place) in cells.places().enumerate() {
                let leaves = shape.leaves(block, number);
                if number % stride == stride / 2 {
                    let voxel = position(place).map(|v| v as u8);
                    let cell = (cells.first() + number) as u32;
                    probes.push(Probe { cell, voxel, leaves, wanted: first });
                }
                first += leaves.count_ones();
            }
            probes
        };
        let probes = (0..shape.depths().len()).into_par_iter().map(of_block).collect();
        let [lambda, enough] = [lambda, search.enough].map(|squared| squared * step * step);
        Self { shape, before, wanted, probes, lambda, enough }
    }

    /// Leaves of a block.
    fn count(&self, block: usize) -> f32 {
        self.wanted[block].len().max(1) as f32
    }

    /// Mean squared error of a block's probes under a vector; stops where it is more than `most`. The reader is turned to the block.
    fn error(&self, reader: &mut Reader, block: usize, vector: Vector, most: f32) -> f32 {
        vectorized(
            #[inline(always)]
            || self.error_of(reader, block, vector, most),
        )
    }

    #[inline(always)]
    fn error_of(&self, reader: &mut Reader, block: usize, vector: Vector, most: f32) -> f32 {
        let (probes, wanted) = (&self.probes[block], self.wanted[block]);
        let depth = self.shape.depths()[block];
        let [x, y, z] = vector.0;
        let motion = [32 * i32::from(x), 32 * i32::from(y), 32 * i32::from(z)];
        let mut all = 0;
        for probe in probes {
            all += probe.leaves.count_ones();
        }
        let limit = most * all as f32;
        let mut sum = 0.0;
        let mut parts = [[0; 4]; 64];
        for probe in probes {
            let surfel = &self.shape.cells().surfels()[probe.cell as usize];
            let [x, y, z] = probe.voxel;
            let voxel = [usize::from(x), usize::from(y), usize::from(z)];
            predict_cell(reader, surfel, voxel, motion, depth, probe.leaves, &mut parts);
            let (mut rest, mut at) = (probe.leaves, probe.wanted as usize);
            while rest != 0 {
                let sample = &parts[rest.trailing_zeros() as usize];
                rest &= rest - 1;
                sum += if sample[3] == 0 { MISSING_ERROR } else { squared_error(sample, &wanted[at]) };
                at += 1;
            }
            if sum > limit {
                return f32::INFINITY;
            }
        }
        sum / all.max(1) as f32
    }

    /// Takes the cells together that a block is read from under vectors that differ from one by a step at most. The reader is turned to
    /// the block.
    fn hold(&self, reader: &mut Reader, block: usize, vector: Vector, step: i32) {
        let [least, most] = [-step, step].map(|step| vector.0.map(|v| i32::from(v) + step));
        let (lowest, end) = reach(least, most);
        vectorized(
            #[inline(always)]
            || reader.hold(lowest, end, self.shape.depths()[block]),
        );
    }

    /// The best vectors, and the errors of all that were tried. `start`: vectors to begin from, of other searches or of geometry.
    pub(crate) fn run(&self, steps: &[i16], start: &[Vec<Vector>]) -> (Vec<Vector>, Vec<Tried>) {
        let count = self.probes.len();
        let mut vectors = vec![Vector::ZERO; count];
        let mut tried = vec![Tried::default(); count];
        for (round, step) in std::iter::once(&0).chain(steps).enumerate() {
            vectors = tried
                .par_iter_mut()
                .enumerate()
                .with_min_len(CHUNK)
                .map_init(
                    || (NeighbourFinder::new(self.shape.cells().index()), Reader::new(self.before)),
                    |(finder, reader), (block, tried)| {
                        if round > 0 && tried.known(vectors[block]).is_some_and(|error| error < self.enough) {
                            return vectors[block];
                        }
                        let coord = self.shape.cells().coords()[block];
                        finder.turn_to(coord);
                        reader.turn_to(coord);
                        self.hold(reader, block, vectors[block], i32::from(*step));
                        let neighbours = FACES.iter().filter_map(|slot| finder.get(*slot));
                        let around: Vec<Vector> = neighbours.map(|n| vectors[n as usize]).collect();
                        let middle = median(&around);
                        let a_bit = self.lambda / self.count(block);
                        let mut cost = |vector: Vector, most: f32| {
                            let bits = a_bit * vector_bits(vector, middle);
                            tried.error(self, reader, block, vector, most - bits) + bits
                        };
                        let own = vectors[block];
                        let mut best = (own, cost(own, f32::INFINITY));
                        let mut offer = |vector: Vector| {
                            if vector.in_range() && vector != best.0 {
                                let cost = cost(vector, best.1);
                                if cost < best.1 {
                                    best = (vector, cost);
                                }
                            }
                        };
                        if round == 0 {
                            start[block].iter().for_each(|vector| offer(*vector));
                            return best.0;
                        }
                        around.iter().for_each(|vector| offer(*vector));
                        for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)] {
                            let mut moved = own;
                            moved.0[axis] += sign * step;
                            offer(moved);
                        }
                        if *step == 1 {
                            offer(middle);
                            offer(Vector::ZERO);
                        }
                        best.0
                    },
                )
                .collect();
        }
        (vectors, tried)
    }

    /// Creates the chooser of modes, for use after the search. `tried`: what it found.
    pub(crate) fn chooser(&self, tried: Vec<Tried>) -> ModeChooser<'_> {
        ModeChooser { search: self, reader: Reader::new(self.before), tried }
    }
}

/// The errors of a block under the vectors that were tried: of each its error or, where this is infinite, what it is more than.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tried(Vec<(Vector, f32, f32)>);

impl Tried {
    /// The error under a vector, if it was tried to the end.
    fn known(&self, vector: Vector) -> Option<f32> {
        let (_, error, _) = self.0.iter().find(|(tried, ..)| *tried == vector)?;
        Some(*error).filter(|error| error.is_finite())
    }

    /// Error of a block under a vector; infinite where it is more than `most`. The reader is turned to the block.
    fn error(
        &mut self,
        search: &MotionSearch,
        reader: &mut Reader,
        block: usize,
        vector: Vector,
        most: f32,
    ) -> f32 {
        let known = self.0.iter().position(|(tried, ..)| *tried == vector);
        if let Some((_, error, least)) = known.map(|at| self.0[at])
            && (error.is_finite() || most <= least)
        {
            return if error <= most { error } else { f32::INFINITY };
        }
        let error = search.error(reader, block, vector, most);
        match known {
            Some(at) => self.0[at] = (vector, error, most),
            None => self.0.push((vector, error, most)),
        }
        error
    }
}

/// Chooses how each block is predicted, by error and by what its mode takes.
#[derive(Debug)]
pub(crate) struct ModeChooser<'a> {
    search: &'a MotionSearch<'a>,
    reader: Reader<'a>,
    tried: Vec<Tried>,
}

impl ModeChooser<'_> {
    /// The mode of a block, given its best vector. `most`: mean squared error from which it is better predicted from its own frame.
    /// `allows`: whether the block can have a vector.
    pub(crate) fn choose(
        &mut self,
        block: usize,
        vector: Vector,
        context: &ModeContext,
        models: &mut ModeModels,
        most: f32,
        mut allows: impl FnMut(Vector) -> bool,
    ) -> BlockMode {
        let search = self.search;
        self.reader.turn_to(search.shape.cells().coords()[block]);
        let a_bit = search.lambda / search.count(block);
        let mut best = (f32::INFINITY, f32::INFINITY, BlockMode::Spatial);
        let mut offer = |mode: BlockMode, bits: f32| {
            let Some(vector) = mode.vector() else { return };
            let most = best.0 - a_bit * bits;
            let error = self.tried[block].error(search, &mut self.reader, block, vector, most);
            let cost = error + a_bit * bits;
            if cost < best.0 && allows(vector) {
                best = (cost, error, mode);
            }
        };
        let merging = merge_bits(models, context);
        for ((candidate, vector), bits) in (0..).zip(context.candidates.as_slice()).zip(merging) {
            offer(BlockMode::Merged { candidate, vector: *vector }, bits);
        }
        if !context.candidates.as_slice().contains(&vector) {
            let mode = BlockMode::New { vector };
            let mut bits = BitCount::default();
            main_modes::write(models, &mut bits, context, mode, 1);
            offer(mode, bits.0);
        }
        if best.1 < most { best.2 } else { BlockMode::Spatial }
    }
}

/// Weighted squared error of a sample, up to [`MOST_ERROR`].
#[inline(always)]
fn squared_error(sample: &Sample, wanted: &[f32; 3]) -> f32 {
    let mut squares = [0.0; 3];
    for c in 0..3 {
        let difference = f32::from(sample[c]) / SAMPLE_SCALE - wanted[c];
        squares[c] = difference * difference;
    }
    (squares[0] + CHROMA * (squares[1] + squares[2])).min(MOST_ERROR)
}

/// Bits that a vector takes, about, where its neighbours have another one.
fn vector_bits(vector: Vector, around: Vector) -> f32 {
    (0..3)
        .map(|axis| {
            let difference = f32::from((vector.0[axis] - around.0[axis]).abs());
            if difference == 0.0 { 0.3 } else { 2.0 + 2.0 * (1.0 + difference).log2() }
        })
        .sum()
}

/// The median of vectors along each axis; none without any.
fn median(vectors: &[Vector]) -> Vector {
    if vectors.is_empty() {
        return Vector::ZERO;
    }
    Vector([0, 1, 2].map(|axis| {
        let mut values: Vec<i16> = vectors.iter().map(|v| v.0[axis]).collect();
        values.sort_unstable();
        values[(values.len() - 1) / 2]
    }))
}
