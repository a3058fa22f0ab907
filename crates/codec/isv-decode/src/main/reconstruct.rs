//! From symbols to samples. The encoder's closed loop is this code.

use super::loop_filter::smooth_faces;
use super::symbols::STEPS_PER_BLOCK;
use super::{BlockMode, CausalBlocks, FrameSymbols, Level, MainParameters, MainReference, Vector, Window};
use crate::main::extension::{DecodedBlocks, ExtensionPlan};
use isv_format::MainFrameHeader;
use isv_kernels::block8::{Block, SAMPLES};
use isv_kernels::deblock::FaceFilter;
use isv_kernels::quant::Quantizer;
use isv_kernels::surface_fit::SurfaceFit;
use isv_kernels::window::WindowRows;
use isv_volume::{BlockCoord, Neighbourhood};
use rayon::prelude::*;
use tracing::debug_span;

/// Blocks of a wave from which on threads share them.
const WIDE_WAVE: usize = 32;

/// The reference around the place that a vector points to, kept while vectors point to the same voxels.
#[derive(Debug)]
pub struct TemporalPredictor<'a> {
    reference: &'a MainReference,
    window: Window<'a>,
}

impl<'a> TemporalPredictor<'a> {
    /// Predictions from a reference.
    #[must_use]
    pub fn new(reference: &'a MainReference) -> Self {
        Self { reference, window: Window::new(reference) }
    }

    /// Predicts the block at a coordinate: the reference's samples displaced by the vector.
    ///
    /// # Panics
    /// If `out` is not a block.
    pub fn predict(&mut self, coord: BlockCoord, vector: Vector, out: &mut [i16]) {
        let out: &mut Block = out.try_into().expect("a block of 8^3 samples");
        if let Some(block) = self.whole_block(coord, vector) {
            out.copy_from_slice(block);
            return;
        }
        self.look_at(coord, vector, vector.whole_voxels()).translate(vector.rest(), out);
    }

    /// The block of the reference that a vector of whole blocks leads to, if there is one: its samples are the prediction.
    #[must_use]
    pub fn whole_block(&self, coord: BlockCoord, Vector(vector): Vector) -> Option<&'a Block> {
        let vector = vector.map(i32::from);
        if vector.iter().any(|v| v % STEPS_PER_BLOCK != 0) {
            return None;
        }
        let place = coord.offset(vector.map(|v| v / STEPS_PER_BLOCK));
        let block = self.reference.index().get(place)?;
        Some(self.reference.volume().block(block as usize).try_into().expect("blocks of an edge of 8"))
    }

    /// The reference's samples at a block displaced by whole voxels. Blocks that are not there take their sign from the one
    /// that the vector leads to, at most four voxels from there.
    pub fn look_at(&mut self, coord: BlockCoord, Vector(vector): Vector, voxels: [i32; 3]) -> &WindowRows {
        let blocks = vector.map(|v| (i32::from(v) + STEPS_PER_BLOCK / 2).div_euclid(STEPS_PER_BLOCK));
        self.window.look_at(coord, voxels, coord.offset(blocks));
        self.window.rows()
    }
}

/// Predicts a block from its neighbours: their surface continued, or zero where there is too little of it.
///
/// `around`: its neighbours by slot, as indices into `samples`, which holds them one after the other.
pub fn predict_spatially(around: &Neighbourhood, samples: &[i16], limit: i16, out: &mut [i16]) {
    let mut fit = SurfaceFit::new();
    for (slot, block) in around.iter().enumerate() {
        if let Some(block) = block.filter(|_| slot != 13) {
            let offset = [slot % 3, slot / 3 % 3, slot / 9].map(|s| s as i32 - 1);
            fit.add_neighbour(offset, &samples[block as usize * SAMPLES..][..SAMPLES]);
        }
    }
    if !fit.predict(limit, out) {
        out.fill(0);
    }
}

/// Adds a block's residual to its prediction and clamps to the truncation distance.
pub fn add_residual(
    parameters: &MainParameters,
    quantizer: &Quantizer,
    levels: &[Level],
    samples: &mut [i16],
) {
    let mut residual = [0; SAMPLES];
    for level in levels {
        residual[usize::from(parameters.scan[usize::from(level.place)])] = quantizer.dequantize(level.value);
    }
    parameters.transform.inverse(&mut residual);
    let limit = parameters.grid.truncation.codes();
    for (sample, difference) in samples.iter_mut().zip(residual) {
        *sample = sample.saturating_add(difference).clamp(-limit, limit);
    }
}

/// The samples of a frame's blocks before the in-loop filter. `samples` is of the frame once extended, where the blocks have
/// these `places`.
pub fn reconstruct(
    parameters: &MainParameters,
    header: &MainFrameHeader,
    symbols: &FrameSymbols,
    causal: &CausalBlocks,
    reference: Option<&MainReference>,
    places: &[u32],
    samples: &mut [i16],
) {
    let quantizer = &parameters.quantizer(header.step);
    if let Some(reference) = reference {
        blocks_at(places, samples).into_par_iter().enumerate().for_each_init(
            || TemporalPredictor::new(reference),
            |predictor, (block, out)| {
                if let Some(vector) = symbols.modes[block].vector() {
                    predictor.predict(symbols.coords[block], vector, out);
                    finish_block(parameters, quantizer, symbols, block, out);
                }
            },
        );
    }
    let limit = parameters.grid.truncation.codes();
    for wave in spatial_waves(symbols, causal) {
        let spatial_block = |block: &u32| {
            let mut out = [0; SAMPLES];
            if !header.no_spatial_prediction {
                let around = causal.of(symbols.coords[*block as usize], *block as usize);
                let around = around.map(|n| n.map(|n| places[n as usize]));
                predict_spatially(&around, samples, limit, &mut out);
            }
            finish_block(parameters, quantizer, symbols, *block as usize, &mut out);
            out
        };
        let done: Vec<_> = match wave.len() {
            ..WIDE_WAVE => wave.iter().map(spatial_block).collect(),
            _ => wave.par_iter().with_min_len(WIDE_WAVE / 4).map(spatial_block).collect(),
        };
        for (block, out) in wave.iter().zip(done) {
            let place = places[*block as usize] as usize;
            samples[place * SAMPLES..][..SAMPLES].copy_from_slice(&out);
        }
    }
}

/// The blocks at these places, which are in order.
fn blocks_at<'a>(places: &[u32], samples: &'a mut [i16]) -> Vec<&'a mut Block> {
    let mut places = places.iter().map(|place| *place as usize).peekable();
    let blocks = samples.as_chunks_mut::<SAMPLES>().0.iter_mut().enumerate();
    blocks.filter_map(|(place, block)| places.next_if_eq(&place).map(|_| block)).collect()
}

/// The spatially predicted blocks in waves: none is predicted from another one of its own or a later wave.
#[must_use]
pub fn spatial_waves(
    FrameSymbols { coords, modes, .. }: &FrameSymbols,
    causal: &CausalBlocks,
) -> Vec<Vec<u32>> {
    let mut waves: Vec<Vec<u32>> = Vec::new();
    // One more than the wave that a block is in; 0 if it is not predicted spatially.
    let mut after = vec![0; modes.len()];
    for block in (0..modes.len()).filter(|block| modes[*block] == BlockMode::Spatial) {
        let around = causal.of(coords[block], block);
        let wave = around.iter().flatten().map(|n| after[*n as usize]).max().unwrap_or(0);
        if wave == waves.len() {
            waves.push(Vec::new());
        }
        waves[wave].push(block as u32);
        after[block] = wave + 1;
    }
    waves
}

fn finish_block(
    parameters: &MainParameters,
    quantizer: &Quantizer,
    symbols: &FrameSymbols,
    block: usize,
    samples: &mut [i16],
) {
    let levels = symbols.levels.of(block);
    if !levels.is_empty() {
        add_residual(parameters, quantizer, levels, samples);
    }
}

/// Filters the reconstructed blocks, which are at their places, and extends them as planned: the decoded volume but for its
/// masks. `before`: the frame before, if there is one.
#[must_use]
pub fn filter_and_extend(
    parameters: &MainParameters,
    header: &MainFrameHeader,
    symbols: &FrameSymbols,
    mut samples: Vec<i16>,
    plan: ExtensionPlan,
    before: Option<&DecodedBlocks>,
) -> DecodedBlocks {
    if header.filter > 0 {
        let filter = FaceFilter::new(header.filter, header.filter_limit, parameters.grid.truncation);
        let filter = filter.expect("the frame header's filter is in range");
        debug_span!("loop filter").in_scope(|| smooth_faces(symbols, filter, &mut samples, plan.places()));
    }
    debug_span!("extension").in_scope(|| plan.extend(parameters.grid, samples, before))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::main::extension::FrameBlocks;
    use crate::shared::stitch;
    use isv_kernels::warp::{MotionVector, StitchedReference};
    use isv_volume::{BlockEdge, BlockSet, Grid, SparseVolume, Truncation, VoxelSize};
    use std::collections::BTreeMap;

    fn reference() -> MainReference {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        let all = (0..64).map(|i| BlockCoord::from([i % 4 - 2, i / 4 % 4 - 2, i / 16 - 2]));
        let mut coords: Vec<_> = all.filter(|c| (c.x * 5 + c.y * 3 + c.z) % 4 != 0).collect();
        coords.sort_unstable_by_key(|coord| coord.morton());
        let samples = (0..coords.len() * SAMPLES).map(|i| ((i * i / 7) % 4001) as i16 - 2000).collect();
        let volume = SparseVolume::from_parts(grid, coords, samples, BTreeMap::new());
        let all = BlockSet::from_coords(volume.coords());
        let blocks = FrameBlocks { all, ..FrameBlocks::default() };
        let decoded = DecodedBlocks::new(volume, blocks);
        MainReference::new(decoded, FrameSymbols::default(), BTreeMap::new())
    }

    /// A vector is whole blocks and a rest of -4 to 3.75 voxels. The 3x3x3 blocks around the block that the whole part leads to
    /// are stitched. [`StitchedReference::warp`] moves them by the rest.
    #[test]
    fn predictions_are_warps_of_stitched_neighbourhoods() {
        let reference = reference();
        let mut predictor = TemporalPredictor::new(&reference);
        let mut stitched = StitchedReference::new(BlockEdge::E8);
        for n in 0..600i16 {
            let vector = [n * 37 % 129 - 64, n * 53 % 127 - 63, n * 11 % 65 - 32];
            let coord = BlockCoord::from([n % 5 - 2, n % 3 - 1, n % 4 - 2].map(i32::from));
            let blocks = vector.map(|v| (v + STEPS_PER_BLOCK as i16 / 2).div_euclid(STEPS_PER_BLOCK as i16));
            let rest =
                std::array::from_fn(|axis| (vector[axis] - STEPS_PER_BLOCK as i16 * blocks[axis]) as i8);
            let (volume, centre) = (reference.volume(), coord.offset(blocks.map(i32::from)));
            let limit = volume.grid().truncation.codes();
            let samples = |block: u32| volume.block(block as usize);
            stitch(reference.decoded().blocks(), centre, limit, samples, &mut stitched);
            let (mut expected, mut found) = ([0; SAMPLES], [0; SAMPLES]);
            stitched.warp(MotionVector { translation: rest, rotation: [0; 3] }, &mut expected);
            predictor.predict(coord, Vector(vector), &mut found);
            assert!(expected == found, "{coord:?} {vector:?}");
        }
    }
}
