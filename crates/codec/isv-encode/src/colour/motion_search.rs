//! The vector of each block: from where in the frame before its colour comes.

use super::quantizer::SAMPLE_SCALE;
use crate::main::syntax::modes::{self as main_modes, merge_bits};
use isv_decode::colour::ColourFrame;
use isv_decode::colour::ColourShape;
use isv_decode::colour::compensation::predict_leaf;
use isv_decode::colour::frame::Reader;
use isv_decode::colour::tree::{BlockTree, UPPER_LEVELS};
use isv_decode::main::syntax::modes::{ModeContext, ModeModels};
use isv_decode::main::{BlockMode, Vector};
use isv_entropy::BitCount;
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
pub(crate) struct ColourSearch {
    /// Leaves of a block that are compared at most.
    pub leaves: usize,
    /// Steps of the search in eighths of a voxel, from coarse to fine, each as often as it stands here.
    pub steps: &'static [i16],
}

impl ColourSearch {
    /// Search for quality.
    pub(crate) const FULL: Self = Self { leaves: 24, steps: &[12, 6, 6, 3, 3, 2, 1, 1] };
}

/// A leaf to be predicted.
#[derive(Clone, Copy, Debug)]
struct Probe {
    cell: u32,
    voxel: [u8; 3],
    leaf: u8,
    wanted: [f32; 3],
}

/// Searches for the vectors of a frame's blocks.
#[derive(Debug)]
pub(crate) struct MotionSearch<'a> {
    shape: &'a ColourShape,
    before: &'a ColourFrame,
    probes: Vec<Vec<Probe>>,
    /// Leaves of each block.
    counts: Vec<usize>,
    /// Squared error that a bit may cost, in 8-bit steps.
    lambda: f32,
}

impl<'a> MotionSearch<'a> {
    /// Prepares a search. `leaves`: the values wanted of each block's leaves.
    pub(crate) fn new(
        shape: &'a ColourShape,
        before: &'a ColourFrame,
        wanted: &[Vec<[f32; 3]>],
        search: &ColourSearch,
        lambda: f32,
    ) -> Self {
        let of_block = |block: usize| {
            let mut tree = BlockTree::default();
            shape.build_tree(block, &mut tree);
            let depth = tree.depth();
            let leaves = &tree.levels()[UPPER_LEVELS + usize::from(depth)].places;
            let cells = &tree.levels()[UPPER_LEVELS].places;
            let first = shape.cells().blocks()[block].first();
            let stride = leaves.len().div_ceil(search.leaves).max(1);
            let mut probes = Vec::new();
            let mut number = 0;
            for (at, place) in leaves.iter().enumerate() {
                while cells[number] != place >> (3 * depth) {
                    number += 1;
                }
                // Evenly over the block, not always the same leaf of a cell.
                if at % stride == (at / stride * 7) % stride {
                    let voxel = [0, 1, 2].map(|axis| {
                        let p = cells[number] >> axis;
                        (p & 1 | p >> 2 & 2 | p >> 4 & 4) as u8
                    });
                    probes.push(Probe {
                        cell: (first + number) as u32,
                        voxel,
                        leaf: (*place & ((1 << (3 * depth)) - 1)) as u8,
                        wanted: wanted[block][at],
                    });
                }
            }
            (probes, leaves.len())
        };
        let blocks = 0..shape.depths().len();
        let (probes, counts) = blocks.into_par_iter().map(of_block).unzip();
        Self { shape, before, probes, counts, lambda }
    }

    /// Mean squared error of a block's probes under a vector; stops where it is more than `most`.
    fn error(&self, reader: &mut Reader, block: usize, vector: Vector, most: f32) -> f32 {
        let probes = &self.probes[block];
        let depth = self.shape.depths()[block];
        let motion = vector.0.map(|c| i32::from(c) * 32);
        let limit = most * probes.len() as f32;
        let mut sum = 0.0;
        for probe in probes {
            let surfel = &self.shape.cells().surfels()[probe.cell as usize];
            let voxel = probe.voxel.map(usize::from);
            sum += match predict_leaf(reader, surfel, voxel, motion, usize::from(probe.leaf), depth) {
                Some(sample) => {
                    let d = [0, 1, 2].map(|c| f32::from(sample[c]) / SAMPLE_SCALE - probe.wanted[c]);
                    (d[0] * d[0] + CHROMA * (d[1] * d[1] + d[2] * d[2])).min(MOST_ERROR)
                }
                None => MISSING_ERROR,
            };
            if sum > limit {
                return f32::INFINITY;
            }
        }
        sum / probes.len().max(1) as f32
    }

    /// The best vectors. `start`: vectors to begin from, of other searches or of geometry.
    pub(crate) fn run(&self, steps: &[i16], start: &[Vec<Vector>]) -> Vec<Vector> {
        let count = self.counts.len();
        let mut vectors = vec![Vector::ZERO; count];
        for (round, step) in std::iter::once(&0).chain(steps).enumerate() {
            let found: Vec<(Vector, f32)> = (0..count)
                .into_par_iter()
                .with_min_len(CHUNK)
                .map_init(
                    || (NeighbourFinder::new(self.shape.cells().index()), Reader::new(self.before)),
                    |(finder, reader), block| {
                        let coord = self.shape.cells().coords()[block];
                        finder.turn_to(coord);
                        reader.turn_to(coord);
                        let around: Vec<Vector> = FACES
                            .iter()
                            .filter_map(|slot| finder.get(*slot))
                            .map(|n| vectors[n as usize])
                            .collect();
                        let middle = median(&around);
                        let cost = |reader: &mut Reader, vector: Vector, most: f32| {
                            let bits =
                                self.lambda * vector_bits(vector, middle) / self.counts[block].max(1) as f32;
                            self.error(reader, block, vector, most - bits) + bits
                        };
                        let own = vectors[block];
                        let mut best = (own, cost(reader, own, f32::INFINITY));
                        let mut offer = |reader: &mut Reader, vector: Vector| {
                            if vector.in_range() && vector != best.0 {
                                let cost = cost(reader, vector, best.1);
                                if cost < best.1 {
                                    best = (vector, cost);
                                }
                            }
                        };
                        if round == 0 {
                            start[block].iter().for_each(|vector| offer(reader, *vector));
                        } else {
                            around.iter().for_each(|vector| offer(reader, *vector));
                            for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)] {
                                let mut moved = own;
                                moved.0[axis] += sign * step;
                                offer(reader, moved);
                            }
                            if *step == 1 {
                                offer(reader, middle);
                                offer(reader, Vector::ZERO);
                            }
                        }
                        best
                    },
                )
                .collect();
            vectors = found.into_iter().map(|(vector, _)| vector).collect();
        }
        vectors
    }

    /// Creates the chooser of modes, for use after the search.
    pub(crate) fn chooser(&self) -> ModeChooser<'_> {
        ModeChooser { search: self, reader: Reader::new(self.before) }
    }
}

/// Chooses how each block is predicted, by error and by what its mode takes.
#[derive(Debug)]
pub(crate) struct ModeChooser<'a> {
    search: &'a MotionSearch<'a>,
    reader: Reader<'a>,
}

impl ModeChooser<'_> {
    /// The mode of a block, given its best vector. `most`: mean squared error from which it is better predicted from its own frame.
    pub(crate) fn choose(
        &mut self,
        block: usize,
        vector: Vector,
        context: &ModeContext,
        models: &mut ModeModels,
        most: f32,
    ) -> BlockMode {
        let search = self.search;
        self.reader.turn_to(search.shape.cells().coords()[block]);
        let a_bit = search.lambda / search.counts[block].max(1) as f32;
        let mut best = (f32::INFINITY, f32::INFINITY, BlockMode::Spatial);
        let mut offer = |mode: BlockMode, bits: f32| {
            let Some(vector) = mode.vector() else { return };
            let error = search.error(&mut self.reader, block, vector, best.0 - a_bit * bits);
            let cost = error + a_bit * bits;
            if cost < best.0 {
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
