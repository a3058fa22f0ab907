//! The blocks of a slice, one after the other: candidates, their cost, the choice, its symbols.

use super::level_costs::LevelCosts;
use super::model_bits::ModelBits;
use super::motion_search::{NormalEquations, Shift, are_close, refine, to_shift};
use super::pursuit::{Metric, Pursued, Pursuit};
use super::syntax::{self, BitCount};
use super::target::{BlockTarget, Field};
use super::tools::Tools;
use isv_decode::main_profile::reconstruct::{
    BLOCK_SAMPLES, TemporalPredictor, add_residual, predict_spatially,
};
use isv_decode::main_profile::syntax::SliceModels;
use isv_decode::main_profile::syntax::coefficients::CountContext;
use isv_decode::main_profile::syntax::modes::ModeContext;
use isv_decode::main_profile::{
    BlockMode, COEFFICIENTS, CausalBlocks, MainParameters, MainReference, Vector,
};
use isv_entropy::RangeEncoder;
use isv_kernels::quant::Quantizer;
use isv_volume::CODES_PER_VOXEL;
use std::ops::Range;

/// Lambda of vectors over lambda of levels, while candidates are compared by their prediction alone: what a better vector
/// saves is not only error but levels.
const VECTOR_LAMBDA: f32 = 1.5;

/// What all slices of a frame share.
#[derive(Debug)]
pub(crate) struct FrameContext<'a> {
    pub parameters: &'a MainParameters,
    pub quantizer: Quantizer,
    pub pursuit: Pursuit<'a>,
    pub targets: &'a [BlockTarget],
    pub coords: &'a [isv_volume::BlockCoord],
    pub causal: &'a CausalBlocks,
    /// The frame before, unless this one does without, and the shifts to start from of each block.
    pub reference: Option<(&'a MainReference, Vec<Vec<Shift>>)>,
    /// Step of new vectors in quarter voxels.
    pub vector_step: i32,
    /// Candidates that are coded to see what they cost, beside the spatial prediction.
    pub trials: usize,
    /// Whether levels are refined under the models' own bits.
    pub refinement: bool,
    pub tools: Tools,
}

/// A slice as coded.
#[derive(Debug)]
pub(crate) struct CodedSlice {
    pub modes: Vec<BlockMode>,
    pub levels: Vec<i32>,
    pub counts: Vec<u8>,
    /// Samples before the in-loop filter.
    pub samples: Vec<i16>,
    pub mode_bytes: Vec<u8>,
    pub coefficient_bytes: Vec<u8>,
}

/// Codes a slice.
#[derive(Debug)]
pub(crate) struct SliceEncoder<'a> {
    frame: &'a FrameContext<'a>,
    range: Range<usize>,
    models: &'a mut SliceModels,
    costs: [LevelCosts; 2],
    coded: CodedSlice,
    mode_encoder: RangeEncoder,
    coefficient_encoder: RangeEncoder,
}

/// A way to code a block.
struct Trial {
    mode: BlockMode,
    prediction: [i16; BLOCK_SAMPLES],
    pursued: Pursued,
    cost: f32,
}

impl<'a> SliceEncoder<'a> {
    pub(crate) fn new(
        frame: &'a FrameContext<'a>,
        range: Range<usize>,
        models: &'a mut SliceModels,
        costs: [LevelCosts; 2],
    ) -> Self {
        let coded = CodedSlice {
            modes: Vec::with_capacity(range.len()),
            levels: Vec::with_capacity(range.len() * COEFFICIENTS),
            counts: Vec::with_capacity(range.len()),
            samples: Vec::with_capacity(range.len() * BLOCK_SAMPLES),
            mode_bytes: Vec::new(),
            coefficient_bytes: Vec::new(),
        };
        let (mode_encoder, coefficient_encoder) = (RangeEncoder::new(), RangeEncoder::new());
        Self { frame, range, models, costs, coded, mode_encoder, coefficient_encoder }
    }

    /// Codes all blocks; gives back what levels cost after them.
    pub(crate) fn run(mut self) -> (CodedSlice, [LevelCosts; 2]) {
        let reference = self.frame.reference.as_ref().map(|(reference, _)| *reference);
        let mut predictor = reference.map(TemporalPredictor::new);
        for block in self.range.clone() {
            let context = reference.map(|reference| self.mode_context(block, reference));
            let metric = self.frame.pursuit.metric(&self.frame.targets[block]);
            let mut best: Option<Trial> = None;
            if let (Some(predictor), Some(context)) = (&mut predictor, &context) {
                for mode in self.temporal_modes(block, context, predictor) {
                    let trial = self.try_temporal(block, mode, context, predictor, &metric);
                    if best.as_ref().is_none_or(|best| trial.cost < best.cost) {
                        best = Some(trial);
                    }
                }
            }
            let best = match best {
                Some(best) if best.cost <= self.least_spatial_cost(context.as_ref()) => best,
                best => {
                    let spatial = self.try_spatial(block, context.as_ref(), &metric);
                    best.filter(|best| best.cost <= spatial.cost).unwrap_or(spatial)
                }
            };
            self.code(block, best, context.as_ref());
        }
        self.coded.mode_bytes = match reference {
            Some(_) => self.mode_encoder.finish(),
            None => Vec::new(),
        };
        self.coded.coefficient_bytes = self.coefficient_encoder.finish();
        (self.coded, self.costs)
    }

    fn mode_context(&self, block: usize, reference: &MainReference) -> ModeContext {
        let mode = |n: usize| self.coded.modes[n - self.range.start];
        ModeContext::new(self.frame.coords[block], block, self.frame.causal, mode, reference)
    }

    /// The most promising vectors: by weighted error of the prediction and the bits of the mode.
    fn temporal_modes(
        &mut self,
        block: usize,
        context: &ModeContext,
        predictor: &mut TemporalPredictor,
    ) -> Vec<BlockMode> {
        let target = &self.frame.targets[block];
        let Tools { motion, merging, .. } = self.frame.tools;
        let allowed = |vector: Vector| (motion && merging) || vector == Vector::ZERO;
        let merges = context.candidates.as_slice().iter().enumerate().filter(|(_, vector)| allowed(**vector));
        let mut modes: Vec<(f32, BlockMode)> = Vec::new();
        let mut best: Option<(f32, Shift, NormalEquations)> = None;
        for (k, vector) in merges {
            let mode = BlockMode::Merged { candidate: k as u8, vector: *vector };
            let shift = to_shift(*vector);
            let system = NormalEquations::of_block(predictor, target, shift, 1);
            let cost = system.error + self.mode_cost(mode, context);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, shift, system));
            }
            modes.push((cost, mode));
        }
        let (least, shift, system) = best.expect("there are candidates");
        // A vector of its own costs at least as much as one that equals the first candidate, were there such a one.
        let vector = context.candidates.as_slice()[0];
        if motion && self.mode_cost(BlockMode::New { vector }, context) < least {
            self.add_new_vectors(block, (shift, system), context, predictor, &mut modes);
        }
        modes.sort_by(|a, b| a.0.total_cmp(&b.0));
        modes.into_iter().take(self.frame.trials).map(|(_, mode)| mode).collect()
    }

    /// Vectors found from the best to merge with and from the shifts of cubes.
    fn add_new_vectors(
        &mut self,
        block: usize,
        (best, system): (Shift, NormalEquations),
        context: &ModeContext,
        predictor: &mut TemporalPredictor,
        modes: &mut Vec<(f32, BlockMode)>,
    ) {
        let target = &self.frame.targets[block];
        let (_, cubes) = self.frame.reference.as_ref().expect("temporal modes have a reference");
        let mut starts = vec![(best, system)];
        for cube in &cubes[block] {
            if starts.iter().all(|(known, _)| !are_close(*known, *cube)) {
                starts.push((*cube, NormalEquations::of_block(predictor, target, *cube, 1)));
            }
        }
        for (start, system) in starts {
            for shift in [start, refine(predictor, target, start, system)] {
                let Some(vector) = self.nearest_vector(shift, context) else { continue };
                if !modes.iter().any(|(_, mode)| mode.vector() == Some(vector)) {
                    let mode = BlockMode::New { vector };
                    let error = NormalEquations::of_block(predictor, target, to_shift(vector), 1).error;
                    modes.push((error + self.mode_cost(mode, context), mode));
                }
            }
        }
    }

    /// The vector nearest to a shift that is whole steps from the first candidate.
    fn nearest_vector(&self, shift: Shift, context: &ModeContext) -> Option<Vector> {
        let first = context.candidates.as_slice()[0];
        let step = self.frame.vector_step;
        let vector = Vector(std::array::from_fn(|axis| {
            let from = f32::from(first.0[axis]);
            let steps = ((4.0 * shift[axis] - from) / step as f32).round() as i32;
            (i32::from(first.0[axis]) + steps * step) as i16
        }));
        vector.in_range().then_some(vector)
    }

    /// Weighted error that the bits of a mode are worth, while modes are compared by their predictions.
    fn mode_cost(&mut self, mode: BlockMode, context: &ModeContext) -> f32 {
        VECTOR_LAMBDA * self.frame.pursuit.lambda * self.mode_bits(mode, context)
    }

    /// Bits of a mode by the models as they are.
    fn mode_bits(&mut self, mode: BlockMode, context: &ModeContext) -> f32 {
        let mut bits = BitCount::default();
        syntax::modes::write(&mut self.models.modes, &mut bits, context, mode, self.frame.vector_step);
        bits.0
    }

    fn try_temporal(
        &mut self,
        block: usize,
        mode: BlockMode,
        context: &ModeContext,
        predictor: &mut TemporalPredictor,
        metric: &Metric,
    ) -> Trial {
        let mut prediction = [0; BLOCK_SAMPLES];
        predictor.predict(self.frame.coords[block], mode.vector().unwrap_or_default(), &mut prediction);
        self.pursue(block, mode, prediction, Some(context), metric)
    }

    /// What a spatially predicted block costs if nothing is left to correct.
    fn least_spatial_cost(&mut self, context: Option<&ModeContext>) -> f32 {
        let bits = context.map_or(0.0, |context| self.mode_bits(BlockMode::Spatial, context));
        self.frame.pursuit.lambda * (bits + self.costs[1].least_count())
    }

    fn try_spatial(&mut self, block: usize, context: Option<&ModeContext>, metric: &Metric) -> Trial {
        let around = self.frame.causal.of(block).map(|n| n.map(|n| n - self.range.start as u32));
        let mut prediction = [0; BLOCK_SAMPLES];
        let limit = self.frame.parameters.grid.truncation.codes();
        if self.frame.tools.spatial {
            predict_spatially(&around, &self.coded.samples, limit, &mut prediction);
        }
        self.pursue(block, BlockMode::Spatial, prediction, context, metric)
    }

    fn pursue(
        &mut self,
        block: usize,
        mode: BlockMode,
        prediction: [i16; BLOCK_SAMPLES],
        context: Option<&ModeContext>,
        metric: &Metric,
    ) -> Trial {
        let field: Field = prediction.map(|code| f32::from(code) / CODES_PER_VOXEL as f32);
        let costs = &self.costs[usize::from(mode == BlockMode::Spatial)];
        let (pursuit, target) = (&self.frame.pursuit, &self.frame.targets[block]);
        let pursued = if self.frame.refinement {
            let count_context = self.count_context(block, mode);
            let models = &mut self.models.coefficients;
            let parameters = self.frame.parameters;
            let mut bits = ModelBits { parameters, models, context: count_context, usual: costs };
            pursuit.run_refined(target, metric, &field, &mut bits)
        } else {
            pursuit.run(target, metric, &field, costs)
        };
        let bits = context.map_or(0.0, |context| self.mode_bits(mode, context));
        let cost = pursued.cost + self.frame.pursuit.lambda * bits;
        Trial { mode, prediction, pursued, cost }
    }

    /// What is known around a block when its number of levels is coded.
    fn count_context(&self, block: usize, mode: BlockMode) -> CountContext {
        let frame = self.frame;
        let reference = frame.reference.as_ref().map(|(reference, _)| *reference);
        let count = |n: usize| self.coded.counts[n - self.range.start];
        CountContext::new(frame.coords[block], block, mode, frame.causal, count, reference)
    }

    /// Writes a block's symbols, learns from them, and reconstructs it.
    fn code(&mut self, block: usize, trial: Trial, context: Option<&ModeContext>) {
        let frame = self.frame;
        if let Some(context) = context {
            syntax::modes::write(
                &mut self.models.modes,
                &mut self.mode_encoder,
                context,
                trial.mode,
                frame.vector_step,
            );
        }
        let levels = &trial.pursued.levels;
        let context = self.count_context(block, trial.mode);
        let models = &mut self.models.coefficients;
        syntax::coefficients::write(
            models,
            frame.parameters,
            &mut self.coefficient_encoder,
            &context,
            levels,
        );
        self.costs[usize::from(trial.mode == BlockMode::Spatial)].learn(levels);
        let count = levels.iter().filter(|level| **level != 0).count() as u8;
        let mut samples = trial.prediction;
        if count > 0 {
            add_residual(frame.parameters, &frame.quantizer, levels, &mut samples);
        }
        self.coded.modes.push(trial.mode);
        self.coded.levels.extend(levels);
        self.coded.counts.push(count);
        self.coded.samples.extend(samples);
    }
}
