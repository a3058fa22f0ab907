//! The blocks of a slice, one after the other: candidates, their cost, the choice, its symbols.

use super::level_costs::LevelCosts;
use super::model_bits::ModelBits;
use super::motion_query::BlockShifts;
use super::motion_search::{
    CubeScratch, CubeSearch, SearchEffort, Shift, Sought, SoughtBlock, are_close, to_shift,
};
use super::pursuit::{Metrics, Pursued, Pursuit};
use super::refresh::Refreshed;
use super::syntax;
use super::target::{BlockTarget, Targets};
use super::tools::Tools;
use isv_decode::main::reconstruct::{add_residual, predict_spatially};
use isv_decode::main::syntax::SliceModels;
use isv_decode::main::syntax::coefficients::CountContext;
use isv_decode::main::syntax::modes::ModeContext;
use isv_decode::main::{
    BlockLevels, BlockMode, CausalBlocks, MainBlocks, MainParameters, MainReference, Vector,
};
use isv_entropy::{BitCount, RangeEncoder};
use isv_kernels::block8::{Block, SAMPLES};
use isv_kernels::quant::Quantizer;
use std::ops::Range;

/// Lambda of vectors over lambda of levels, while candidates are compared by their prediction alone. A better vector saves not only
/// error but levels.
const VECTOR_LAMBDA: f32 = 1.5;

/// With an error of so many times what the first level costs, it is hardly the case that no level pays.
const UNLIKELY: f32 = 2.0;

/// A vector leads to another place than what was found if its error is less than this share.
const CLEARLY_BETTER: f32 = 0.8;

/// What all slices of a frame share.
#[derive(Debug)]
pub(crate) struct FrameContext<'a> {
    pub parameters: &'a MainParameters,
    pub quantizer: Quantizer,
    pub pursuit: Pursuit<'a>,
    pub targets: &'a Targets<'a>,
    pub causal: &'a CausalBlocks,
    /// The frame before, unless this one does without, and where blocks are looked for in it.
    pub reference: Option<(&'a MainReference, MotionSearch<'a>)>,
    /// Blocks of the frame before in whose context symbols are coded: none in resilient frames.
    pub known: Option<MainBlocks<'a>>,
    /// Which blocks are not predicted from just anything, in resilient frames.
    pub refreshed: Option<Refreshed<'a>>,
    /// Step of new vectors in quarter voxels.
    pub vector_step: i32,
    /// Candidates that are coded to see what they cost, beside the spatial prediction.
    pub trials: usize,
    pub effort: SearchEffort,
    /// Whether levels are refined under the models' own bits.
    pub refinement: bool,
    pub tools: Tools,
}

/// How the frame before is searched for blocks.
#[derive(Debug)]
pub(crate) enum MotionSearch<'a> {
    /// By the slices themselves, from the shifts of cubes and from what blocks can merge with.
    InSlices(CubeSearch<'a>),
    /// It was, for all blocks of the frame.
    Done(&'a [BlockShifts]),
}

/// A slice as coded.
#[derive(Debug)]
pub(crate) struct CodedSlice {
    pub modes: Vec<BlockMode>,
    pub levels: BlockLevels,
    pub mode_bytes: Vec<u8>,
    pub coefficient_bytes: Vec<u8>,
    /// Bits of the coefficients that the DC coefficients take.
    pub dc_bits: f64,
}

/// The part of an extended frame's samples that a slice's blocks are in.
#[derive(Debug)]
pub(crate) struct SliceSamples<'a> {
    /// Blocks one after the other.
    pub samples: &'a mut [i16],
    /// Index of the first of them.
    pub first: u32,
    /// Index of each block of the frame.
    pub places: &'a [u32],
}

impl SliceSamples<'_> {
    /// Index in the part of a block of the frame.
    fn place(&self, block: usize) -> u32 {
        self.places[block] - self.first
    }
}

/// Codes a slice.
#[derive(Debug)]
pub(crate) struct SliceEncoder<'a> {
    frame: &'a FrameContext<'a>,
    range: Range<usize>,
    models: &'a mut SliceModels,
    costs: [LevelCosts; 2],
    cube_scratch: CubeScratch<'a>,
    /// Before the in-loop filter.
    samples: SliceSamples<'a>,
    coded: CodedSlice,
    mode_encoder: RangeEncoder,
    coefficient_encoder: RangeEncoder,
}

/// The block that is coded now.
struct BlockAtHand<'a> {
    /// Number of the block in the frame.
    number: usize,
    /// What it is to become, if that was asked for.
    target: &'a mut BlockTarget,
    has_target: bool,
    metrics: &'a mut Metrics,
    /// Nothing in frames without a reference.
    context: Option<ModeContext>,
}

/// The cheapest modes, from the cheapest on; of equals, the one that came first.
struct BestModes {
    modes: Vec<(f32, BlockMode)>,
    /// How many are kept.
    most: usize,
}

impl BestModes {
    /// What a mode has to stay below.
    fn bound(&self) -> f32 {
        if self.modes.len() < self.most { f32::INFINITY } else { self.modes[self.most - 1].0 }
    }

    fn add(&mut self, cost: f32, mode: BlockMode) {
        let place = self.modes.partition_point(|(known, _)| *known <= cost);
        self.modes.insert(place, (cost, mode));
        self.modes.truncate(self.most);
    }
}

/// A way to code a block.
struct Trial {
    mode: BlockMode,
    prediction: Block,
    pursued: Pursued,
    cost: f32,
}

impl<'a> SliceEncoder<'a> {
    pub(crate) fn new(
        frame: &'a FrameContext<'a>,
        range: Range<usize>,
        models: &'a mut SliceModels,
        costs: [LevelCosts; 2],
        samples: SliceSamples<'a>,
    ) -> Self {
        let coded = CodedSlice {
            modes: Vec::with_capacity(range.len()),
            levels: BlockLevels::with_capacity(range.len()),
            mode_bytes: Vec::new(),
            coefficient_bytes: Vec::new(),
            dc_bits: 0.0,
        };
        let (mode_encoder, coefficient_encoder) = (RangeEncoder::new(), RangeEncoder::new());
        let cube_scratch = Vec::new();
        Self { frame, range, models, costs, cube_scratch, samples, coded, mode_encoder, coefficient_encoder }
    }

    /// Codes all blocks; gives back what levels cost after them.
    pub(crate) fn run(mut self) -> (CodedSlice, [LevelCosts; 2]) {
        let reference = self.frame.reference.as_ref().map(|(reference, _)| *reference);
        let mut query = reference.map(SoughtBlock::new);
        let (mut target, mut metrics) = (BlockTarget::NONE, Metrics::NONE);
        for number in self.range.clone() {
            metrics.forget();
            let mut block = BlockAtHand {
                number,
                target: &mut target,
                has_target: false,
                metrics: &mut metrics,
                context: reference.map(|_| self.mode_context(number)),
            };
            let temporal = query.as_mut().and_then(|query| self.best_temporal(&mut block, query));
            let best = self.spatial_if_better(&mut block, temporal);
            self.code(&block, best);
        }
        self.coded.mode_bytes = match reference {
            Some(_) => self.mode_encoder.finish(),
            None => Vec::new(),
        };
        self.coded.coefficient_bytes = self.coefficient_encoder.finish();
        (self.coded, self.costs)
    }

    fn mode_context(&self, block: usize) -> ModeContext {
        let frame = self.frame;
        let mode = |n: usize| self.coded.modes[n - self.range.start];
        let before = frame.known.and_then(|known| known.coded(frame.targets.coords()[block]));
        ModeContext::new(block, frame.causal, mode, before)
    }

    /// The best of the most promising vectors.
    fn best_temporal(&mut self, block: &mut BlockAtHand, query: &mut SoughtBlock) -> Option<Trial> {
        let context = &block.context?;
        query.turn_to(self.frame.targets, block.number, self.frame.effort.rows);
        let modes = self.temporal_modes(block.number, context, query);
        let trials = modes.modes.into_iter().map(|(cost, mode)| {
            let mut prediction = [0; SAMPLES];
            query.predict(mode.vector().unwrap_or_default(), &mut prediction);
            self.pursue(block, mode, prediction, cost)
        });
        trials.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The most promising vectors and their costs: weighted error of the prediction and the bits of the mode.
    fn temporal_modes(&mut self, block: usize, context: &ModeContext, query: &mut SoughtBlock) -> BestModes {
        let good_enough = VECTOR_LAMBDA * self.frame.pursuit.lambda * self.frame.effort.good_enough;
        let bits = syntax::modes::merge_bits(&mut self.models.modes, context);
        let mut modes = BestModes { modes: Vec::new(), most: self.frame.trials };
        let mut best: Option<(f32, Shift)> = None;
        for (k, vector) in context.candidates.as_slice().iter().enumerate() {
            let cost = self.vector_cost(bits[k]);
            if !self.allows_merging(*vector) || !self.allows(block, *vector) || cost >= modes.bound() {
                continue;
            }
            let shift = to_shift(*vector);
            let cost = self.error_share() * query.error(shift) + cost;
            modes.add(cost, BlockMode::Merged { candidate: k as u8, vector: *vector });
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, shift));
            }
            if cost < good_enough {
                break;
            }
        }
        let Some((least, shift)) = best else { return modes };
        // A vector of its own costs at least as much as one that equals the first candidate, were there such a one.
        let vector = context.candidates.as_slice()[0];
        if self.frame.tools.motion
            && least >= good_enough
            && self.mode_cost(BlockMode::New { vector }, context) < least
        {
            self.add_new_vectors(block, shift, context, query, &mut modes);
        }
        modes
    }

    /// Whether a block may be predicted under a vector.
    fn allows(&self, block: usize, vector: Vector) -> bool {
        let coord = self.frame.targets.coords()[block];
        self.frame.refreshed.is_none_or(|refreshed| refreshed.allows(block, coord, vector))
    }

    /// Whether a block may take a vector over.
    fn allows_merging(&self, vector: Vector) -> bool {
        let Tools { motion, merging, .. } = self.frame.tools;
        (motion && merging) || vector == Vector::ZERO
    }

    /// Vectors that were searched for. `best`: the shift of the best to merge with.
    fn add_new_vectors(
        &mut self,
        block: usize,
        best: Shift,
        context: &ModeContext,
        query: &mut SoughtBlock,
        modes: &mut BestModes,
    ) {
        let merged = context.candidates.as_slice().iter().copied();
        let mut known: Vec<Vector> = merged.filter(|vector| self.allows_merging(*vector)).collect();
        for shift in self.shifts_to_try(block, best, query) {
            let Some(vector) = self.nearest_vector(shift, context) else { continue };
            if known.contains(&vector) || !self.allows(block, vector) {
                continue;
            }
            known.push(vector);
            let mode = BlockMode::New { vector };
            let cost = self.mode_cost(mode, context);
            if cost < modes.bound() {
                modes.add(self.error_share() * query.error(to_shift(vector)) + cost, mode);
            }
        }
    }

    /// Shifts near which a block's vector may be: the best one to merge with, then others. These were found for all blocks at once,
    /// or are found from the best one and from the shifts of cubes.
    fn shifts_to_try(&mut self, block: usize, best: Shift, query: &mut SoughtBlock) -> Vec<Shift> {
        let SearchEffort { starts: most, block_steps, .. } = self.frame.effort;
        let (_, search) = self.frame.reference.as_ref().expect("temporal modes have a reference");
        let mut shifts = vec![best];
        match search {
            MotionSearch::Done(found) => {
                let found = found[block];
                shifts.extend(found.iter().take(most));
                // A neighbour's vector that is clearly better than what was found leads to another place.
                if query.error(best) < CLEARLY_BETTER * query.error(found[0]) {
                    shifts.push(query.refine(best, block_steps));
                }
            }
            MotionSearch::InSlices(cubes) => {
                for cube in cubes.shifts(block, &mut self.cube_scratch) {
                    if shifts.iter().all(|known| !are_close(*known, cube)) {
                        shifts.push(cube);
                    }
                }
                let starts = shifts.into_iter().take(most);
                shifts = starts.flat_map(|start| [start, query.refine(start, block_steps)]).collect();
            }
        }
        shifts
    }

    /// By what the error over the rows looked at is multiplied to be about that of the whole block.
    fn error_share(&self) -> f32 {
        self.frame.effort.rows as f32
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
        let bits = self.mode_bits(mode, context);
        self.vector_cost(bits)
    }

    /// Weighted error that so many bits are worth, while modes are compared by their predictions.
    fn vector_cost(&self, bits: f32) -> f32 {
        VECTOR_LAMBDA * self.frame.pursuit.lambda * bits
    }

    /// Bits of a mode by the models as they are.
    fn mode_bits(&mut self, mode: BlockMode, context: &ModeContext) -> f32 {
        let mut bits = BitCount::default();
        syntax::modes::write(&mut self.models.modes, &mut bits, context, mode, self.frame.vector_step);
        bits.0
    }

    /// The spatial prediction if it costs less than the best temporal one, or if there is none.
    fn spatial_if_better(&mut self, block: &mut BlockAtHand, temporal: Option<Trial>) -> Trial {
        let Some(temporal) = temporal else {
            let prediction = self.predict_spatially(block);
            return self.pursue(block, BlockMode::Spatial, prediction, 0.0);
        };
        if self.is_spatial_hopeless(temporal.cost, block.context.as_ref()) {
            return temporal;
        }
        let prediction = self.predict_spatially(block);
        let share = self.frame.effort.spatial_error_share;
        let worst = share * temporal.pursued.predicted_error;
        let mut error = 0.0;
        if share.is_finite() {
            error = self.frame.targets.prediction_error(block.number, &prediction).weighted;
            if error > worst {
                return temporal;
            }
        }
        let spatial = self.pursue(block, BlockMode::Spatial, prediction, error);
        if spatial.cost < temporal.cost { spatial } else { temporal }
    }

    /// Whether a temporal prediction costs so little that the spatial one is not tried. It costs no more than the spatial one would
    /// with nothing left to correct, or than [`SearchEffort`] calls good enough.
    fn is_spatial_hopeless(&mut self, temporal_cost: f32, context: Option<&ModeContext>) -> bool {
        let mode_bits = context.map_or(0.0, |context| self.mode_bits(BlockMode::Spatial, context));
        let SearchEffort { spatial_from, spatial_bits_share, .. } = self.frame.effort;
        let doubted = spatial_from.max(spatial_bits_share * mode_bits);
        let least_bits = (mode_bits + self.costs[1].least_count).max(doubted);
        temporal_cost <= self.frame.pursuit.lambda * least_bits
    }

    fn predict_spatially(&self, block: &BlockAtHand) -> Block {
        let around = self.frame.causal.of(self.frame.targets.coords()[block.number], block.number);
        let around = around.map(|n| n.map(|n| self.samples.place(n as usize)));
        let mut prediction = [0; SAMPLES];
        let limit = self.frame.parameters.grid.truncation.codes();
        if self.frame.tools.spatial {
            predict_spatially(&around, self.samples.samples, limit, &mut prediction);
        }
        prediction
    }

    /// Levels for a prediction. `error`: about that of the prediction, or less.
    fn pursue(&mut self, block: &mut BlockAtHand, mode: BlockMode, prediction: Block, error: f32) -> Trial {
        let pursued = match self.no_levels(block.number, mode, &prediction, error) {
            Some(pursued) => pursued,
            None => self.search_levels(block, mode, &prediction),
        };
        let bits = block.context.as_ref().map_or(0.0, |context| self.mode_bits(mode, context));
        let cost = pursued.cost + self.frame.pursuit.lambda * bits;
        Trial { mode, prediction, pursued, cost }
    }

    /// Result of a pursuit that is over before it begins, as the prediction's error alone shows. `None` where the pursuit has to
    /// find out by itself. `error`: about that of the prediction, or less. `None` also where it is so large that some level surely
    /// pays.
    fn no_levels(&self, block: usize, mode: BlockMode, prediction: &Block, error: f32) -> Option<Pursued> {
        let costs = &self.costs[usize::from(mode == BlockMode::Spatial)];
        let unlikely = error > UNLIKELY * self.frame.pursuit.lambda * costs.least_first();
        if self.frame.refinement || self.frame.pursuit.rounding || unlikely {
            return None;
        }
        let error = self.frame.targets.prediction_error(block, prediction);
        if error.signs_hold { self.frame.pursuit.without_levels(error.weighted, costs) } else { None }
    }

    fn search_levels(&mut self, block: &mut BlockAtHand, mode: BlockMode, prediction: &Block) -> Pursued {
        if !block.has_target {
            self.frame.targets.spread(block.number, block.target);
            block.has_target = true;
        }
        let costs = &self.costs[usize::from(mode == BlockMode::Spatial)];
        let pursuit = &self.frame.pursuit;
        if !self.frame.refinement {
            return pursuit.run(block.target, block.metrics, prediction, costs);
        }
        let context = self.count_context(block.number, mode);
        let (parameters, models) = (self.frame.parameters, &mut self.models.coefficients);
        let mut bits = ModelBits { parameters, models, context, usual: costs };
        pursuit.run_refined(block.target, block.metrics, prediction, &mut bits)
    }

    /// What is known around a block when its number of levels is coded.
    fn count_context(&self, block: usize, mode: BlockMode) -> CountContext {
        let frame = self.frame;
        let count = |n: usize| self.coded.levels.count(n - self.range.start);
        CountContext::new(frame.targets.coords()[block], block, mode, frame.causal, count, frame.known)
    }

    /// Writes a block's symbols, learns from them, and reconstructs it.
    fn code(&mut self, block: &BlockAtHand, trial: Trial) {
        let frame = self.frame;
        if let Some(context) = &block.context {
            syntax::modes::write(
                &mut self.models.modes,
                &mut self.mode_encoder,
                context,
                trial.mode,
                frame.vector_step,
            );
        }
        let levels = &trial.pursued.levels;
        let context = self.count_context(block.number, trial.mode);
        let models = &mut self.models.coefficients;
        let (encoder, mut dc_from) = (&mut self.coefficient_encoder, None);
        let around_dc = |encoder: &RangeEncoder| {
            let bits = encoder.bits();
            self.coded.dc_bits += bits - *dc_from.get_or_insert(bits);
        };
        syntax::coefficients::write_around_dc(models, frame.parameters, encoder, &context, levels, around_dc);
        self.coded.modes.push(trial.mode);
        self.coded.levels.push(levels);
        let levels = self.coded.levels.of(block.number - self.range.start);
        self.costs[usize::from(trial.mode == BlockMode::Spatial)].learn(levels);
        let place = self.samples.place(block.number) as usize;
        let samples = &mut self.samples.samples[place * SAMPLES..][..SAMPLES];
        samples.copy_from_slice(&trial.prediction);
        if !levels.is_empty() {
            add_residual(frame.parameters, &frame.quantizer, levels, samples);
        }
    }
}
