//! The vector of each block: from where in the frame before its colour comes.

use super::quantizer::SAMPLE_SCALE;
use isv_decode::colour::ColourFrame;
use isv_decode::colour::ColourShape;
use isv_decode::colour::compensation::predict_leaf;
use isv_decode::colour::frame::Reader;
use isv_decode::colour::tree::{BlockTree, UPPER_LEVELS};
use isv_decode::main::Vector;
use isv_volume::NeighbourFinder;
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 16;
/// Squared error of a leaf beyond which more makes no difference: what is hidden in the frame before cannot be predicted.
const MOST_ERROR: f32 = 900.0;
/// What a leaf costs that nothing predicts.
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

    /// The best vectors, and the mean squared error of each. `start`: vectors to begin from, of other searches or of geometry.
    pub(crate) fn run(&self, steps: &[i16], start: &[Vec<Vector>]) -> (Vec<Vector>, Vec<f32>) {
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
        // What was minimized has the vectors' bits in it.
        let exact = |(block, vector): (usize, &Vector)| {
            let mut reader = Reader::new(self.before);
            reader.turn_to(self.shape.cells().coords()[block]);
            self.error(&mut reader, block, *vector, f32::INFINITY)
        };
        let errors = vectors.par_iter().enumerate().map(|(block, vector)| exact((block, vector))).collect();
        (vectors, errors)
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
