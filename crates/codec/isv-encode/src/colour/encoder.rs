//! One frame's colour.

use super::motion_search::{ColourSearch, MotionSearch};
use super::quantizer::{Gain, Quantizer, SAMPLE_SCALE, Trade, level_means, push, values_by_slot};
use super::syntax;
use super::target::ColourTarget;
use crate::colour::syntax::coefficients::node_energy;
use isv_decode::colour::reconstruct::{
    ColourSteps, InterPredictor, IntraLevels, IntraNode, first_place, reconstruct_inter, reconstruct_intra,
};
use isv_decode::colour::symbols::{Coefficient, ColourSymbols};
use isv_decode::colour::syntax::ColourSlices;
use isv_decode::colour::syntax::coefficients::{
    CoefficientModels, FrameEnergies, LayerBlocks, NodeContext, NodeEnergies, energy,
};
use isv_decode::colour::syntax::modes::{BlockBefore, ModeBlocks};
use isv_decode::colour::transform::DIFFERENCES;
use isv_decode::colour::tree::BlockTree;
use isv_decode::colour::{ColourCells, ColourFrame, ColourReference, ColourShape};
use isv_decode::main::{BlockMode, CausalBlocks, Vector};
use isv_format::{ColourHeader, ColourKind, ColourPayload, SliceLayout};
use isv_volume::{ColourSample, SparseVolume};
use rayon::prelude::*;
use std::sync::Arc;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 16;

/// Choices of the colour encoder that a stream does not record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSettings {
    /// Layers of samples, 1 to 3: at voxels, half voxels, quarter voxels.
    pub layers: u8,
    /// Quantizer step of luma in keyframes, in 8-bit steps.
    pub key_step: f32,
    /// The same in frames that are predicted.
    pub step: f32,
    /// Step of both colour differences over that of luma.
    pub chroma: f32,
    /// Squared error, in steps, that a bit may cost.
    pub lambda: f32,
    /// Rounds of back projection.
    pub rounds: usize,
    /// Whether frames carry a hash of the decoded samples.
    pub checksums: bool,
}

impl Default for ColourSettings {
    fn default() -> Self {
        Self { layers: 2, key_step: 20.0, step: 40.0, chroma: 1.4, lambda: 0.15, rounds: 3, checksums: false }
    }
}

impl ColourSettings {
    /// Settings of a quality, 0 to 100: each 20 more halve the quantizer steps.
    #[must_use]
    pub fn of_quality(quality: f32, layers: u8) -> Self {
        let scale = ((50.0 - quality.clamp(0.0, 100.0)) / 20.0).exp2();
        let usual = Self::default();
        Self { layers, key_step: usual.key_step * scale, step: usual.step * scale, ..usual }
    }
}

/// Colour of a frame as coded.
#[derive(Clone, Debug)]
pub struct EncodedColour {
    /// The colour part.
    pub bytes: Vec<u8>,
    /// Bytes of modes, depths and vectors.
    pub mode_bytes: usize,
    /// Bytes of each layer.
    pub layer_bytes: [usize; 3],
    /// Share of the blocks that are predicted from the frame before.
    pub inter_share: f64,
}

/// Codes the colour of the frames of a stream in order.
#[derive(Clone, Debug)]
pub struct ColourEncoder {
    settings: ColourSettings,
    entropy: ColourSlices,
    reference: Option<ColourReference>,
    /// Models as they were after the last frame without prediction, and after the last one with it: what levels cost, about.
    learned: [CoefficientModels; 2],
}

impl ColourEncoder {
    /// Creates an encoder for the frames of a stream.
    #[must_use]
    pub fn new(settings: ColourSettings) -> Self {
        let learned = [0; 2].map(|_| CoefficientModels::default());
        Self { settings, entropy: ColourSlices::default(), reference: None, learned }
    }

    /// The last frame as decoders have it; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&Arc<ColourFrame>> {
        self.reference.as_ref().map(|reference| &reference.frame)
    }

    /// Codes the colour of a frame. `volume`: its decoded field; `samples`: colours as seen.
    pub fn encode(
        &mut self,
        volume: &SparseVolume,
        samples: &[ColourSample],
        keyframe: bool,
    ) -> EncodedColour {
        let cells = ColourCells::new(volume);
        let depths = vec![self.settings.layers - 1; cells.coords().len()];
        let shape = ColourShape::new(cells, depths, volume);
        let target = ColourTarget::new(&shape, volume.grid(), samples, self.settings.rounds);
        let wanted = leaf_values(&shape, &target);
        let reference = self.reference.take().filter(|_| !keyframe);
        let step = if reference.is_some() { self.settings.step } else { self.settings.key_step };
        let in_sixteenths = |step: f32| (step * 16.0).round().clamp(1.0, 65535.0) as u32;
        let steps =
            ColourSteps { luma: in_sixteenths(step), chroma: in_sixteenths(step * self.settings.chroma) };
        let modes = match &reference {
            Some(reference) => self.choose_modes(&shape, &wanted, reference, step),
            None => vec![BlockMode::Spatial; shape.depths().len()],
        };
        if reference.is_none() {
            self.entropy = ColourSlices::default();
        }
        // Models that have learned what this frame is like: those of the last one of its kind, or of a first attempt.
        let before = reference.as_ref().map(|reference| &*reference.frame);
        let coords = shape.cells().coords();
        let causal = CausalBlocks::new(coords, SliceLayout::new(coords.len(), 1).ranges());
        let known = match &reference {
            Some(reference) => reference.blocks_at(coords),
            None => vec![None; coords.len()],
        };
        let kind = usize::from(reference.is_some());
        let attempts = 2;
        let mut result = None;
        for attempt in 0..attempts {
            let search = attempt > 0 || reference.is_some();
            let trade = Trade { lambda: self.settings.lambda, rounding: 0.36, search };
            let quantizer = Quantizer { models: self.learned[kind].clone(), steps, trade };
            let (symbols, frame) = code(&shape, &wanted, &modes, before, &quantizer);
            let mut entropy = self.entropy.clone();
            let written = write(
                &mut entropy,
                &shape,
                &symbols,
                &causal,
                &known,
                reference.is_some(),
                self.settings.layers,
            );
            self.learned[kind] = entropy.slices(1)[0].coefficients.clone();
            result = Some((symbols, frame, entropy, written));
            if reference.is_some() {
                break;
            }
        }
        let (symbols, frame, entropy, (mode_bytes, layer_bytes)) = result.expect("there is an attempt");
        self.entropy = entropy;
        let header = ColourHeader {
            kind: if reference.is_some() { ColourKind::Predicted } else { ColourKind::Intra },
            luma_step: steps.luma as u16,
            chroma_step: steps.chroma as u16,
            slices: 1,
            hash: self.settings.checksums.then(|| frame.hash()),
        };
        let layers = layer_bytes.iter().map(|bytes| vec![&bytes[..]]).collect();
        let payload = ColourPayload { header, modes: vec![&mode_bytes], layers };
        let inter = symbols.modes.iter().filter(|mode| mode.vector().is_some()).count();
        let mut sizes = [0; 3];
        layer_bytes.iter().zip(&mut sizes).for_each(|(bytes, size)| *size = bytes.len());
        let encoded = EncodedColour {
            bytes: payload.to_bytes(),
            mode_bytes: mode_bytes.len(),
            layer_bytes: sizes,
            inter_share: inter as f64 / symbols.modes.len().max(1) as f64,
        };
        self.reference = Some(ColourReference::new(Arc::new(frame), &symbols));
        encoded
    }

    /// How each block is predicted.
    fn choose_modes(
        &self,
        shape: &ColourShape,
        wanted: &[Vec<[f32; 3]>],
        reference: &ColourReference,
        step: f32,
    ) -> Vec<BlockMode> {
        let search = ColourSearch::FULL;
        let lambda = self.settings.lambda * step * step;
        let motion = MotionSearch::new(shape, &reference.frame, wanted, &search, lambda);
        let known = reference.blocks_at(shape.cells().coords());
        let start: Vec<Vec<Vector>> = known
            .iter()
            .map(|before| before.and_then(|before| before.vector).into_iter().collect())
            .collect();
        let vectors = motion.run(search.steps, &start);
        let spreads: Vec<f32> = wanted.par_iter().map(|values| spread(values)).collect();
        let coords = shape.cells().coords();
        let causal = CausalBlocks::new(coords, SliceLayout::new(coords.len(), 1).ranges());
        let blocks = ModeBlocks {
            range: 0..coords.len(),
            causal: &causal,
            before: &known,
            predicts: true,
            max_depth: self.settings.layers - 1,
        };
        let mut models = self.entropy.clone().slices(1)[0].modes.clone();
        let mut chooser = motion.chooser();
        let mut modes: Vec<BlockMode> = Vec::with_capacity(vectors.len());
        for (block, vector) in vectors.into_iter().enumerate() {
            let context = syntax::modes::context(&blocks, block, &modes);
            let most = 0.8 * spreads[block] + 0.5 * step * step / 12.0;
            let mode = chooser.choose(block, vector, &context, &mut models.modes, most);
            syntax::modes::learn(&mut models.modes, &context, mode);
            modes.push(mode);
        }
        modes
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

/// The values wanted of the leaves of each block.
fn leaf_values(shape: &ColourShape, target: &ColourTarget) -> Vec<Vec<[f32; 3]>> {
    let of_block = |tree: &mut BlockTree, block: usize| {
        shape.build_tree(block, tree);
        let depth = shape.depths()[block];
        let values = &target.layers[usize::from(depth)][shape.block_samples(block, depth)];
        tree.leaf_slots().map(|slot| values[slot]).collect()
    };
    (0..shape.depths().len()).into_par_iter().map_init(BlockTree::default, of_block).collect()
}

/// Chooses the coefficients of a frame, and decodes it.
fn code(
    shape: &ColourShape,
    wanted: &[Vec<[f32; 3]>],
    modes: &[BlockMode],
    before: Option<&ColourFrame>,
    quantizer: &Quantizer,
) -> (ColourSymbols, ColourFrame) {
    let mut symbols =
        ColourSymbols { modes: modes.to_vec(), depths: shape.depths().to_vec(), layers: Default::default() };
    let mut coefficients: Vec<[Vec<Coefficient>; 3]> = match before {
        Some(before) => (0..modes.len())
            .into_par_iter()
            .with_min_len(CHUNK)
            .map_init(
                || (InterPredictor::new(shape, modes, before), BlockTree::default(), quantizer.clone()),
                |(predictor, tree, quantizer), block| {
                    if modes[block] == BlockMode::Spatial {
                        return Default::default();
                    }
                    shape.build_tree(block, tree);
                    inter_coefficients(tree, predictor.predict(block), &wanted[block], quantizer)
                },
            )
            .collect(),
        None => (0..modes.len()).map(|_| Default::default()).collect(),
    };
    let mut layers = shape.layers();
    if let Some(before) = before {
        enter(&mut symbols, &coefficients);
        reconstruct_inter(shape, &mut layers, &symbols, &quantizer.steps, before);
    }
    if modes.contains(&BlockMode::Spatial) {
        let mut chosen = ChosenLevels::new(shape, wanted, modes, quantizer.clone());
        reconstruct_intra(shape, &mut layers, modes, &quantizer.steps, &mut chosen);
        for (block, own) in chosen.coefficients.into_iter().enumerate() {
            if modes[block] == BlockMode::Spatial {
                coefficients[block] = own;
            }
        }
        enter(&mut symbols, &coefficients);
    }
    (symbols, ColourFrame { shape: shape.clone(), layers })
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
    predicted: &[isv_decode::colour::Sample],
    wanted: &[[f32; 3]],
    quantizer: &mut Quantizer,
) -> [Vec<Coefficient>; 3] {
    let residual = predicted
        .iter()
        .zip(wanted)
        .map(|(sample, wanted)| [0, 1, 2].map(|c| wanted[c] - f32::from(sample[c]) / SAMPLE_SCALE));
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

/// The levels of intra blocks, chosen once it is known what is predicted.
struct ChosenLevels<'a> {
    wanted: Vec<Vec<Vec<[f32; 3]>>>,
    quantizer: Quantizer,
    coefficients: Vec<[Vec<Coefficient>; 3]>,
    energies: Vec<NodeEnergies>,
    modes: &'a [BlockMode],
}

/// A level of an intra block as it is coded.
struct ChosenBlock {
    quantizer: Quantizer,
    energies: NodeEnergies,
    layer: u8,
    level: usize,
    block: usize,
    place: u32,
    coefficients: Vec<Coefficient>,
    gain: Gain,
}

impl<'a> ChosenLevels<'a> {
    fn new(
        shape: &ColourShape,
        wanted: &[Vec<[f32; 3]>],
        modes: &'a [BlockMode],
        quantizer: Quantizer,
    ) -> Self {
        let of_block = |tree: &mut BlockTree, block: usize| {
            if modes[block] != BlockMode::Spatial {
                return Vec::new();
            }
            shape.build_tree(block, tree);
            level_means(tree, wanted[block].clone())
        };
        let count = modes.len();
        Self {
            wanted: (0..count).into_par_iter().map_init(BlockTree::default, of_block).collect(),
            quantizer,
            coefficients: (0..count).map(|_| Default::default()).collect(),
            energies: vec![NodeEnergies::default(); count],
            modes,
        }
    }
}

impl IntraLevels for ChosenLevels<'_> {
    type Block = ChosenBlock;

    fn root(&mut self, block: usize, weight: u32, predicted: [i32; 3]) -> [i16; 3] {
        debug_assert_eq!(self.modes[block], BlockMode::Spatial);
        let wanted = self.wanted[block][0][0];
        let change = [0, 1, 2].map(|c| wanted[c] - predicted[c] as f32 / SAMPLE_SCALE);
        let (levels, _) = self.quantizer.root(0, weight, change);
        if levels != [0; 3] {
            self.coefficients[block][0].push(Coefficient { place: 0, levels });
        }
        self.energies[block].root = energy(levels.map(i32::from));
        levels
    }

    fn begin(&self, block: usize, tree: &BlockTree, layer: u8, level: usize) -> ChosenBlock {
        let mut energies = self.energies[block].clone();
        energies.begin_level();
        ChosenBlock {
            quantizer: self.quantizer.clone(),
            energies,
            layer,
            level,
            block,
            place: first_place(tree, layer, level),
            coefficients: Vec::new(),
            gain: Gain::default(),
        }
    }

    fn node(&self, state: &mut ChosenBlock, node: &IntraNode) -> Option<[[i16; 3]; DIFFERENCES]> {
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
        let (levels, gain) = state.quantizer.node(&context, node.children, node.weights, &wanted)?;
        state.gain.error += gain.error;
        state.gain.bits += gain.bits;
        push(&mut state.coefficients, place, node.children, &levels);
        state.energies.set(node.place, node_energy(&levels));
        Some(levels)
    }

    fn end(&mut self, layer: u8, _level: usize, blocks: Vec<(usize, ChosenBlock)>) {
        for (block, state) in blocks {
            debug_assert_eq!(state.layer, layer);
            self.coefficients[block][usize::from(layer)].extend(state.coefficients);
            self.energies[block] = state.energies;
        }
    }
}

/// Writes the symbols of a frame: its modes, and each layer of its coefficients.
fn write(
    entropy: &mut ColourSlices,
    shape: &ColourShape,
    symbols: &ColourSymbols,
    causal: &CausalBlocks,
    before: &[Option<BlockBefore>],
    predicts: bool,
    layers: u8,
) -> (Vec<u8>, Vec<Vec<u8>>) {
    let range = 0..symbols.modes.len();
    let models = &mut entropy.slices(1)[0];
    let blocks = ModeBlocks { range: range.clone(), causal, before, predicts, max_depth: layers - 1 };
    let modes = syntax::modes::write(&mut models.modes, &blocks, &symbols.modes, &symbols.depths);
    let mut energies = FrameEnergies::new(symbols.modes.len());
    let mut blocks =
        LayerBlocks { shape, range, modes: &symbols.modes, causal, before, energies: &mut energies };
    let layers = (0..layers).map(|layer| {
        let coefficients = &symbols.layers[usize::from(layer)];
        syntax::coefficients::write(&mut models.coefficients, layer, &mut blocks, coefficients)
    });
    (modes, layers.collect())
}
