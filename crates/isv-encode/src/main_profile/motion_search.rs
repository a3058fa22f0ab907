//! Where the frame before has a block's surface: damped Gauss-Newton on the voxels near the surface, for single blocks and for
//! the cubes of 2^3 and 4^3 blocks that they are in, whose shifts are the starting points.
//!
//! All of it is the encoder's choice, in floating point; units are voxels.

use super::target::BlockTarget;
use isv_decode::main_profile::reconstruct::TemporalPredictor;
use isv_decode::main_profile::{MainReference, Vector};
use isv_volume::CODES_PER_VOXEL;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cubes whose blocks are searched together, as base-2 logarithms of their edge in blocks: large ones first.
const CUBES: [u32; 2] = [2, 1];
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
/// Voxels along an edge of what a predictor stitches, and where the block begins in it.
const SIDE: usize = 24;
const FIRST: f32 = 8.0;
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
    for log2 in CUBES {
        let mut cubes: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
        for (block, target) in targets.iter().enumerate() {
            cubes.entry(target.coord.to_array().map(|c| c >> log2)).or_default().push(block);
        }
        let cubes: Vec<_> = cubes.into_values().collect();
        let shifts: Vec<Shift> =
            cubes.par_iter().map(|blocks| search_cube(reference, targets, blocks, &found)).collect();
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
    found: &[Vec<Shift>],
) -> Shift {
    let mut seeds = vec![[0.0; 3]];
    seeds.extend(found[blocks[0]].iter().copied());
    let before = blocks.iter().filter_map(|block| reference.coded(targets[*block].coord)?.vector);
    seeds.extend(before.map(to_shift).take(SEEDS_BEFORE));
    let mut predictors: Vec<_> = blocks.iter().map(|_| TemporalPredictor::new(reference)).collect();
    let mut build = |shift: Shift| {
        let mut system = NormalEquations::default();
        for (block, predictor) in blocks.iter().zip(&mut predictors) {
            system.add_block(predictor, &targets[*block], shift);
        }
        system
    };
    let results = seeds.into_iter().map(|seed| descend(&mut build, seed, CUBE_STEPS));
    results.min_by(|a, b| a.0.total_cmp(&b.0)).map_or([0.0; 3], |(_, shift)| shift)
}

/// The best shift of a block that can be reached from one.
pub(crate) fn refine(predictor: &mut TemporalPredictor, target: &BlockTarget, start: Shift) -> Shift {
    let mut build = |shift: Shift| {
        let mut system = NormalEquations::default();
        system.add_block(predictor, target, shift);
        system
    };
    descend(&mut build, start, BLOCK_STEPS).1
}

/// Gauss-Newton from a first guess: the least error met, and where.
fn descend(build: &mut impl FnMut(Shift) -> NormalEquations, start: Shift, steps: usize) -> (f32, Shift) {
    let mut shift = start;
    let mut best = (f32::INFINITY, start);
    for _ in 0..=steps {
        let system = build(shift);
        let improved = system.error < best.0 * LEAST_IMPROVEMENT;
        if system.error < best.0 {
            best = (system.error, shift);
        }
        if !improved {
            break;
        }
        let step = system.solve();
        let longest = step.iter().fold(LONGEST_STEP, |m, s| m.max(s.abs()));
        let limit = f32::from(Vector::LIMIT) / 4.0 - 1.0;
        for (value, change) in shift.iter_mut().zip(step) {
            *value = (*value - change * (LONGEST_STEP / longest)).clamp(-limit, limit);
        }
    }
    best
}

/// Normal equations of a translation: `J^T W J` (upper triangle), `J^T W r` and the weighted squared residuals.
#[derive(Clone, Copy, Debug, Default)]
struct NormalEquations {
    /// xx, xy, xz, yy, yz, zz.
    matrix: [f32; 6],
    gradient: [f32; 3],
    error: f32,
}

impl NormalEquations {
    /// Adds the near voxels of a block. Large residuals are not believed as much: they may be another surface.
    fn add_block(&mut self, predictor: &mut TemporalPredictor, target: &BlockTarget, shift: Shift) {
        const SCALE: f32 = 1.0 / CODES_PER_VOXEL as f32;
        let quarters = Vector(shift.map(|s| (4.0 * s).round() as i16));
        let rest = predictor.look_at(target.coord, quarters);
        let samples = predictor.stitched().samples();
        // The same cell and the same place in it for all voxels, each displaced by its own.
        let origin: Shift = std::array::from_fn(|axis| {
            FIRST + f32::from(rest[axis]) / 4.0 + shift[axis] - f32::from(quarters.0[axis]) / 4.0
        });
        let cell = origin.map(|o| o as usize);
        let [x, y, z]: Shift = std::array::from_fn(|axis| origin[axis] - cell[axis] as f32);
        let first = (cell[2] * SIDE + cell[1]) * SIDE + cell[0];
        for near in &target.near {
            let s = &samples[first + near.offset..][..SIDE * SIDE + SIDE + 2];
            let corner = |at: usize| f32::from(s[at]);
            let [n00, n10, n01, n11] = [0, SIDE, SIDE * SIDE, SIDE * SIDE + SIDE].map(corner);
            let [f00, f10, f01, f11] = [1, SIDE + 1, SIDE * SIDE + 1, SIDE * SIDE + SIDE + 1].map(corner);
            let [s00, s10, s01, s11] = [f00 - n00, f10 - n10, f01 - n01, f11 - n11];
            let [v00, v10, v01, v11] = [n00 + x * s00, n10 + x * s10, n01 + x * s01, n11 + x * s11];
            let [s0, s1] = [s00 + y * (s10 - s00), s01 + y * (s11 - s01)];
            let [v0, v1] = [v00 + y * (v10 - v00), v01 + y * (v11 - v01)];
            let value = (v0 + z * (v1 - v0)) * SCALE;
            let gx = (s0 + z * (s1 - s0)) * SCALE;
            let gy = ((v10 - v00) + z * ((v11 - v01) - (v10 - v00))) * SCALE;
            let gz = (v1 - v0) * SCALE;
            let residual = value - near.sample;
            let squared = residual * residual;
            self.error += near.weight * squared;
            let weight = near.weight / (1.0 + squared);
            for (entry, product) in
                self.matrix.iter_mut().zip([gx * gx, gx * gy, gx * gz, gy * gy, gy * gz, gz * gz])
            {
                *entry += weight * product;
            }
            for (entry, slope) in self.gradient.iter_mut().zip([gx, gy, gz]) {
                *entry += weight * slope * residual;
            }
        }
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
