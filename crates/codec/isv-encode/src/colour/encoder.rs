//! One frame's colour.

use super::motion_search::{ColourSearch, MotionSearch};
use super::quantizer::{Quantizer, SAMPLE_SCALE, Trade, level_means, push, values_by_slot};
use super::refresh::Refreshed;
use super::syntax;
use super::target::ColourTarget;
use crate::colour::syntax::coefficients::node_energy;
use crate::main::{ColourAttempt, ColourRate, Preset};
use isv_decode::colour::reconstruct::{
    ColourSteps, InterLevels, IntraLevels, IntraNode, first_place, reconstruct_inter, reconstruct_intra,
};
use isv_decode::colour::symbols::{Coefficient, ColourSymbols};
use isv_decode::colour::syntax::ColourSlices;
use isv_decode::colour::syntax::coefficients::{
    CoefficientModels, FrameEnergies, LayerBlocks, NodeContext, NodeEnergies, energy,
};
use isv_decode::colour::syntax::modes::{BlockBefore, ModeBlocks};
use isv_decode::colour::transform::DIFFERENCES;
use isv_decode::colour::tree::BlockTree;
use isv_decode::colour::{ColourCells, ColourFrame, ColourReference, ColourShape, ExactColour, Sample};
use isv_decode::main::{BlockMode, CausalBlocks, Vector};
use isv_format::{ColourHeader, ColourKind, ColourPayload, PayloadParts, SliceLayout};
use isv_volume::{ColourSample, SparseVolume};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Share of the error at which a block gets quarter voxels from which on it keeps them.
const STAYING: f32 = 0.7;
/// Rounding offset of magnitudes, for attempts that try no smaller levels.
const ROUNDING: f32 = 0.36;

/// Choices of the colour encoder that a stream does not record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSettings {
    /// Layers of samples, 1 to 3: at voxels, half voxels, quarter voxels.
    pub layers: u8,
    /// Quantizer step of luma in keyframes, and in frames that can be read without the one before, in 8-bit steps.
    pub key_step: f32,
    /// Quantizer step of luma in predicted frames, in 8-bit steps.
    pub step: f32,
    /// Step of both colour differences over that of luma.
    pub chroma: f32,
    /// Squared error, in steps, that a bit may cost.
    pub lambda: f32,
    /// Mean squared error that half voxels may leave in a block before it gets quarter voxels, in squared steps of keyframes.
    pub deepening: f32,
    /// Rounds of back projection.
    pub rounds: usize,
    /// How hard vectors are searched for.
    pub search: ColourSearch,
    /// Distance between the colours that are taken from a surface, in voxels.
    pub spacing: f32,
    /// Number of slices, 1 to 256.
    pub slices: u16,
    /// Frames of a cycle of refresh, in which all blocks are made exact again; `None` in streams that have keyframes for this.
    pub cycle: Option<u32>,
    /// Whether frames carry a hash of the decoded samples.
    pub checksums: bool,
}

impl Default for ColourSettings {
    fn default() -> Self {
        Self {
            layers: 2,
            key_step: 20.0,
            step: 32.0,
            chroma: 1.4,
            lambda: 0.1,
            deepening: 0.1,
            rounds: 3,
            search: ColourSearch::FULL,
            spacing: 0.25,
            slices: 1,
            cycle: None,
            checksums: false,
        }
    }
}

impl ColourSettings {
    /// Settings of a quality, 0 to 100: each 20 more halve the quantizer steps.
    #[must_use]
    pub fn of_quality(quality: f32, layers: u8) -> Self {
        let scale = ((50.0 - quality.clamp(0.0, 100.0)) / 20.0).exp2();
        Self { layers, ..Self::default() }.scaled(scale)
    }

    /// These settings with a factor on the quantizer steps.
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        Self { key_step: factor * self.key_step, step: factor * self.step, ..self }
    }

    /// These settings with as much work as a preset stands for.
    #[must_use]
    pub fn with_preset(self, preset: Preset) -> Self {
        match preset {
            Preset::Realtime => Self { rounds: 1, search: ColourSearch::QUICK, spacing: 0.45, ..self },
            Preset::Balanced | Preset::Archive => self,
        }
    }
}

/// Colour of a frame as coded.
#[derive(Clone, Debug)]
pub struct EncodedColour {
    /// The colour part.
    pub bytes: Vec<u8>,
    /// Bytes of modes, depths and vectors.
    pub mode_bytes: usize,
}

/// Codes the colour of the frames of a stream in order.
#[derive(Clone, Debug)]
pub struct ColourEncoder {
    settings: ColourSettings,
    entropy: ColourSlices,
    reference: Option<ColourReference>,
    /// Models as they were after the last frame without prediction, and after the last one with it: what levels cost, about.
    learned: [CoefficientModels; 2],
    /// Frames of the cycle of refresh so far, and the intra frame before it; 0 before the first frame.
    in_cycle: u32,
    /// What of the last frame is exact in a decoder that had nothing when the cycle began.
    exact: ExactColour,
}

impl ColourEncoder {
    /// Creates an encoder for the frames of a stream.
    #[must_use]
    pub fn new(settings: ColourSettings) -> Self {
        let learned = [0; 2].map(|_| CoefficientModels::default());
        let (entropy, exact) = (ColourSlices::default(), ExactColour::Nothing);
        Self { settings, entropy, reference: None, learned, in_cycle: 0, exact }
    }

    /// The last frame as decoders have it; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&Arc<ColourFrame>> {
        self.reference.as_ref().map(|reference| &reference.frame)
    }

    /// Codes the colour of a frame with the steps of the settings. See [`Self::encode_at_rate`].
    pub fn encode(
        &mut self,
        volume: &SparseVolume,
        samples: &[ColourSample],
        keyframe: bool,
    ) -> EncodedColour {
        self.encode_at_rate(volume, samples, keyframe, ColourRate::CONSTANT)
    }

    /// Codes the colour of a frame. `volume`: its decoded field; `samples`: colours as seen. Without any, the colour of the frame before
    /// stays; where it is refreshed, it is coded as if it had been seen. `rate`: what chooses its steps.
    pub fn encode_at_rate(
        &mut self,
        volume: &SparseVolume,
        samples: &[ColourSample],
        keyframe: bool,
        mut rate: ColourRate,
    ) -> EncodedColour {
        let kind = self.kind(keyframe);
        let scale = rate.first_scale(!kind.predicts());
        let cells = ColourCells::new(volume);
        let reference = self.reference.take().filter(|_| kind.predicts());
        let kept;
        let samples = match &reference {
            Some(before) if samples.is_empty() && kind == ColourKind::Resilient => {
                kept = before.frame.to_samples(volume.grid());
                &kept
            }
            _ => samples,
        };
        let shape = self.choose_shape(cells, volume, samples, reference.as_ref(), scale);
        if kind != ColourKind::Predicted {
            self.entropy = ColourSlices::default();
        }
        let coords = shape.cells().coords();
        let layout = SliceLayout::new(coords.len(), usize::from(self.settings.slices));
        let causal = CausalBlocks::new(coords, layout.ranges());
        // The symbols of other frames are read without the frame before.
        let known = match reference.as_ref().filter(|_| kind == ColourKind::Predicted) {
            Some(reference) => reference.blocks_at(coords),
            None => vec![None; coords.len()],
        };
        let frame = FrameBlocks {
            shape: &shape,
            causal: &causal,
            known: &known,
            ranges: layout.ranges().collect(),
            kind,
            max_depth: self.settings.layers - 1,
        };
        self.in_cycle = match self.settings.cycle {
            Some(cycle) if kind.predicts() => self.in_cycle % cycle.max(1) + 1,
            _ => 0,
        };
        let (coded, encoded) =
            match reference.as_ref().filter(|_| samples.is_empty() && kind != ColourKind::Resilient) {
                Some(before) => {
                    let coded = self.carry_over(&frame, &before.frame, self.steps(kind, scale));
                    let encoded = self.encoded(kind, &coded);
                    rate.spend(encoded.stream_bits());
                    (coded, encoded)
                }
                None => {
                    let target = ColourTarget::new(&shape, volume.grid(), samples, self.settings.rounds);
                    let wanted = target.by_block(&shape);
                    self.code_at_rate(&frame, &wanted, reference.as_ref(), (kind, scale), &mut rate)
                }
            };
        if let (Some(before), Some(_)) = (&reference, self.settings.cycle) {
            let (before, modes) = ((&*before.frame, self.exact_before()), &coded.symbols.modes);
            self.exact = ExactColour::of_frame(kind, &coded.frame.shape, modes, before);
        }
        self.entropy = coded.entropy;
        self.reference = Some(ColourReference::new(Arc::new(coded.frame), &coded.symbols));
        encoded
    }

    /// Codes a frame as often as its rate asks for. `scale`: of the steps of the first attempt.
    fn code_at_rate(
        &mut self,
        frame: &FrameBlocks,
        wanted: &[&[[f32; 3]]],
        reference: Option<&ColourReference>,
        (kind, mut scale): (ColourKind, f64),
        rate: &mut ColourRate,
    ) -> (CodedColour, EncodedColour) {
        let modes = match reference {
            Some(reference) => {
                let refreshed = self.refreshed(frame, &reference.frame);
                self.choose_modes(frame, wanted, reference, self.step(kind, scale), refreshed.as_ref())
            }
            None => vec![BlockMode::Spatial; wanted.len()],
        };
        let before = reference.map(|reference| &*reference.frame);
        let mut attempts = Vec::new();
        loop {
            let coded = self.code_frame(frame, wanted, &modes, before, self.steps(kind, scale));
            let encoded = self.encoded(kind, &coded);
            let attempt = ColourAttempt { intra: !kind.predicts(), scale, bits: encoded.stream_bits() };
            attempts.push(attempt);
            match rate.retry(&attempts) {
                Some(other) => scale = other,
                None => {
                    rate.learn(&attempt);
                    return (coded, encoded);
                }
            }
        }
    }

    /// The colour part of a frame as coded.
    fn encoded(&self, kind: ColourKind, coded: &CodedColour) -> EncodedColour {
        let CodedColour { frame, segments, steps, .. } = coded;
        let header = ColourHeader {
            kind,
            luma_step: steps.luma as u16,
            chroma_step: steps.chroma as u16,
            slices: self.settings.slices,
            hash: self.settings.checksums.then(|| frame.hash()),
        };
        let layers =
            segments.layers.iter().map(|slices| slices.iter().map(Vec::as_slice).collect()).collect();
        let payload =
            ColourPayload { header, modes: segments.modes.iter().map(Vec::as_slice).collect(), layers };
        let mode_bytes = segments.modes.iter().map(Vec::len).sum();
        EncodedColour { bytes: payload.to_bytes(), mode_bytes }
    }

    /// Step of luma in 8-bit steps. `scale`: a factor on that of the settings.
    fn step(&self, kind: ColourKind, scale: f64) -> f32 {
        let ColourSettings { key_step, step, .. } = self.settings;
        scale as f32 * if kind.predicts() { step } else { key_step }
    }

    /// The steps of a frame as they are coded.
    fn steps(&self, kind: ColourKind, scale: f64) -> ColourSteps {
        // Blocks that are coded anew in a resilient frame are to be as good as those of an intra frame.
        let step = match kind {
            ColourKind::Intra | ColourKind::Resilient => self.step(ColourKind::Intra, scale),
            ColourKind::Predicted => self.step(ColourKind::Predicted, scale),
        };
        let in_sixteenths = |step: f32| (step * 16.0).round().clamp(1.0, 65535.0) as u32;
        ColourSteps { luma: in_sixteenths(step), chroma: in_sixteenths(step * self.settings.chroma) }
    }

    /// Chooses the depth of each block's samples: quarter voxels where half voxels miss much of what was seen.
    fn choose_shape(
        &self,
        cells: ColourCells,
        volume: &SparseVolume,
        samples: &[ColourSample],
        reference: Option<&ColourReference>,
        scale: f64,
    ) -> ColourShape {
        let blocks = cells.coords().len();
        let depth = (self.settings.layers - 1).min(1);
        let before = reference.map(|reference| reference.blocks_at(cells.coords()));
        let was_deep =
            |block: usize| before.as_ref().is_some_and(|b| b[block].is_some_and(|b| b.depth > depth));
        if samples.is_empty() {
            let depths = (0..blocks).map(|block| if was_deep(block) { depth + 1 } else { depth }).collect();
            return ColourShape::new(cells, depths, volume);
        }
        let shape = ColourShape::new(cells, vec![depth; blocks], volume);
        if self.settings.layers < 3 {
            return shape;
        }
        let misses = ColourTarget::misses(&shape, volume.grid(), samples, 1);
        let most = self.settings.deepening * (scale as f32 * self.settings.key_step).powi(2);
        let of_block = |(block, missed): (usize, &f32)| {
            let most = if was_deep(block) { STAYING * most } else { most };
            if *missed > most { depth + 1 } else { depth }
        };
        let depths: Vec<u8> = misses.iter().enumerate().map(of_block).collect();
        match depths.contains(&2) {
            true => ColourShape::new(shape.into_cells(), depths, volume),
            false => shape,
        }
    }

    /// How the next frame is coded.
    fn kind(&self, keyframe: bool) -> ColourKind {
        match self.settings.cycle {
            _ if keyframe || self.reference.is_none() => ColourKind::Intra,
            Some(_) => ColourKind::Resilient,
            None => ColourKind::Predicted,
        }
    }

    /// What of the frame before is exact in a decoder that had nothing when the cycle of the frame began.
    fn exact_before(&self) -> &ExactColour {
        if self.in_cycle > 1 { &self.exact } else { &ExactColour::Nothing }
    }

    /// The blocks of a frame that must be exact after it, if it is part of a cycle.
    fn refreshed(&self, frame: &FrameBlocks, before: &ColourFrame) -> Option<Refreshed> {
        let cycle = self.settings.cycle?;
        Some(Refreshed::new((self.in_cycle - 1, cycle), frame.known.len(), (before, self.exact_before())))
    }

    /// A frame that is the one before, where its surface now is.
    fn carry_over(&self, frame: &FrameBlocks, before: &ColourFrame, steps: ColourSteps) -> CodedColour {
        let mut modes = Vec::with_capacity(frame.known.len());
        for block in 0..frame.known.len() {
            let context = syntax::modes::context(&frame.mode_blocks(0), block, &modes);
            let candidates = context.candidates.as_slice();
            // Standing still is always among them.
            let candidate = candidates.iter().position(|vector| *vector == Vector::ZERO).unwrap_or(0);
            modes.push(BlockMode::Merged { candidate: candidate as u8, vector: candidates[candidate] });
        }
        let nothing = vec![[Vec::new(), Vec::new(), Vec::new()]; modes.len()];
        let mut symbols =
            ColourSymbols { modes, depths: frame.shape.depths().to_vec(), ..Default::default() };
        enter(&mut symbols, &nothing);
        let mut layers = frame.shape.layers();
        reconstruct_inter(frame.shape, &mut layers, &symbols.modes, &steps, before, &NoResiduals);
        let mut entropy = self.entropy.clone();
        let segments = write(&mut entropy, frame, &symbols);
        let frame = ColourFrame { shape: frame.shape.clone(), layers };
        CodedColour { symbols, frame, entropy, segments, steps }
    }

    /// Codes a frame under models that have learned what it is like: those of the last one of its kind, or of a first attempt.
    fn code_frame(
        &mut self,
        frame: &FrameBlocks,
        wanted: &[&[[f32; 3]]],
        modes: &[BlockMode],
        before: Option<&ColourFrame>,
        steps: ColourSteps,
    ) -> CodedColour {
        let learned = usize::from(frame.kind.predicts());
        let attempts = if frame.kind.predicts() { 1..2 } else { 0..2 };
        let mut coded = None;
        for attempt in attempts {
            let trade = Trade { lambda: self.settings.lambda, rounding: ROUNDING, search: attempt > 0 };
            let quantizer = Quantizer { models: self.learned[learned].clone(), steps, trade };
            let temporal = Quantizer { trade: self.temporal_trade(frame.kind, trade), ..quantizer.clone() };
            let (symbols, decoded) = code(frame, wanted, modes, before, [&quantizer, &temporal]);
            let mut entropy = self.entropy.clone();
            let segments = write(&mut entropy, frame, &symbols);
            self.learned[learned] = entropy.slices(1)[0].coefficients.clone();
            coded = Some(CodedColour { symbols, frame: decoded, entropy, segments, steps });
        }
        coded.expect("there is an attempt")
    }

    /// How the levels of temporal blocks are chosen. Resilient frames have the small steps of intra ones. A bit still saves as much
    /// squared error as in other predicted frames.
    fn temporal_trade(&self, kind: ColourKind, trade: Trade) -> Trade {
        let ColourSettings { key_step, step, .. } = self.settings;
        let larger = if kind == ColourKind::Resilient { step / key_step } else { 1.0 };
        Trade { lambda: larger * larger * trade.lambda, ..trade }
    }

    /// How each block is predicted.
    fn choose_modes(
        &self,
        frame: &FrameBlocks,
        wanted: &[&[[f32; 3]]],
        reference: &ColourReference,
        step: f32,
        refreshed: Option<&Refreshed>,
    ) -> Vec<BlockMode> {
        let (shape, search) = (frame.shape, self.settings.search);
        let trade = (step, self.settings.lambda);
        let motion = MotionSearch::new(shape, &reference.frame, wanted, &search, trade);
        let last = reference.blocks_at(shape.cells().coords());
        let of_block =
            |before: &Option<BlockBefore>| before.and_then(|before| before.vector).into_iter().collect();
        let start: Vec<Vec<Vector>> = last.iter().map(of_block).collect();
        let (vectors, tried) = motion.run(search.steps, &start);
        let spreads: Vec<f32> = wanted.par_iter().map(|values| spread(values)).collect();
        let mut models = self.entropy.clone();
        let mut chooser = motion.chooser(tried);
        let mut allowed = refreshed.map(|refreshed| refreshed.allowed(shape));
        let mut modes: Vec<BlockMode> = Vec::with_capacity(vectors.len());
        for (slice, range) in frame.ranges.iter().enumerate() {
            let models = &mut models.slices(slice + 1)[slice].modes.modes;
            for block in range.clone() {
                let context = syntax::modes::context(&frame.mode_blocks(slice), block, &modes);
                let most = 0.8 * spreads[block] + 0.5 * step * step / 12.0;
                let allows = |vector| allowed.as_mut().is_none_or(|allowed| allowed.contain(block, vector));
                let mode = chooser.choose(block, vectors[block], &context, models, most, allows);
                syntax::modes::learn(models, &context, mode);
                modes.push(mode);
            }
        }
        match refreshed {
            None => modes,
            Some(refreshed) => {
                refreshed.settle(shape, &mut modes);
                frame.coded_anew(&modes)
            }
        }
    }
}

/// The blocks of a frame, as the syntax sees them.
#[derive(Debug)]
struct FrameBlocks<'a> {
    shape: &'a ColourShape,
    causal: &'a CausalBlocks,
    /// The blocks in the frame before, as far as the syntax looks at it.
    known: &'a [Option<BlockBefore>],
    /// Blocks of each slice.
    ranges: Vec<Range<usize>>,
    kind: ColourKind,
    max_depth: u8,
}

impl FrameBlocks<'_> {
    /// The blocks of a slice, as the syntax of modes sees them.
    fn mode_blocks(&self, slice: usize) -> ModeBlocks<'_> {
        let (causal, before, range) = (self.causal, self.known, self.ranges[slice].clone());
        ModeBlocks { range, causal, before, predicts: self.kind.predicts(), max_depth: self.max_depth }
    }

    /// The modes of blocks that keep their vectors after others have lost theirs, which cannot be merged with any more.
    fn coded_anew(&self, modes: &[BlockMode]) -> Vec<BlockMode> {
        let mut anew: Vec<BlockMode> = Vec::with_capacity(modes.len());
        for (slice, range) in self.ranges.iter().enumerate() {
            let blocks = self.mode_blocks(slice);
            for block in range.clone() {
                anew.push(match modes[block].vector() {
                    None => BlockMode::Spatial,
                    Some(vector) => {
                        let context = syntax::modes::context(&blocks, block, &anew);
                        let candidates = context.candidates.as_slice();
                        match candidates.iter().position(|candidate| *candidate == vector) {
                            Some(candidate) => BlockMode::Merged { candidate: candidate as u8, vector },
                            None => BlockMode::New { vector },
                        }
                    }
                });
            }
        }
        anew
    }
}

/// A frame as coded once.
struct CodedColour {
    symbols: ColourSymbols,
    frame: ColourFrame,
    entropy: ColourSlices,
    segments: Segments,
    steps: ColourSteps,
}

/// The bytes of a frame: modes by slice, coefficients by layer and slice.
struct Segments {
    modes: Vec<Vec<u8>>,
    layers: Vec<Vec<Vec<u8>>>,
}

impl EncodedColour {
    /// Bits that the colour adds to a stream.
    fn stream_bits(&self) -> f64 {
        8.0 * (self.bytes.len() + PayloadParts::LENGTH_BYTES) as f64
    }
}

/// Mean squared distance of values from their mean.
fn spread(values: &[[f32; 3]]) -> f32 {
    let count = values.len().max(1) as f32;
    (0..3)
        .map(|c| {
            let mean = values.iter().map(|v| v[c]).sum::<f32>() / count;
            let squares: f32 = values.iter().map(|v| (v[c] - mean).powi(2)).sum();
            if c == 0 { squares } else { 0.5 * squares }
        })
        .sum::<f32>()
        / count
}

/// Chooses the coefficients of a frame, and decodes it. The quantizers are those of spatial and of temporal blocks.
fn code(
    FrameBlocks { kind, shape, .. }: &FrameBlocks,
    wanted: &[&[[f32; 3]]],
    modes: &[BlockMode],
    before: Option<&ColourFrame>,
    [quantizer, temporal]: [&Quantizer; 2],
) -> (ColourSymbols, ColourFrame) {
    let mut symbols =
        ColourSymbols { modes: modes.to_vec(), depths: shape.depths().to_vec(), layers: Default::default() };
    let mut coefficients: Vec<[Vec<Coefficient>; 3]> = modes.iter().map(|_| Default::default()).collect();
    let mut layers = shape.layers();
    if let Some(before) = before {
        let chosen = ChosenResiduals::new(shape, wanted, temporal);
        reconstruct_inter(shape, &mut layers, modes, &quantizer.steps, before, &chosen);
        coefficients =
            chosen.coefficients.into_iter().map(|own| own.into_inner().unwrap_or_default()).collect();
    }
    if modes.contains(&BlockMode::Spatial) {
        let mut chosen = ChosenLevels::new(shape, wanted, modes, quantizer.clone());
        reconstruct_intra(*kind, shape, &mut layers, modes, &quantizer.steps, &mut chosen);
        for (block, own) in chosen.coefficients.into_iter().enumerate() {
            if modes[block] == BlockMode::Spatial {
                coefficients[block] = own;
            }
        }
    }
    enter(&mut symbols, &coefficients);
    (symbols, ColourFrame { shape: (*shape).clone(), layers })
}

/// Enters the coefficients of all blocks into a frame's symbols.
fn enter(symbols: &mut ColourSymbols, coefficients: &[[Vec<Coefficient>; 3]]) {
    symbols.layers = Default::default();
    for of_block in coefficients {
        for (layer, own) in symbols.layers.iter_mut().zip(of_block) {
            layer.push_block(own.iter().copied());
        }
    }
}

/// The coefficients of a block that is predicted from the frame before.
fn inter_coefficients(
    tree: &BlockTree,
    predicted: &[Sample],
    wanted: &[[f32; 3]],
    quantizer: &mut Quantizer,
) -> [Vec<Coefficient>; 3] {
    let residual = tree
        .leaf_slots()
        .zip(wanted)
        .map(|(slot, wanted)| [0, 1, 2].map(|c| wanted[c] - f32::from(predicted[slot][c]) / SAMPLE_SCALE));
    let means = level_means(tree, residual.collect());
    let mut out: [Vec<Coefficient>; 3] = Default::default();
    let mut energies = NodeEnergies::default();
    for layer in 0..=tree.depth() {
        out[usize::from(layer)] = quantizer.layer(tree, layer, 1, &means, &mut energies, 2.0);
        if out[usize::from(layer)].is_empty() {
            energies = NodeEnergies::default();
        }
    }
    out
}

/// The levels of inter blocks, chosen once it is known what is predicted.
struct ChosenResiduals<'a> {
    shape: &'a ColourShape,
    wanted: &'a [&'a [[f32; 3]]],
    quantizer: &'a Quantizer,
    coefficients: Vec<OnceLock<[Vec<Coefficient>; 3]>>,
}

impl<'a> ChosenResiduals<'a> {
    fn new(shape: &'a ColourShape, wanted: &'a [&'a [[f32; 3]]], quantizer: &'a Quantizer) -> Self {
        let coefficients = wanted.iter().map(|_| OnceLock::new()).collect();
        Self { shape, wanted, quantizer, coefficients }
    }
}

impl InterLevels for ChosenResiduals<'_> {
    type Worker = (Quantizer, BlockTree);

    fn worker(&self) -> Self::Worker {
        (self.quantizer.clone(), BlockTree::default())
    }

    fn levels(
        &self,
        (quantizer, tree): &mut Self::Worker,
        block: usize,
        predicted: &[Sample],
    ) -> [&[Coefficient]; 3] {
        self.shape.build_tree(block, tree);
        let choose = || inter_coefficients(tree, predicted, self.wanted[block], quantizer);
        self.coefficients[block].get_or_init(choose).each_ref().map(Vec::as_slice)
    }
}

/// The levels of a frame without any.
struct NoResiduals;

impl InterLevels for NoResiduals {
    type Worker = ();

    fn worker(&self) {}

    fn levels(&self, (): &mut (), _block: usize, _predicted: &[Sample]) -> [&[Coefficient]; 3] {
        [&[]; 3]
    }
}

/// The levels of intra blocks, chosen once it is known what is predicted.
struct ChosenLevels {
    wanted: Vec<Vec<Vec<[f32; 3]>>>,
    quantizer: Quantizer,
    coefficients: Vec<[Vec<Coefficient>; 3]>,
    /// Energies of the intra blocks.
    energies: Vec<Option<NodeEnergies>>,
}

/// A level of an intra block as it is coded.
struct ChosenBlock {
    energies: NodeEnergies,
    level: usize,
    block: usize,
    place: u32,
    coefficients: Vec<Coefficient>,
}

impl ChosenLevels {
    fn new(shape: &ColourShape, wanted: &[&[[f32; 3]]], modes: &[BlockMode], quantizer: Quantizer) -> Self {
        let of_block = |tree: &mut BlockTree, block: usize| {
            if modes[block] != BlockMode::Spatial {
                return Vec::new();
            }
            shape.build_tree(block, tree);
            level_means(tree, wanted[block].to_vec())
        };
        let count = modes.len();
        Self {
            wanted: (0..count).into_par_iter().map_init(BlockTree::default, of_block).collect(),
            quantizer,
            coefficients: (0..count).map(|_| Default::default()).collect(),
            energies: vec![None; count],
        }
    }
}

impl IntraLevels for ChosenLevels {
    type Worker = Quantizer;
    type Block = ChosenBlock;

    fn worker(&self) -> Quantizer {
        self.quantizer.clone()
    }

    fn root(&mut self, block: usize, weight: u32, predicted: [i32; 3]) -> [i16; 3] {
        let wanted = self.wanted[block][0][0];
        let change = [0, 1, 2].map(|c| wanted[c] - predicted[c] as f32 / SAMPLE_SCALE);
        let (levels, _) = self.quantizer.root(0, weight, change);
        if levels != [0; 3] {
            self.coefficients[block][0].push(Coefficient { place: 0, levels });
        }
        self.energies[block].get_or_insert_default().root = energy(levels.map(i32::from));
        levels
    }

    fn begin(&self, block: usize, tree: &BlockTree, layer: u8, level: usize) -> ChosenBlock {
        let mut energies = self.energies[block].clone().unwrap_or_default();
        energies.begin_level();
        ChosenBlock {
            energies,
            level,
            block,
            place: first_place(tree, layer, level),
            coefficients: Vec::new(),
        }
    }

    fn node(
        &self,
        quantizer: &mut Quantizer,
        state: &mut ChosenBlock,
        node: &IntraNode,
    ) -> Option<[[i16; 3]; DIFFERENCES]> {
        let count = node.children.count_ones() as usize;
        if count == 1 {
            return None;
        }
        let place = state.place;
        state.place += count as u32 - 1;
        let own = &self.wanted[state.block][state.level + 1][node.first_child..][..count];
        let mut wanted = values_by_slot(node.children, own);
        for (wanted, predicted) in wanted.iter_mut().zip(node.predicted) {
            (0..3).for_each(|c| wanted[c] -= predicted[c] as f32 / SAMPLE_SCALE);
        }
        let (parent, neighbours) = state.energies.around(state.level, node.place);
        let context = NodeContext { level: state.level, kind: 0, parent, neighbours, count: count - 1 };
        let (levels, _) = quantizer.node(&context, node.children, node.weights, &wanted)?;
        push(&mut state.coefficients, place, node.children, &levels);
        state.energies.set(node.place, node_energy(&levels));
        Some(levels)
    }

    fn end(&mut self, layer: u8, _level: usize, blocks: Vec<(usize, ChosenBlock)>) {
        for (block, state) in blocks {
            self.coefficients[block][usize::from(layer)].extend(state.coefficients);
            self.energies[block] = Some(state.energies);
        }
    }
}

/// Writes the symbols of a frame: its modes, and each layer of its coefficients, slice by slice.
fn write(entropy: &mut ColourSlices, frame: &FrameBlocks, symbols: &ColourSymbols) -> Segments {
    let layers = usize::from(frame.max_depth) + 1;
    let mut segments = Segments { modes: Vec::new(), layers: vec![Vec::new(); layers] };
    let models = entropy.slices(frame.ranges.len());
    for (slice, models) in models.iter_mut().enumerate() {
        let blocks = frame.mode_blocks(slice);
        segments.modes.push(syntax::modes::write(
            &mut models.modes,
            &blocks,
            &symbols.modes,
            &symbols.depths,
        ));
        let mut energies = FrameEnergies::new(symbols.modes.len());
        let mut blocks = LayerBlocks {
            shape: frame.shape,
            range: frame.ranges[slice].clone(),
            modes: &symbols.modes,
            causal: frame.causal,
            before: frame.known,
            energies: &mut energies,
        };
        for (layer, out) in segments.layers.iter_mut().enumerate() {
            let (models, coefficients) = (&mut models.coefficients, &symbols.layers[layer]);
            out.push(syntax::coefficients::write(models, layer as u8, &mut blocks, coefficients));
        }
    }
    segments
}
