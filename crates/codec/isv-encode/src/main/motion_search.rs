//! Search for each block's surface in the frame before: damped Gauss-Newton on the voxels near the surface. It runs for single
//! blocks and for the cubes of 2^3 and 4^3 blocks that they are in, whose shifts are the starting points.
//!
//! All of it is the encoder's choice, in floating point; units are voxels.

use super::lanes::{codes, sum};
use super::search_window::SearchWindow;
use super::target::{NearRow, SCALE, Targets};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*};
use isv_decode::main::reconstruct::TemporalPredictor;
use isv_decode::main::{MainReference, Vector};
use isv_kernels::simd;
use isv_kernels::warp::STEPS_PER_VOXEL;
use isv_kernels::window::{ROW, SIDE, WindowRows};
use isv_volume::BlockCoord;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;

/// Cubes whose blocks are searched together, as base-2 logarithms of their edge in blocks: large ones first.
pub(super) const CUBES: [u32; 2] = [2, 1];
/// Stride over the rows of voxels of cubes, large ones first: one row in so many is looked at. Each is a power of two.
const CUBE_ROWS: [usize; 2] = [4, 2];
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
    vector.0.map(|steps| f32::from(steps) / STEPS_PER_VOXEL as f32)
}

/// The vector nearest to a displacement.
fn nearest_vector(shift: Shift) -> Vector {
    Vector(shift.map(|s| (STEPS_PER_VOXEL as f32 * s + 0.5f32.copysign(s)) as i16))
}

/// The whole part of a displacement, which leaves a rest of 0 to 1.
fn whole_voxels(shift: Shift) -> [i32; 3] {
    shift.map(|s| {
        let towards_zero = s as i32;
        towards_zero - i32::from(s < towards_zero as f32)
    })
}

/// How thoroughly predictions are searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchEffort {
    /// How many sizes of cubes are searched as a whole: 4^3 blocks, then 2^3.
    pub cube_sizes: usize,
    /// Gauss-Newton steps of a cube, at most.
    pub cube_steps: usize,
    /// Blocks of a cube that are looked at, at most: they are evenly spread.
    pub cube_blocks: usize,
    /// A cube is searched from those of its starting points whose error is at most so many times that of the best.
    pub seed_error_share: f32,
    /// Points that the search of a block starts from, at most: the best vector to merge with, then those of its cubes.
    pub starts: usize,
    /// Gauss-Newton steps of a block, at most.
    pub block_steps: usize,
    /// One row of a block's voxels in so many is looked at; a power of two.
    pub rows: usize,
    /// A vector whose error is worth fewer bits than this is taken without looking further.
    pub good_enough: f32,
    /// Spatial prediction is tried where the temporal one costs more bits than this,
    pub spatial_from: f32,
    /// more than so many times the bits that say that a block is predicted spatially (what is unlikely is seldom better),
    pub spatial_bits_share: f32,
    /// and only if the error of the spatial prediction is at most so many times that of the temporal one.
    pub spatial_error_share: f32,
}

impl SearchEffort {
    /// All that was found to pay.
    pub const THOROUGH: Self = Self {
        cube_sizes: 2,
        cube_steps: 8,
        cube_blocks: 64,
        seed_error_share: f32::INFINITY,
        starts: 3,
        block_steps: 5,
        rows: 1,
        good_enough: 0.0,
        spatial_from: 0.0,
        spatial_bits_share: 0.0,
        spatial_error_share: f32::INFINITY,
    };

    /// What pays most for its time.
    pub const QUICK: Self = Self {
        cube_sizes: 1,
        cube_steps: 4,
        cube_blocks: 16,
        seed_error_share: 1.3,
        starts: 2,
        block_steps: 2,
        rows: 4,
        good_enough: 8.0,
        spatial_from: 24.0,
        spatial_bits_share: 7.0,
        spatial_error_share: 1.0,
    };
}

/// A block, looked for in the frame before.
#[derive(Debug)]
pub(crate) struct SoughtBlock<'a> {
    predictor: TemporalPredictor<'a>,
    window: SearchWindow<'a>,
    coord: BlockCoord,
    near: Vec<NearRow>,
}

impl<'a> SoughtBlock<'a> {
    /// No block yet.
    pub(crate) fn new(reference: &'a MainReference) -> Self {
        let (predictor, window) = (TemporalPredictor::new(reference), SearchWindow::new(reference));
        Self { predictor, window, coord: [0; 3].into(), near: Vec::new() }
    }

    /// Turns to a block, of whose rows one in `every` is looked at.
    pub(crate) fn turn_to(&mut self, targets: &Targets, block: usize, every: usize) {
        self.coord = targets.coords()[block];
        self.near.clear();
        targets.near_rows(block, every, &mut self.near);
    }

    /// The block's samples as a vector predicts them.
    pub(crate) fn predict(&mut self, vector: Vector, out: &mut [i16; 512]) {
        if let Some(block) = self.predictor.whole_block(self.coord, vector) {
            *out = *block;
            return;
        }
        let (voxels, rest) = (vector.whole_voxels(), vector.rest());
        let window = match self.window.look_at(self.coord, voxels) {
            Some(window) => window,
            None => self.predictor.look_at(self.coord, vector, voxels),
        };
        window.translate(rest, out);
    }

    /// The block's rows, the samples around the place that a shift leads to, and its fractions of a voxel.
    fn look_at(&mut self, shift: Shift) -> (&[NearRow], &WindowRows, Shift) {
        let voxels = whole_voxels(shift);
        let fraction = std::array::from_fn(|axis| shift[axis] - voxels[axis] as f32);
        let window = match self.window.look_at(self.coord, voxels) {
            Some(window) => window,
            None => self.predictor.look_at(self.coord, nearest_vector(shift), voxels),
        };
        (&self.near, window, fraction)
    }

    /// The best shift that can be reached from one in so many steps.
    pub(crate) fn refine(&mut self, start: Shift, steps: usize) -> Shift {
        descend(self, start, steps).1
    }
}

/// What motion is searched for: a block, or several that move as one.
pub(crate) trait Sought {
    /// The weighted squared error at a shift.
    fn error(&mut self, shift: Shift) -> f32;

    /// The normal equations at a shift.
    fn equations(&mut self, shift: Shift) -> NormalEquations;
}

impl Sought for SoughtBlock<'_> {
    fn error(&mut self, shift: Shift) -> f32 {
        let vector = nearest_vector(shift);
        if to_shift(vector) == shift
            && let Some(block) = self.predictor.whole_block(self.coord, vector)
        {
            return dispatch!(simd::level(), simd => weighted_error_of_block(simd, &self.near, block));
        }
        let (near, window, fraction) = self.look_at(shift);
        dispatch!(simd::level(), simd => weighted_error(simd, near, window, fraction))
    }

    fn equations(&mut self, shift: Shift) -> NormalEquations {
        let (near, window, fraction) = self.look_at(shift);
        dispatch!(simd::level(), simd => NormalEquations::of_rows(simd, near, window, fraction))
    }
}

impl Sought for [SoughtBlock<'_>] {
    fn error(&mut self, shift: Shift) -> f32 {
        self.iter_mut().fold(0.0, |sum, block| sum + block.error(shift))
    }

    fn equations(&mut self, shift: Shift) -> NormalEquations {
        let equations = self.iter_mut().map(|block| block.equations(shift));
        equations.fold(NormalEquations::default(), |sum, equations| sum.plus(&equations))
    }
}

/// The shifts of the cubes that the blocks of a frame are in, found when they are first asked for.
#[derive(Debug)]
pub(crate) struct CubeSearch<'a> {
    reference: &'a MainReference,
    targets: &'a Targets<'a>,
    effort: SearchEffort,
    /// Large cubes first.
    sizes: Vec<Cubes>,
}

/// The cubes of one size.
#[derive(Debug)]
struct Cubes {
    /// Stride over the rows of voxels of their blocks: one row in so many is looked at.
    every: usize,
    /// The blocks of each.
    blocks: Vec<Range<usize>>,
    /// The cube that each block is in.
    of_block: Vec<u32>,
    shifts: Vec<OnceLock<Shift>>,
}

impl Cubes {
    fn new(coords: &[BlockCoord], log2: u32, every: usize) -> Self {
        let blocks = cubes(coords, log2);
        let of_block = (0..).zip(&blocks).flat_map(|(cube, blocks)| std::iter::repeat_n(cube, blocks.len()));
        Self { every, of_block: of_block.collect(), shifts: vec![OnceLock::new(); blocks.len()], blocks }
    }

    fn cube_of(&self, block: usize) -> usize {
        self.of_block[block] as usize
    }
}

/// What the search of a cube works with, one for each of the blocks that are looked at.
pub(crate) type CubeScratch<'a> = Vec<SoughtBlock<'a>>;

impl<'a> CubeSearch<'a> {
    /// Nothing is searched for yet, unless the effort is such that every block will ask.
    pub(crate) fn new(reference: &'a MainReference, targets: &'a Targets<'a>, effort: SearchEffort) -> Self {
        let sizes = CUBES.into_iter().zip(CUBE_ROWS).take(effort.cube_sizes);
        let sizes = sizes.map(|(log2, every)| Cubes::new(targets.coords(), log2, every)).collect();
        let search = Self { reference, targets, effort, sizes };
        if effort.good_enough == 0.0 {
            search.search_all();
        }
        search
    }

    /// For each size, the shift of the cube that a block is in.
    pub(crate) fn shifts(&self, block: usize, scratch: &mut CubeScratch<'a>) -> Vec<Shift> {
        (0..self.sizes.len()).map(|size| self.shift(size, self.sizes[size].cube_of(block), scratch)).collect()
    }

    fn search_all(&self) {
        for size in 0..self.sizes.len() {
            (0..self.sizes[size].blocks.len()).into_par_iter().for_each_init(Vec::new, |scratch, cube| {
                self.shift(size, cube, scratch);
            });
        }
    }

    /// The shift of a cube, which rests on those of larger ones.
    fn shift(&self, size: usize, cube: usize, scratch: &mut CubeScratch<'a>) -> Shift {
        let Cubes { every, blocks, shifts, .. } = &self.sizes[size];
        if let Some(shift) = shifts[cube].get() {
            return *shift;
        }
        let blocks = &blocks[cube];
        let seeds = self.seeds(size, blocks.clone(), scratch);
        *shifts[cube].get_or_init(|| {
            let chosen = blocks.clone().step_by(blocks.len().div_ceil(self.effort.cube_blocks));
            scratch.resize_with(chosen.len().max(scratch.len()), || SoughtBlock::new(self.reference));
            for (query, block) in scratch.iter_mut().zip(chosen.clone()) {
                query.turn_to(self.targets, block, *every);
            }
            search_cube(&mut scratch[..chosen.len()], &seeds, self.effort)
        })
    }

    /// Starting points of a cube's search: no motion, the shifts of larger cubes, and those of the frame before.
    fn seeds(&self, size: usize, blocks: Range<usize>, scratch: &mut CubeScratch<'a>) -> Vec<Shift> {
        let mut seeds = vec![[0.0; 3]];
        let mut add = |seed: Shift| {
            if seeds.iter().all(|known| !are_close(*known, seed)) {
                seeds.push(seed);
            }
        };
        for larger in 0..size {
            add(self.shift(larger, self.sizes[larger].cube_of(blocks.start), scratch));
        }
        let frame = self.reference.blocks();
        let before = blocks.filter_map(|block| frame.coded(self.targets.coords()[block])?.vector);
        before.map(to_shift).take(SEEDS_BEFORE).for_each(add);
        seeds
    }
}

/// The runs of blocks that are in the same cube: in Morton order they follow one another.
pub(super) fn cubes(coords: &[BlockCoord], log2: u32) -> Vec<Range<usize>> {
    let cube = |coord: BlockCoord| coord.to_array().map(|c| c >> log2);
    let mut end = 0;
    let runs = coords.chunk_by(|a, b| cube(*a) == cube(*b)).map(|run| {
        end += run.len();
        end - run.len()..end
    });
    runs.collect()
}

/// The best shift of the blocks of a cube that can be reached from the seeds.
fn search_cube(query: &mut [SoughtBlock], seeds: &[Shift], effort: SearchEffort) -> Shift {
    let mut best = (f32::INFINITY, [0.0; 3]);
    for seed in promising(query, seeds, effort.seed_error_share) {
        let result = descend(query, seed, effort.cube_steps);
        if result.0 < best.0 {
            best = result;
        }
    }
    best.1
}

/// The seeds whose error is at most so many times the least of all.
fn promising(query: &mut [SoughtBlock], seeds: &[Shift], share: f32) -> Vec<Shift> {
    if share.is_infinite() || seeds.len() == 1 {
        return seeds.to_vec();
    }
    let errors: Vec<f32> = seeds.iter().map(|seed| query.error(*seed)).collect();
    let least = errors.iter().copied().fold(f32::INFINITY, f32::min);
    seeds.iter().zip(errors).filter(|(_, error)| *error <= share * least).map(|(seed, _)| *seed).collect()
}

/// Whether two shifts lead to the same place, if one begins to search there.
pub(crate) fn are_close(a: Shift, b: Shift) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < CLOSE)
}

/// Gauss-Newton from a first guess: the least error met, and where.
fn descend(query: &mut (impl Sought + ?Sized), start: Shift, steps: usize) -> (f32, Shift) {
    let mut shift = start;
    let mut system = query.equations(start);
    let mut best = (system.error, start);
    for left in (0..steps).rev() {
        let step = system.solve();
        let longest = step.iter().fold(LONGEST_STEP, |m, s| m.max(s.abs()));
        let limit = f32::from(Vector::LIMIT) / STEPS_PER_VOXEL as f32 - 1.0;
        for (value, change) in shift.iter_mut().zip(step) {
            *value = (*value - change * (LONGEST_STEP / longest)).clamp(-limit, limit);
        }
        if step.iter().all(|s| s.abs() < SHORTEST_STEP) {
            break;
        }
        if left == 0 {
            let error = query.error(shift);
            return if error < best.0 { (error, shift) } else { best };
        }
        system = query.equations(shift);
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct NormalEquations {
    /// xx, xy, xz, yy, yz, zz.
    matrix: [f32; 6],
    gradient: [f32; 3],
    error: f32,
}

impl NormalEquations {
    /// Rows of eight voxels, each lane apart. The same place in its cell for all of them. Large residuals are not believed as
    /// much: they may be another surface.
    #[inline(always)]
    fn of_rows<S: Simd>(simd: S, near: &[NearRow], window: &WindowRows, fraction: Shift) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        let mut sums = LaneSums { matrix: [zero; 6], gradient: [zero; 3], error: zero };
        for near in near {
            sums.add_row(simd, near, window, fraction);
        }
        let mut total = Self { error: sum(sums.error), ..Self::default() };
        for i in 0..6 {
            total.matrix[i] = sum(sums.matrix[i]);
        }
        for i in 0..3 {
            total.gradient[i] = sum(sums.gradient[i]);
        }
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

/// The samples at the corners of a row's cells, in codes: at `[0, 0]`, `[1, 0]`, `[0, 1]` and `[1, 1]` along y and z.
struct Corners<S: Simd> {
    samples: [f32x8<S>; 4],
    /// Differences to the next ones along x.
    slopes: [f32x8<S>; 4],
}

impl<S: Simd> Corners<S> {
    #[inline(always)]
    fn new(simd: S, near: &NearRow, window: &WindowRows) -> Self {
        let first = near.row / 8 * SIDE + near.row % 8;
        let rows: &[[i16; ROW]; SIDE + 2] =
            window.samples[first..first + SIDE + 2].try_into().expect("rows of cells");
        let start = window.first & 7;
        let zero = [f32x8::splat(simd, 0.0); 4];
        let mut corners = Self { samples: zero, slopes: zero };
        for corner in 0..4 {
            let row = &rows[[0, 1, SIDE, SIDE + 1][corner]];
            let near = codes(simd, row[start..start + 8].try_into().expect("eight samples"));
            let far = codes(simd, row[start + 1..start + 9].try_into().expect("eight samples"));
            corners.samples[corner] = near;
            corners.slopes[corner] = far - near;
        }
        corners
    }

    /// The samples at a place along x.
    #[inline(always)]
    fn along_x(&self, x: f32) -> [f32x8<S>; 4] {
        let mut values = self.samples;
        for corner in 0..4 {
            values[corner] = self.samples[corner] + self.slopes[corner] * x;
        }
        values
    }
}

/// [`NormalEquations`] of each lane of a row.
struct LaneSums<S: Simd> {
    matrix: [f32x8<S>; 6],
    gradient: [f32x8<S>; 3],
    error: f32x8<S>,
}

impl<S: Simd> LaneSums<S> {
    /// Adds a row of a block, all at the same place `[x, y, z]` in their cells.
    #[inline(always)]
    fn add_row(&mut self, simd: S, near: &NearRow, window: &WindowRows, [x, y, z]: Shift) {
        let corners = Corners::new(simd, near, window);
        let [s00, s10, s01, s11] = corners.slopes;
        let [v00, v10, v01, v11] = corners.along_x(x);
        let [s0, s1] = [s00 + (s10 - s00) * y, s01 + (s11 - s01) * y];
        let [y0, y1] = [v10 - v00, v11 - v01];
        let [v0, v1] = [v00 + y0 * y, v01 + y1 * y];
        let slopes = [(s0 + (s1 - s0) * z) * SCALE, (y0 + (y1 - y0) * z) * SCALE, (v1 - v0) * SCALE];
        let residual = (v0 + (v1 - v0) * z) * SCALE - f32x8::from_slice(simd, &near.samples);
        let squared = residual * residual;
        let weights = f32x8::from_slice(simd, &near.weights);
        self.error += weights * squared;
        let weight = weights / (squared + 1.0);
        let mut entry = 0;
        for a in 0..3 {
            let weighted = weight * slopes[a];
            self.gradient[a] += weighted * residual;
            for b in a..3 {
                self.matrix[entry] += weighted * slopes[b];
                entry += 1;
            }
        }
    }
}

/// Weighted squared error of the rows of a block, the same as that of their [`NormalEquations`].
#[inline(always)]
fn weighted_error<S: Simd>(simd: S, near: &[NearRow], window: &WindowRows, [x, y, z]: Shift) -> f32 {
    let mut errors = f32x8::splat(simd, 0.0);
    for near in near {
        let [v00, v10, v01, v11] = Corners::new(simd, near, window).along_x(x);
        let [v0, v1] = [v00 + (v10 - v00) * y, v01 + (v11 - v01) * y];
        let residual = (v0 + (v1 - v0) * z) * SCALE - f32x8::from_slice(simd, &near.samples);
        errors += f32x8::from_slice(simd, &near.weights) * (residual * residual);
    }
    sum(errors)
}

/// [`weighted_error`] where the cells' first corners are the voxels of a block.
#[inline(always)]
fn weighted_error_of_block<S: Simd>(simd: S, near: &[NearRow], block: &[i16; 512]) -> f32 {
    let mut errors = f32x8::splat(simd, 0.0);
    for near in near {
        let samples = codes(simd, &block.as_chunks::<8>().0[near.row]);
        let residual = samples * SCALE - f32x8::from_slice(simd, &near.samples);
        errors += f32x8::from_slice(simd, &near.weights) * (residual * residual);
    }
    sum(errors)
}
