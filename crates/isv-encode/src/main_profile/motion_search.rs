//! Where the frame before has a block's surface: damped Gauss-Newton on the voxels near the surface, for single blocks and for
//! the cubes of 2^3 and 4^3 blocks that they are in, whose shifts are the starting points.
//!
//! All of it is the encoder's choice, in floating point; units are voxels.

use super::target::{BlockTarget, NearRow};
use isv_decode::main_profile::reconstruct::TemporalPredictor;
use isv_decode::main_profile::{MainReference, Vector};
use isv_kernels::simd::vectorized;
use isv_kernels::window::{SIDE, WindowRows};
use isv_volume::CODES_PER_VOXEL;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cubes whose blocks are searched together, as base-2 logarithms of their edge in blocks: large ones first.
const CUBES: [u32; 2] = [2, 1];
/// Of cubes one row of voxels in so many is looked at, each a power of two.
const CUBE_ROWS: [usize; 2] = [4, 2];
/// Gauss-Newton steps at most: of cubes and of single blocks.
const CUBE_STEPS: usize = 8;
const BLOCK_STEPS: usize = 5;
/// Largest step, in voxels.
const LONGEST_STEP: f32 = 2.0;
/// Added to the diagonal of the normal equations, absolutely and as a share.
const DAMPING: f32 = 0.5;
const RELATIVE_DAMPING: f32 = 0.01;
/// Stop when a step leaves more than this share of the error.
const LEAST_IMPROVEMENT: f32 = 0.99;
/// Steps below this along all axes, in voxels, are not taken.
const SHORTEST_STEP: f32 = 0.02;
/// Starting points nearer than this along all axes, in voxels, are the same.
const CLOSE: f32 = 0.3;
/// Starting points of a cube from the frame before, at most.
const SEEDS_BEFORE: usize = 2;

/// A displacement in voxels.
pub(crate) type Shift = [f32; 3];

/// A vector's displacement.
pub(crate) fn to_shift(vector: Vector) -> Shift {
    vector.0.map(|quarters| f32::from(quarters) / 4.0)
}

/// For each block, the shifts of the cubes that it is in.
pub(crate) fn search_cubes(reference: &MainReference, targets: &[BlockTarget]) -> Vec<Vec<Shift>> {
    let mut found: Vec<Vec<Shift>> = vec![Vec::new(); targets.len()];
    for (log2, every) in CUBES.into_iter().zip(CUBE_ROWS) {
        let mut cubes: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
        for (block, target) in targets.iter().enumerate() {
            cubes.entry(target.coord.to_array().map(|c| c >> log2)).or_default().push(block);
        }
        let cubes: Vec<_> = cubes.into_values().collect();
        let shifts: Vec<Shift> =
            cubes.par_iter().map(|blocks| search_cube(reference, targets, blocks, every, &found)).collect();
        for (blocks, shift) in cubes.iter().zip(shifts) {
            blocks.iter().for_each(|block| found[*block].push(shift));
        }
    }
    found
}

/// The shift of one cube: the best that can be reached from no motion, from that of larger cubes, and from those of the
/// frame before.
fn search_cube(
    reference: &MainReference,
    targets: &[BlockTarget],
    blocks: &[usize],
    every: usize,
    found: &[Vec<Shift>],
) -> Shift {
    let mut seeds = vec![[0.0; 3]];
    let mut add = |seed: Shift| {
        if seeds.iter().all(|known| !are_close(*known, seed)) {
            seeds.push(seed);
        }
    };
    found[blocks[0]].iter().for_each(|seed| add(*seed));
    let before = blocks.iter().filter_map(|block| reference.coded(targets[*block].coord)?.vector);
    before.map(to_shift).take(SEEDS_BEFORE).for_each(add);
    let mut predictors: Vec<_> = blocks.iter().map(|_| TemporalPredictor::new(reference)).collect();
    let mut build = |shift: Shift| {
        let systems = blocks.iter().zip(&mut predictors);
        systems.fold(NormalEquations::default(), |sum, (block, predictor)| {
            sum.plus(&NormalEquations::of_block(predictor, &targets[*block], shift, every))
        })
    };
    let mut best = (f32::INFINITY, [0.0; 3]);
    for seed in seeds {
        let system = build(seed);
        let result = descend(&mut build, system, seed, CUBE_STEPS);
        if result.0 < best.0 {
            best = result;
        }
    }
    best.1
}

/// Whether two shifts lead to the same place, if one begins to search there.
pub(crate) fn are_close(a: Shift, b: Shift) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < CLOSE)
}

/// The best shift of a block that can be reached from one, where its equations are these.
pub(crate) fn refine(
    predictor: &mut TemporalPredictor,
    target: &BlockTarget,
    start: Shift,
    system: NormalEquations,
) -> Shift {
    let mut build = |shift: Shift| NormalEquations::of_block(predictor, target, shift, 1);
    descend(&mut build, system, start, BLOCK_STEPS).1
}

/// Gauss-Newton from a first guess, where the equations are these: the least error met, and where.
fn descend(
    build: &mut impl FnMut(Shift) -> NormalEquations,
    mut system: NormalEquations,
    start: Shift,
    steps: usize,
) -> (f32, Shift) {
    let mut shift = start;
    let mut best = (system.error, start);
    for _ in 0..steps {
        let step = system.solve();
        let longest = step.iter().fold(LONGEST_STEP, |m, s| m.max(s.abs()));
        let limit = f32::from(Vector::LIMIT) / 4.0 - 1.0;
        for (value, change) in shift.iter_mut().zip(step) {
            *value = (*value - change * (LONGEST_STEP / longest)).clamp(-limit, limit);
        }
        if step.iter().all(|s| s.abs() < SHORTEST_STEP) {
            break;
        }
        system = build(shift);
        let improved = system.error < best.0 * LEAST_IMPROVEMENT;
        if system.error < best.0 {
            best = (system.error, shift);
        }
        if !improved {
            break;
        }
    }
    best
}

/// Normal equations of a translation: `J^T W J` (upper triangle), `J^T W r` and the weighted squared residuals.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NormalEquations {
    /// xx, xy, xz, yy, yz, zz.
    matrix: [f32; 6],
    gradient: [f32; 3],
    pub error: f32,
}

impl NormalEquations {
    /// Those of the near voxels of a block, or of each `every`th row of them.
    pub(crate) fn of_block(
        predictor: &mut TemporalPredictor,
        target: &BlockTarget,
        shift: Shift,
        every: usize,
    ) -> Self {
        let quarters = Vector(shift.map(|s| (4.0 * s).round() as i16));
        let voxels = shift.map(|s| s.floor() as i32);
        let window = predictor.look_at(target.coord, quarters, voxels);
        let fraction = std::array::from_fn(|axis| shift[axis] - voxels[axis] as f32);
        vectorized(
            #[inline(always)]
            || Self::of_rows(&target.near, window, fraction, every),
        )
    }

    /// Rows of eight voxels, each lane apart. The same place in its cell for all of them. Large residuals are not believed as
    /// much: they may be another surface.
    #[inline(always)]
    fn of_rows(near: &[NearRow], window: &WindowRows, fraction: Shift, every: usize) -> Self {
        let mut sums = LaneSums { matrix: [[0.0; 8]; 6], gradient: [[0.0; 8]; 3], error: [0.0; 8] };
        for near in near {
            let (row_y, row_z) = (near.row % 8, near.row / 8);
            if (row_y + 2 * row_z) & (every - 1) == 0 {
                sums.add_row(near, window, row_z * SIDE + row_y, fraction);
            }
        }
        let mut total = Self::default();
        for i in 0..6 {
            total.matrix[i] = sums.matrix[i].iter().sum();
        }
        for i in 0..3 {
            total.gradient[i] = sums.gradient[i].iter().sum();
        }
        total.error = sums.error.iter().sum();
        total
    }

    fn plus(mut self, other: &Self) -> Self {
        self.matrix.iter_mut().zip(other.matrix).for_each(|(sum, entry)| *sum += entry);
        self.gradient.iter_mut().zip(other.gradient).for_each(|(sum, entry)| *sum += entry);
        self.error += other.error;
        self
    }

    /// The damped step, by Cramer's rule: the matrix is positive definite.
    fn solve(&self) -> Shift {
        let [xx, xy, xz, yy, yz, zz] = self.matrix;
        let [xx, yy, zz] = [xx, yy, zz].map(|d| d * (1.0 + RELATIVE_DAMPING) + DAMPING);
        let [gx, gy, gz] = self.gradient;
        let (a, b, c) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let (d, e, f) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let determinant = xx * a + xy * b + xz * c;
        [a * gx + b * gy + c * gz, b * gx + d * gy + e * gz, c * gx + e * gy + f * gz]
            .map(|v| v / determinant)
    }
}

/// [`NormalEquations`] of each lane of a row.
struct LaneSums {
    matrix: [[f32; 8]; 6],
    gradient: [[f32; 8]; 3],
    error: [f32; 8],
}

impl LaneSums {
    /// Adds a row of a block; `first` is the row of the window in whose cells it lies, all at the same place `[x, y, z]`.
    #[inline(always)]
    fn add_row(&mut self, near: &NearRow, window: &WindowRows, first: usize, [x, y, z]: Shift) {
        const SCALE: f32 = 1.0 / CODES_PER_VOXEL as f32;
        let [n00, s00] = ends(window, first);
        let [n10, s10] = ends(window, first + 1);
        let [n01, s01] = ends(window, first + SIDE);
        let [n11, s11] = ends(window, first + SIDE + 1);
        let (mut residual, mut slopes) = ([0.0; 8], [[0.0; 8]; 3]);
        for i in 0..8 {
            let [v00, v10] = [n00[i] + x * s00[i], n10[i] + x * s10[i]];
            let [v01, v11] = [n01[i] + x * s01[i], n11[i] + x * s11[i]];
            let [s0, s1] = [s00[i] + y * (s10[i] - s00[i]), s01[i] + y * (s11[i] - s01[i])];
            let [v0, v1] = [v00 + y * (v10 - v00), v01 + y * (v11 - v01)];
            slopes[0][i] = (s0 + z * (s1 - s0)) * SCALE;
            slopes[1][i] = ((v10 - v00) + z * ((v11 - v01) - (v10 - v00))) * SCALE;
            slopes[2][i] = (v1 - v0) * SCALE;
            residual[i] = (v0 + z * (v1 - v0)) * SCALE - near.samples[i];
        }
        let mut weight = [0.0; 8];
        for i in 0..8 {
            let squared = residual[i] * residual[i];
            self.error[i] += near.weights[i] * squared;
            weight[i] = near.weights[i] / (1.0 + squared);
        }
        let mut entry = 0;
        for a in 0..3 {
            let mut weighted = [0.0; 8];
            for i in 0..8 {
                weighted[i] = weight[i] * slopes[a][i];
            }
            for i in 0..8 {
                self.gradient[a][i] += weighted[i] * residual[i];
            }
            for b in a..3 {
                for i in 0..8 {
                    self.matrix[entry][i] += weighted[i] * slopes[b][i];
                }
                entry += 1;
            }
        }
    }
}

/// Eight samples of a row of the window, and the differences to the next ones along x.
#[inline(always)]
fn ends(window: &WindowRows, row: usize) -> [[f32; 8]; 2] {
    let (near, far) = (window.eight(row, 0), window.eight(row, 1));
    let mut ends = [[0.0; 8]; 2];
    for i in 0..8 {
        ends[0][i] = f32::from(near[i]);
        ends[1][i] = f32::from(far[i]) - f32::from(near[i]);
    }
    ends
}
