//! Motion of each block by damped Gauss-Newton on the trilinear reference (Sec. 3.5, Eq. 12-14).
//!
//! All of it is the encoder's choice, in floating point; the decoder only ever sees the quantized vectors. Units here are voxels,
//! both for positions and for signed distances. The loops over voxels are compiled once for each instruction set and chosen at run
//! time. The arithmetic, and so the vectors, are the same in all of them.

use crate::paper::normal_equations::NormalEquations;
use isv_decode::paper::Reference;
use isv_format::Prediction;
use isv_kernels::simd::vectorized;
use isv_kernels::warp::{MotionVector, ROTATION_LIMIT, STEPS_PER_RADIAN, STEPS_PER_VOXEL, StitchedReference};
use isv_volume::{BlockEdge, SparseVolume};
use rayon::prelude::*;

/// Gauss-Newton steps at most.
const ITERATIONS: usize = 10;
/// Stop when a step leaves more than this share of the squared error.
const LEAST_IMPROVEMENT: f32 = 0.995;
/// Largest translation in one step, in voxels, and largest rotation, in radians (5 degrees).
const TRANSLATION_STEP: f32 = 1.0;
const ROTATION_STEP: f32 = 5.0 * std::f32::consts::PI / 180.0;
/// Fewest voxels of a block inside the truncation band that say anything about motion, the "reliable samples" of Sec. 3.5. Unobserved
/// ones count too: ingest continues the field through them, and they are coded.
const FEWEST_RELIABLE: usize = 32;

/// One vector a block; zero for blocks without a reference.
pub(crate) fn search_motion(
    prediction: Prediction,
    volume: &SparseVolume,
    reference: &Reference,
    references: &[Option<u32>],
) -> Vec<MotionVector> {
    let edge = volume.grid().edge;
    let scratch = || (StitchedReference::new(edge), vec![0; edge.block_voxels()]);
    let search = |(stitched, warped): &mut (StitchedReference, Vec<i16>),
                  (block, source): (usize, &Option<u32>)| {
        let Some(source) = source else { return MotionVector::ZERO };
        let target = volume.block(block);
        let limit = volume.grid().truncation.codes();
        if target.iter().filter(|s| s.abs() < limit).count() < FEWEST_RELIABLE {
            return MotionVector::ZERO;
        }
        reference.stitch(*source, stitched);
        let motion = align(prediction, stitched, target);
        better_than_standing_still(motion, stitched, target, warped)
    };
    references.par_iter().enumerate().map_init(scratch, search).collect()
}

/// The vector, or zero if zero predicts the block as well.
fn better_than_standing_still(
    motion: MotionVector,
    stitched: &StitchedReference,
    target: &[i16],
    warped: &mut [i16],
) -> MotionVector {
    let mut squared_error = |motion| {
        stitched.warp(motion, warped);
        target
            .iter()
            .zip(warped.iter())
            .map(|(t, w)| i64::from(i32::from(*t) - i32::from(*w)).pow(2))
            .sum::<i64>()
    };
    if squared_error(motion) < squared_error(MotionVector::ZERO) { motion } else { MotionVector::ZERO }
}

/// Rigid motion that best maps a block into the stitched reference. Rotation is looked for where translation has led: its
/// steps are the expensive ones, and few are left to take.
fn align(prediction: Prediction, stitched: &StitchedReference, target: &[i16]) -> MotionVector {
    let mut motion = vectorized(
        #[inline(always)]
        || descend::<3>(stitched, target, [0.0; 6]),
    );
    if prediction == Prediction::SixDof {
        motion = vectorized(
            #[inline(always)]
            || descend::<6>(stitched, target, motion),
        );
    }
    quantize(&motion, stitched.edge())
}

/// Gauss-Newton from a first guess in `D` unknowns: 3 for translation, 6 for translation and Euler angles.
#[inline(always)]
fn descend<const D: usize>(stitched: &StitchedReference, target: &[i16], start: [f32; 6]) -> [f32; 6] {
    let mut motion = start;
    let mut best = (f32::INFINITY, motion);
    for _ in 0..ITERATIONS {
        let system = NormalEquations::<D>::build(stitched, target, &motion);
        let improved = system.squared_error < best.0 * LEAST_IMPROVEMENT;
        if system.squared_error < best.0 {
            best = (system.squared_error, motion);
        }
        if !improved {
            break;
        }
        let Some(step) = system.solve() else { break };
        let scale = step_scale(&step);
        for (value, delta) in motion.iter_mut().zip(step) {
            *value += scale * delta;
        }
    }
    best.1
}

/// Factor that brings a step within the clamps on translation and rotation.
fn step_scale(step: &[f32]) -> f32 {
    let largest = |values: &[f32], limit: f32| values.iter().fold(limit, |m, v| m.max(v.abs())) / limit;
    let (translation, rotation) = step.split_at(3);
    1.0 / largest(translation, TRANSLATION_STEP).max(largest(rotation, ROTATION_STEP))
}

fn quantize(motion: &[f32; 6], edge: BlockEdge) -> MotionVector {
    let component = |value: f32, steps: i32, limit: i32| {
        (value * steps as f32).round().clamp(-limit as f32, limit as f32) as i8
    };
    let (translation, rotation) = (&motion[..3], &motion[3..]);
    MotionVector {
        translation: std::array::from_fn(|c| {
            component(translation[c], STEPS_PER_VOXEL, MotionVector::translation_limit(edge))
        }),
        rotation: std::array::from_fn(|c| component(rotation[c], STEPS_PER_RADIAN, ROTATION_LIMIT)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbourhood of a sphere's distance field, its centre `offset` voxels from the block's.
    fn sphere(offset: [f32; 3], radius: f32) -> StitchedReference {
        let edge = BlockEdge::E8;
        let mut stitched = StitchedReference::new(edge);
        for slot in 0..27 {
            let origin = [slot % 3, slot / 3 % 3, slot / 9].map(|s| (8 * s) as f32 - 8.0 - 3.5);
            let block: Vec<i16> = (0..512)
                .map(|i| {
                    let p = [i % 8, i / 8 % 8, i / 64].map(|v| v as f32);
                    let d: [f32; 3] = std::array::from_fn(|a| origin[a] + p[a] - offset[a]);
                    (((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() - radius) * 256.0)
                        .round()
                        .clamp(-2048.0, 2048.0) as i16
                })
                .collect();
            stitched.put_block(slot, &block);
        }
        stitched
    }

    fn own_block(stitched: &StitchedReference) -> Vec<i16> {
        let mut block = vec![0; 512];
        stitched.warp(MotionVector::ZERO, &mut block);
        block
    }

    #[test]
    fn translation_of_a_sphere_is_found() {
        let reference = sphere([1.5, 2.0, -1.0], 4.0);
        let target = own_block(&sphere([0.25, 0.5, 1.0], 4.0));
        let motion = align(Prediction::ThreeDof, &reference, &target);
        assert_eq!(motion.translation, [5, 6, -8], "from the target into the reference, in quarter voxels");
    }

    #[test]
    fn rotation_of_a_rough_field_is_found() {
        // The target is the reference itself, warped; the search must find its way back to the same motion.
        let reference = {
            let mut stitched = StitchedReference::new(BlockEdge::E8);
            for slot in 0..27 {
                let origin = [slot % 3, slot / 3 % 3, slot / 9].map(|s| (8 * s) as f32);
                let block: Vec<i16> = (0..512)
                    .map(|i| {
                        let p: [f32; 3] =
                            std::array::from_fn(|a| origin[a] + [i % 8, i / 8 % 8, i / 64][a] as f32);
                        (900.0
                            * ((0.31 * p[0]).sin() + (0.23 * p[1]).cos() + (0.27 * p[2] + 0.1 * p[0]).sin()))
                            as i16
                    })
                    .collect();
                stitched.put_block(slot, &block);
            }
            stitched
        };
        let motion = MotionVector { translation: [3, -2, 1], rotation: [4, -3, 2] };
        let mut target = vec![0; 512];
        reference.warp(motion, &mut target);
        assert_eq!(align(Prediction::SixDof, &reference, &target), motion);
    }

    #[test]
    fn a_flat_field_gives_no_motion() {
        let mut stitched = StitchedReference::new(BlockEdge::E8);
        (0..27).for_each(|slot| stitched.fill_block(slot, 700));
        assert_eq!(align(Prediction::SixDof, &stitched, &[300; 512]), MotionVector::ZERO);
    }
}
