//! From symbols to samples: prediction, dequantization, inverse DCT. The encoder's closed loop is this code.

use crate::paper::{CodingParameters, FrameSymbols, Reference};
use isv_kernels::warp::{MotionVector, StitchedReference};
use isv_volume::SparseVolume;
use rayon::prelude::*;

/// Prediction of every block of a frame, `edge^3` samples each: its motion-compensated reference, or zero.
#[must_use]
pub fn predict(
    parameters: &CodingParameters,
    symbols: &FrameSymbols,
    reference: Option<&Reference>,
) -> Vec<i16> {
    let edge = parameters.grid.edge;
    let mut prediction = vec![0; symbols.coords.len() * edge.block_voxels()];
    let Some(reference) = reference else {
        return prediction;
    };
    prediction.par_chunks_exact_mut(edge.block_voxels()).enumerate().for_each_init(
        || StitchedReference::new(edge),
        |stitched, (block, out)| {
            if let Some(source) = symbols.references[block] {
                predict_block(reference, source, symbols.motion[block], stitched, out);
            }
        },
    );
    prediction
}

/// Prediction of one block from the reference block at its place.
fn predict_block(
    reference: &Reference,
    source: u32,
    motion: MotionVector,
    stitched: &mut StitchedReference,
    out: &mut [i16],
) {
    if motion == MotionVector::ZERO {
        out.copy_from_slice(reference.volume().block(source as usize));
    } else {
        reference.stitch(source, stitched);
        stitched.warp(motion, out);
    }
}

/// Adds the residual to the prediction and clamps to the truncation distance: the decoded volume.
#[must_use]
pub fn reconstruct(
    parameters: &CodingParameters,
    symbols: FrameSymbols,
    mut prediction: Vec<i16>,
) -> SparseVolume {
    add_residuals(parameters, &symbols.levels, &mut prediction);
    SparseVolume::from_parts(parameters.grid, symbols.coords, prediction, symbols.unobserved)
}

/// Adds residuals to predicted samples and clamps them to the truncation distance. `levels`: as in [`FrameSymbols::levels`].
pub fn add_residuals(parameters: &CodingParameters, levels: &[i32], prediction: &mut [i16]) {
    let grid = parameters.grid;
    let limit = grid.truncation.codes();
    prediction
        .par_chunks_exact_mut(grid.edge.block_voxels())
        .zip(levels.par_chunks_exact(parameters.coefficients()))
        .for_each_init(
            || vec![0; grid.edge.block_voxels()],
            |residual, (samples, levels)| {
                if inverse_residual(parameters, levels, residual) {
                    for (sample, difference) in samples.iter_mut().zip(residual) {
                        *sample = sample.saturating_add(*difference).clamp(-limit, limit);
                    }
                }
            },
        );
}

/// Residual samples of a block's levels; false if they are all zero.
fn inverse_residual(parameters: &CodingParameters, levels: &[i32], residual: &mut [i16]) -> bool {
    if levels.iter().all(|level| *level == 0) {
        return false;
    }
    residual.fill(0);
    for (k, level) in levels.iter().enumerate().filter(|(_, level)| **level != 0) {
        residual[usize::from(parameters.scan[k])] = parameters.quantizer(k).dequantize(*level);
    }
    parameters.transform.inverse(residual);
    true
}
