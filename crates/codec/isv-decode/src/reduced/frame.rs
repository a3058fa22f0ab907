//! From symbols to samples at reduced resolution: the counterpart of `reconstruct`.

use super::regroup::regroup;
use super::{Lod, ReducedGrid};
use crate::ReferenceBlocks;
use crate::paper::{CodingParameters, FrameSymbols};
use crate::shared::stitch;
use isv_kernels::dct::ReducedTransform;
use isv_kernels::warp::{MotionVector, StitchedReference};
use isv_volume::{BlockCoord, BlockIndex, GridError, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What [`CodingParameters`] become at reduced resolution.
#[derive(Clone, Debug)]
pub(crate) struct ReducedParameters {
    grid: ReducedGrid,
    transform: ReducedTransform,
    /// The coded coefficients that the reduced transform reads, by number in scan order, and where it reads them.
    coefficients: Vec<(usize, usize)>,
}

/// A frame at reduced resolution, in the stream's blocks and, for the caller, in whole blocks of larger voxels.
#[derive(Clone, Debug)]
pub(crate) struct ReducedFrame {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    /// At the stream's resolution, as the syntax of the next frame needs them.
    unobserved: BTreeMap<u32, VoxelMask>,
    /// `side^3` samples a block, `side` being the stream's edge over that of the larger voxel.
    samples: Vec<i16>,
    volume: SparseVolume,
}

impl ReducedParameters {
    /// At the resolution of `lod`.
    ///
    /// # Errors
    /// As [`ReducedGrid::new`].
    pub(crate) fn new(parameters: &CodingParameters, lod: Lod) -> Result<Self, GridError> {
        let full = parameters.grid;
        let grid = ReducedGrid::new(&full, lod)?;
        let transform = ReducedTransform::new(parameters.transform, lod.reduction());
        let (n, m) = (full.edge.voxels(), transform.side());
        let scan = parameters.scan.iter().map(|position| usize::from(*position)).enumerate();
        let coefficients = scan
            .map(|(k, position)| (k, [position % n, position / n % n, position / n / n]))
            .filter(|(_, frequency)| frequency.iter().all(|f| *f < m))
            .map(|(k, [u, v, w])| (k, (w * m + v) * m + u))
            .collect();
        Ok(Self { grid, transform, coefficients })
    }

    /// Samples along an edge of a block.
    pub(super) fn side(&self) -> usize {
        self.transform.side()
    }

    /// The frame that the symbols say, predicted from the one before.
    pub(crate) fn reconstruct(
        &self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        reference: Option<&ReducedFrame>,
    ) -> ReducedFrame {
        let voxels = self.side().pow(3);
        let mut samples = vec![0; symbols.coords.len() * voxels];
        samples
            .par_chunks_exact_mut(voxels)
            .zip(symbols.levels.par_chunks_exact(parameters.coefficients()))
            .enumerate()
            .for_each_init(
                || {
                    (
                        StitchedReference::reduced(parameters.grid.edge, self.grid.lod.reduction()),
                        vec![0; voxels],
                    )
                },
                |(stitched, residual), (block, (out, levels))| {
                    if let Some((reference, source)) = reference.zip(symbols.references[block]) {
                        reference.predict(self, source, symbols.motion[block], stitched, out);
                    }
                    if self.inverse_residual(parameters, levels, residual) {
                        for (sample, difference) in out.iter_mut().zip(&*residual) {
                            *sample =
                                sample.saturating_add(*difference).clamp(-self.grid.limit, self.grid.limit);
                        }
                    }
                },
            );
        let volume = regroup(&self.grid, &symbols.coords, &samples, &symbols.unobserved, |_| false);
        let index = BlockIndex::new(&symbols.coords);
        ReducedFrame { coords: symbols.coords, index, unobserved: symbols.unobserved, samples, volume }
    }

    /// Residual samples of a block's levels; false if those that count are all zero.
    fn inverse_residual(&self, parameters: &CodingParameters, levels: &[i32], residual: &mut [i16]) -> bool {
        residual.fill(0);
        let mut any = false;
        for &(k, position) in self.coefficients.iter().filter(|(k, _)| levels[*k] != 0) {
            residual[position] = parameters.quantizer(k).dequantize(levels[k]);
            any = true;
        }
        if any {
            self.transform.inverse(residual);
        }
        any
    }
}

impl ReducedFrame {
    /// The frame in whole blocks of larger voxels.
    pub(crate) fn volume(&self) -> &SparseVolume {
        &self.volume
    }

    /// The frame's blocks as the stream has them.
    pub(crate) fn blocks(&self) -> ReferenceBlocks<'_> {
        ReferenceBlocks { coords: &self.coords, index: &self.index, unobserved: &self.unobserved }
    }

    /// Prediction of a block from the reference block at its place.
    fn predict(
        &self,
        parameters: &ReducedParameters,
        source: u32,
        motion: MotionVector,
        stitched: &mut StitchedReference,
        out: &mut [i16],
    ) {
        let voxels = parameters.side().pow(3);
        let samples = |block: u32| &self.samples[block as usize * voxels..][..voxels];
        if motion == MotionVector::ZERO {
            out.copy_from_slice(samples(source));
        } else {
            stitch(
                self.blocks(),
                self.blocks().coords[source as usize],
                parameters.grid.limit,
                samples,
                stitched,
            );
            stitched.warp(motion, out);
            out.iter_mut()
                .for_each(|sample| *sample = (*sample).clamp(-parameters.grid.limit, parameters.grid.limit));
        }
    }
}
