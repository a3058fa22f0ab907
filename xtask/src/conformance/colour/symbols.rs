//! Colour parts of symbols that are drawn: modes, depths and levels that no encoder would choose among them.

use isv::raw::decode::colour::symbols::{Coefficient, ColourSymbols, LayerCoefficients};
use isv::raw::decode::colour::syntax::coefficients::{
    BlockContext, CoefficientModels, FrameEnergies, LayerBlocks, MAX_PREFIX, NodeContext, NodeEnergies,
    ROOT_LEVEL, UNARY_MAGNITUDES, energy, kind,
};
use isv::raw::decode::colour::syntax::modes::{BlockBefore, ColourModeModels, DepthContext, ModeBlocks};
use isv::raw::decode::colour::syntax::{ColourModels, ColourSlices};
use isv::raw::decode::colour::transform::differences;
use isv::raw::decode::colour::tree::BlockTree;
use isv::raw::decode::colour::{ColourCells, ColourShape};
use isv::raw::decode::main::syntax::modes::ModeContext;
use isv::raw::decode::main::{BlockMode, CausalBlocks, Vector};
use isv::raw::format::SliceLayout;
use isv::raw::volume::SparseVolume;
use isv_entropy::RangeEncoder;
use isv_testkit::Random;
use std::ops::Range;

/// Largest magnitude of a level.
pub(super) const LARGEST_LEVEL: i32 = (1 << 15) - 1;

/// Shares and sizes of the symbols that are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taste {
    /// Share of blocks that are spatial, where others may be.
    pub(super) spatial: f64,
    /// Share of new vectors among those of temporal blocks.
    pub(super) new: f64,
    /// Largest component of a new vector; negative if all components are as large, with random signs.
    pub(super) reach: i32,
    /// Shares of blocks that are at least one and two deep.
    pub(super) deep: [f64; 2],
    /// Share of layers and nodes that have levels.
    pub(super) coded: f64,
    /// Largest magnitude of a level; a third of them is as large.
    pub(super) magnitude: i32,
}

impl Taste {
    /// Symbols of all kinds, none of them large.
    pub(super) const MIXED: Self =
        Self { spatial: 0.3, new: 0.4, reach: 20, deep: [0.6, 0.6], coded: 0.4, magnitude: 4 };
}

/// The bytes of a part: modes by slice, coefficients by layer and slice.
#[derive(Clone, Debug, Default)]
pub(super) struct Segments {
    pub(super) modes: Vec<Vec<u8>>,
    pub(super) layers: Vec<Vec<Vec<u8>>>,
}

/// Frame that a part is written for.
pub(super) struct Frame<'a> {
    pub(super) volume: &'a SparseVolume,
    pub(super) layers: u8,
    pub(super) slices: u16,
    pub(super) predicts: bool,
    /// The blocks in the frame before, as far as symbols depend on it.
    pub(super) known: &'a dyn Fn(&ColourCells) -> Vec<Option<BlockBefore>>,
}

/// Draws the symbols of a frame and writes them.
pub(super) fn draw(
    random: &mut Random,
    taste: &Taste,
    entropy: &mut ColourSlices,
    frame: &Frame,
) -> (Segments, ColourSymbols, ColourShape) {
    let cells = ColourCells::new(frame.volume);
    let coords = cells.coords().to_vec();
    let layout = SliceLayout::new(coords.len(), usize::from(frame.slices));
    let ranges: Vec<Range<usize>> = layout.ranges().collect();
    let causal = CausalBlocks::new(&coords, ranges.iter().cloned());
    let before = (frame.known)(&cells);
    let mut pen = Pen { random, taste };
    let mut segments =
        Segments { layers: vec![Vec::new(); usize::from(frame.layers)], ..Segments::default() };
    let mut symbols = ColourSymbols::default();
    let models = entropy.slices(ranges.len());
    for (models, range) in models.iter_mut().zip(&ranges) {
        let blocks = ModeBlocks {
            range: range.clone(),
            causal: &causal,
            before: &before,
            predicts: frame.predicts,
            max_depth: frame.layers - 1,
        };
        segments.modes.push(pen.modes(&mut models.modes, &blocks, &mut symbols));
    }
    let shape = ColourShape::new(cells, symbols.depths.clone(), frame.volume);
    for (models, range) in models.iter_mut().zip(&ranges) {
        let mut energies = FrameEnergies::new(coords.len());
        let (modes, before, causal) = (&symbols.modes[..], &before[..], &causal);
        let range = range.clone();
        let mut blocks = LayerBlocks { shape: &shape, range, modes, causal, before, energies: &mut energies };
        for layer in 0..frame.layers {
            let bytes = pen.layer(models, layer, &mut blocks, &mut symbols.layers[usize::from(layer)]);
            segments.layers[usize::from(layer)].push(bytes);
        }
    }
    (segments, symbols, shape)
}

/// Draws symbols and writes them.
struct Pen<'a> {
    random: &'a mut Random,
    taste: &'a Taste,
}

impl Pen<'_> {
    fn is(&mut self, share: f64) -> bool {
        (self.random.signed() + 1.0) / 2.0 < share
    }

    fn component(&mut self) -> i16 {
        let reach = self.taste.reach;
        if reach < 0 {
            return if self.is(0.5) { reach as i16 } else { -reach as i16 };
        }
        (self.random.signed() * f64::from(reach)).round() as i16
    }

    fn modes(
        &mut self,
        models: &mut ColourModeModels,
        blocks: &ModeBlocks,
        symbols: &mut ColourSymbols,
    ) -> Vec<u8> {
        let mut encoder = RangeEncoder::new();
        for block in blocks.range.clone() {
            let mut mode = BlockMode::Spatial;
            if blocks.predicts {
                let before = blocks.before[block].map(|before| before.for_modes());
                let context = ModeContext::new(block, blocks.causal, |n| symbols.modes[n], before);
                mode = self.mode(models, &mut encoder, &context);
            }
            symbols.modes.push(mode);
            let context = DepthContext::new(block, blocks, |n| symbols.depths[n]);
            let mut depth = 0;
            while depth < blocks.max_depth {
                let deeper = self.is(self.taste.deep[usize::from(depth)]);
                encoder.encode_mixed(models.deeper(&context, depth), deeper);
                if !deeper {
                    break;
                }
                depth += 1;
            }
            symbols.depths.push(depth);
        }
        encoder.finish()
    }

    fn mode(
        &mut self,
        models: &mut ColourModeModels,
        encoder: &mut RangeEncoder,
        context: &ModeContext,
    ) -> BlockMode {
        let models = &mut models.modes;
        let spatial = self.is(self.taste.spatial);
        encoder.encode_mixed(models.spatial(context), spatial);
        if spatial {
            return BlockMode::Spatial;
        }
        let candidates = context.candidates.as_slice();
        let new = self.is(self.taste.new);
        encoder.encode_mixed(models.new_vector(context), new);
        if new {
            let vector = Vector([0; 3].map(|_| self.component()));
            for axis in 0..3 {
                let difference = i32::from(vector.0[axis]) - i32::from(candidates[0].0[axis]);
                models.component(axis, context).encode(encoder, difference);
            }
            return BlockMode::New { vector };
        }
        let mut candidate = 0;
        while candidate + 1 < candidates.len() {
            let taken = self.is(0.4);
            encoder.encode_mixed(models.merge(candidate, context), taken);
            if taken {
                break;
            }
            candidate += 1;
        }
        BlockMode::Merged { candidate: candidate as u8, vector: candidates[candidate] }
    }

    fn layer(
        &mut self,
        models: &mut ColourModels,
        layer: u8,
        blocks: &mut LayerBlocks,
        out: &mut LayerCoefficients,
    ) -> Vec<u8> {
        let models = &mut models.coefficients;
        let mut encoder = RangeEncoder::new();
        let mut tree = BlockTree::default();
        for block in blocks.range.clone() {
            let mut found = Vec::new();
            if layer <= blocks.shape.depths()[block] {
                let context: BlockContext = blocks.context(block, layer);
                let coded = self.is(self.taste.coded.sqrt());
                encoder.encode_mixed(models.coded(&context), coded);
                if coded {
                    blocks.shape.build_tree(block, &mut tree);
                    let mut energies = blocks.energies.begin(block, layer);
                    let kind = kind(blocks.modes[block]);
                    self.block(models, &mut encoder, &tree, (layer, kind), &mut energies, &mut found);
                    blocks.energies.end(block, layer, &energies);
                    blocks.energies.coded[usize::from(layer)][block] = true;
                }
            }
            out.push_block(found);
        }
        encoder.finish()
    }

    fn block(
        &mut self,
        models: &mut CoefficientModels,
        encoder: &mut RangeEncoder,
        tree: &BlockTree,
        (layer, kind): (u8, usize),
        energies: &mut NodeEnergies,
        out: &mut Vec<Coefficient>,
    ) {
        let mut place = 0;
        if layer == 0 {
            let context = NodeContext { level: ROOT_LEVEL, kind, parent: 0, neighbours: 0, count: 1 };
            let coded = self.is(self.taste.coded);
            encoder.encode_mixed(models.node(&context), coded);
            if coded {
                let levels = self.levels(models, encoder, &context, (0, 0), true);
                out.push(Coefficient { place, levels: levels.map(|level| level as i16) });
                energies.root = energy(levels);
            }
            place += 1;
        }
        for level in BlockTree::layer_levels(layer) {
            energies.begin_level();
            let nodes = &tree.levels()[level];
            for (node, children) in nodes.places.iter().zip(&nodes.children) {
                let count = children.count_ones() as usize - 1;
                if count == 0 {
                    continue;
                }
                let (parent, neighbours) = energies.around(level, usize::from(*node));
                let context = NodeContext { level, kind, parent, neighbours, count };
                let coded = self.is(self.taste.coded);
                encoder.encode_mixed(models.node(&context), coded);
                if !coded {
                    place += count as u32;
                    continue;
                }
                let mut so_far = 0;
                for (number, difference) in differences(*children).enumerate() {
                    let some = number + 1 == count && so_far == 0;
                    let levels = self.levels(models, encoder, &context, (difference, so_far), some);
                    if levels != [0; 3] {
                        out.push(Coefficient { place, levels: levels.map(|level| level as i16) });
                    }
                    so_far += energy(levels);
                    place += 1;
                }
                energies.set(usize::from(*node), so_far);
            }
        }
    }

    /// Draws and writes the levels of a difference, which is the last that can be set if `some`.
    fn levels(
        &mut self,
        models: &mut CoefficientModels,
        encoder: &mut RangeEncoder,
        context: &NodeContext,
        (difference, so_far): (usize, u32),
        some: bool,
    ) -> [i32; 3] {
        let mut levels = [0; 3];
        for channel in 0..3 {
            let [luma, chroma, _] = levels;
            let mut set = self.is(0.5);
            match channel {
                0 => encoder.encode_mixed(models.luma(context, difference, so_far), set),
                2 if some && luma == 0 && chroma == 0 => set = true,
                _ => encoder.encode_mixed(models.chroma(context, channel, [luma, chroma], so_far), set),
            }
            if set {
                let level = self.level();
                levels[channel] = level;
                for unary in 1..=UNARY_MAGNITUDES.min(level.abs()) {
                    encoder
                        .encode_mixed(models.magnitude(context, channel, unary, so_far), level.abs() > unary);
                }
                write_rest(encoder, level);
            }
        }
        levels
    }

    fn level(&mut self) -> i32 {
        let most = self.taste.magnitude;
        let magnitude =
            if self.is(0.3) { most } else { 1 + (self.random.signed().abs() * f64::from(most - 1)) as i32 };
        if self.is(0.5) { -magnitude } else { magnitude }
    }
}

/// Writes what its unary code leaves of a level, and its sign. The largest one is written as far more than it is, and clamped.
fn write_rest(encoder: &mut RangeEncoder, level: i32) {
    let rest = level.abs() - UNARY_MAGNITUDES;
    if level.abs() == LARGEST_LEVEL {
        (0..MAX_PREFIX).for_each(|_| encoder.encode_raw(1, 1));
        encoder.encode_raw((1 << MAX_PREFIX) - 1, MAX_PREFIX);
    } else if rest > 0 {
        let prefix = rest.ilog2();
        (0..prefix).for_each(|_| encoder.encode_raw(1, 1));
        encoder.encode_raw(0, 1);
        encoder.encode_raw((rest - (1 << prefix)) as u32, prefix);
    }
    encoder.encode_raw(u32::from(level < 0), 1);
}
