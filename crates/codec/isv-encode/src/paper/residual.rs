//! From samples to levels: residual, DCT, quantizer (Eq. 10).

use isv_decode::paper::CodingParameters;
use isv_volume::SparseVolume;
use rayon::prelude::*;

/// K quantized coefficients a block, block after block, of the difference between a volume and its prediction.
pub(crate) fn quantized_residual(
    parameters: &CodingParameters,
    volume: &SparseVolume,
    prediction: &[i16],
) -> Vec<i32> {
    let mut levels = vec![0; volume.block_count() * parameters.coefficients()];
    let voxels = parameters.grid.edge.block_voxels();
    levels
        .par_chunks_exact_mut(parameters.coefficients())
        .zip((0..volume.block_count()).into_par_iter().map(|block| volume.block(block)))
        .zip(prediction.par_chunks_exact(voxels))
        .for_each_init(
            || vec![0; voxels],
            |residual, ((levels, samples), predicted)| {
                for (r, (s, p)) in residual.iter_mut().zip(samples.iter().zip(predicted)) {
                    *r = s - p;
                }
                parameters.transform.forward(residual);
                for (k, level) in levels.iter_mut().enumerate() {
                    *level = parameters.quantizer(k).quantize(residual[usize::from(parameters.scan[k])]);
                }
            },
        );
    levels
}
