//! Quantized coefficients of colour, layer by layer and block by block: which nodes have any, and what they are.

use super::modes::BlockBefore;
use crate::colour::frame::ColourShape;
use crate::colour::morton::{interleave, wide_position};
use crate::colour::symbols::{Coefficient, LayerCoefficients};
use crate::colour::transform::{MAX_LEVEL, differences};
use crate::colour::tree::BlockTree;
use crate::main::{BlockMode, CausalBlocks};
use crate::shared::syntax::SyntaxError;
use isv_entropy::{BitModel, RangeDecoder};
use std::ops::Range;

/// Levels whose nodes have coefficients, and one for the mean of a block.
const LEVELS: usize = 6;
/// The one for the mean of a block.
pub const ROOT_LEVEL: usize = 5;
/// Blocks are predicted from the same frame or from the one before.
const KINDS: usize = 2;
/// Classes of energies.
const ENERGIES: usize = 5;
/// Magnitudes in unary; what is beyond is an Exp-Golomb code of order 0.
pub const UNARY_MAGNITUDES: i32 = 14;
/// Longest prefix of such a code that any magnitude has.
pub const MAX_PREFIX: u32 = 16;
/// Largest energy that is told apart.
const MAX_ENERGY: u8 = 6;

/// Models of the coefficients of a slice.
#[derive(Clone, Debug)]
pub struct CoefficientModels {
    coded: Vec<BitModel>,
    coded_by_before: Vec<BitModel>,
    node_by_parent: Vec<BitModel>,
    node_by_neighbours: Vec<BitModel>,
    luma_by_stage: Vec<BitModel>,
    luma_by_parent: Vec<BitModel>,
    chroma: Vec<BitModel>,
    chroma_by_energy: Vec<BitModel>,
    magnitude: Vec<BitModel>,
    magnitude_by_energy: Vec<BitModel>,
}

impl Default for CoefficientModels {
    fn default() -> Self {
        let models = |count: usize| vec![BitModel::default(); count];
        Self {
            coded: models(3 * KINDS * 4 * 4),
            coded_by_before: models(3 * KINDS * 3),
            node_by_parent: models(LEVELS * KINDS * ENERGIES * 4),
            node_by_neighbours: models(LEVELS * KINDS * ENERGIES * ENERGIES),
            luma_by_stage: models(LEVELS * KINDS * 3 * 4),
            luma_by_parent: models(LEVELS * KINDS * ENERGIES * 4),
            chroma: models(2 * LEVELS * KINDS * 3 * 3),
            chroma_by_energy: models(2 * LEVELS * KINDS * ENERGIES * 3),
            magnitude: models(2 * LEVELS * KINDS * UNARY_MAGNITUDES as usize),
            magnitude_by_energy: models(2 * KINDS * ENERGIES * UNARY_MAGNITUDES as usize),
        }
    }
}

/// Class of an energy.
fn class(energy: u32) -> usize {
    [0, 1, 2, 3, 3, 4][(energy as usize).min(5)]
}

/// Context of a node's coefficients.
#[derive(Clone, Copy, Debug)]
pub struct NodeContext {
    /// Level of the node, or [`ROOT_LEVEL`].
    pub level: usize,
    /// 0 in intra blocks, 1 in inter blocks.
    pub kind: usize,
    /// Class of the energy of its parent.
    pub parent: usize,
    /// Class of the energies of the nodes next to it that precede it.
    pub neighbours: usize,
    /// How many coefficients it has.
    pub count: usize,
}

/// Context of the flag that a layer of a block has coefficients.
#[derive(Clone, Copy, Debug)]
pub struct BlockContext {
    /// The layer.
    pub layer: u8,
    /// 0 in intra blocks, 1 in inter blocks.
    pub kind: usize,
    /// Numbers of preceding neighbours, up to 3, and of those with coefficients in the layer.
    pub around: (usize, usize),
    /// Class of the layer in the frame before: 0 no such block, 1 without coefficients, 2 with some.
    pub before: usize,
}

impl CoefficientModels {
    /// Models of whether a layer of a block has any coefficients.
    pub fn coded(&mut self, context: &BlockContext) -> [&mut BitModel; 2] {
        let row = usize::from(context.layer) * KINDS + context.kind;
        let (known, coded) = context.around;
        [&mut self.coded[(row * 4 + known) * 4 + coded], &mut self.coded_by_before[row * 3 + context.before]]
    }

    /// Models of whether a node has any coefficients.
    pub fn node(&mut self, context: &NodeContext) -> [&mut BitModel; 2] {
        let row = context.level * KINDS + context.kind;
        let count = context.count.div_ceil(2).min(4) - 1;
        [
            &mut self.node_by_parent[(row * ENERGIES + context.parent) * 4 + count],
            &mut self.node_by_neighbours[(row * ENERGIES + context.neighbours) * ENERGIES + context.parent],
        ]
    }

    /// Models of whether the luma of a difference is not zero. `energy`: of the node's differences before it.
    pub fn luma(&mut self, context: &NodeContext, difference: usize, energy: u32) -> [&mut BitModel; 2] {
        let row = context.level * KINDS + context.kind;
        let stage = [0, 1, 1, 2, 2, 2, 2][difference];
        let energy = (energy as usize).min(3);
        [
            &mut self.luma_by_stage[(row * 3 + stage) * 4 + energy],
            &mut self.luma_by_parent[(row * ENERGIES + context.parent.max(context.neighbours)) * 4 + energy],
        ]
    }

    /// Models of whether a colour difference is not zero. `channel`: 1 or 2. `others`: levels of the channels before it.
    pub fn chroma(
        &mut self,
        context: &NodeContext,
        channel: usize,
        others: [i32; 2],
        energy: u32,
    ) -> [&mut BitModel; 2] {
        let row = ((channel - 1) * LEVELS + context.level) * KINDS + context.kind;
        let [luma, chroma] = others.map(|level| level.unsigned_abs().min(2) as usize);
        [
            &mut self.chroma[(row * 3 + luma) * 3 + chroma],
            &mut self.chroma_by_energy[(row * ENERGIES + class(energy)) * 3 + luma],
        ]
    }

    /// Models of whether a magnitude is more than `magnitude`, given that it is as much: 1 to [`UNARY_MAGNITUDES`].
    pub fn magnitude(
        &mut self,
        context: &NodeContext,
        channel: usize,
        magnitude: i32,
        energy: u32,
    ) -> [&mut BitModel; 2] {
        let chroma = usize::from(channel > 0);
        let row = (chroma * LEVELS + context.level) * KINDS + context.kind;
        let by_energy = (chroma * KINDS + context.kind) * ENERGIES + class(energy + context.parent as u32);
        let unary = UNARY_MAGNITUDES as usize;
        let place = magnitude as usize - 1;
        [&mut self.magnitude[row * unary + place], &mut self.magnitude_by_energy[by_energy * unary + place]]
    }

    /// Reads a layer of a slice's blocks.
    ///
    /// # Errors
    /// Bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        layer: u8,
        blocks: &mut LayerBlocks,
    ) -> Result<LayerCoefficients, SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        let mut out = LayerCoefficients::default();
        let mut tree = BlockTree::default();
        let mut found = Vec::new();
        for block in blocks.range.clone() {
            found.clear();
            if layer <= blocks.shape.depths()[block]
                && decoder.decode_mixed(self.coded(&blocks.context(block, layer)))
            {
                blocks.shape.build_tree(block, &mut tree);
                let mut energies = blocks.energies.begin(block, layer);
                self.read_block(
                    &mut decoder,
                    &tree,
                    layer,
                    kind(blocks.modes[block]),
                    &mut energies,
                    &mut found,
                );
                blocks.energies.end(block, layer, &energies);
                blocks.energies.coded[usize::from(layer)][block] = true;
            }
            out.push_block(found.iter().copied());
            if decoder.overran() {
                return Err(SyntaxError("the colour coefficients end too early"));
            }
        }
        Ok(out)
    }

    fn read_block(
        &mut self,
        decoder: &mut RangeDecoder,
        tree: &BlockTree,
        layer: u8,
        kind: usize,
        energies: &mut NodeEnergies,
        out: &mut Vec<Coefficient>,
    ) {
        let mut place = 0;
        if layer == 0 {
            let context = NodeContext { level: ROOT_LEVEL, kind, parent: 0, neighbours: 0, count: 1 };
            if decoder.decode_mixed(self.node(&context)) {
                let levels = self.read_levels(decoder, &context, 0, 0, true);
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
                if !decoder.decode_mixed(self.node(&context)) {
                    place += count as u32;
                    continue;
                }
                let mut so_far = 0;
                for (number, difference) in differences(*children).enumerate() {
                    let last = number + 1 == count && so_far == 0;
                    let levels = self.read_levels(decoder, &context, difference, so_far, last);
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

    /// Reads the levels of a difference. `some`: whether they cannot all be zero.
    fn read_levels(
        &mut self,
        decoder: &mut RangeDecoder,
        context: &NodeContext,
        difference: usize,
        so_far: u32,
        some: bool,
    ) -> [i32; 3] {
        let mut levels = [0; 3];
        for channel in 0..3 {
            let [luma, chroma, _] = levels;
            let is_set = match channel {
                0 => decoder.decode_mixed(self.luma(context, difference, so_far)),
                2 if some && luma == 0 && chroma == 0 => true,
                _ => decoder.decode_mixed(self.chroma(context, channel, [luma, chroma], so_far)),
            };
            if is_set {
                levels[channel] = self.read_level(decoder, context, channel, so_far);
            }
        }
        levels
    }

    /// Reads a level that is not zero.
    fn read_level(
        &mut self,
        decoder: &mut RangeDecoder,
        context: &NodeContext,
        channel: usize,
        so_far: u32,
    ) -> i32 {
        let mut magnitude = 1;
        while magnitude <= UNARY_MAGNITUDES
            && decoder.decode_mixed(self.magnitude(context, channel, magnitude, so_far))
        {
            magnitude += 1;
        }
        if magnitude > UNARY_MAGNITUDES {
            let prefix = (0..MAX_PREFIX).take_while(|_| decoder.decode_raw(1) != 0).count() as u32;
            let rest = (1 << prefix) - 1 + decoder.decode_raw(prefix) as i32;
            magnitude = (magnitude + rest).min(MAX_LEVEL - 1);
        }
        if decoder.decode_raw(1) != 0 { -magnitude } else { magnitude }
    }
}

/// 0 for an intra block, 1 for an inter block.
#[must_use]
pub fn kind(mode: BlockMode) -> usize {
    usize::from(mode.vector().is_some())
}

/// The energy of a coefficient, as contexts see it.
#[must_use]
pub fn energy([luma, cb, cr]: [i32; 3]) -> u32 {
    (2 * luma.unsigned_abs() + cb.unsigned_abs() + cr.unsigned_abs()).min(3)
}

/// The blocks of a slice as the syntax of coefficients sees them.
#[derive(Debug)]
pub struct LayerBlocks<'a> {
    /// The frame's blocks.
    pub shape: &'a ColourShape,
    /// Blocks of the slice.
    pub range: Range<usize>,
    /// Modes of all blocks.
    pub modes: &'a [BlockMode],
    /// Which of the blocks around a block precede it in its slice.
    pub causal: &'a CausalBlocks,
    /// All blocks of the frame as they were in the frame before.
    pub before: &'a [Option<BlockBefore>],
    /// Energies of what was coded so far.
    pub energies: &'a mut FrameEnergies,
}

/// Blocks around a block that tell whether it has coefficients.
const CODED_NEIGHBOURS: usize = 3;

impl LayerBlocks<'_> {
    /// The context of a layer of a block.
    #[must_use]
    pub fn context(&self, block: usize, layer: u8) -> BlockContext {
        let layer_coded = &self.energies.coded[usize::from(layer)];
        let neighbours = self.causal.merge_neighbours(block).take(CODED_NEIGHBOURS);
        let around =
            neighbours.fold((0, 0), |(known, coded), n| (known + 1, coded + usize::from(layer_coded[n])));
        let before = self.before[block].map_or(0, |before| 1 + usize::from(before.coded[usize::from(layer)]));
        BlockContext { layer, kind: kind(self.modes[block]), around, before }
    }
}

/// Energies of a frame's nodes that the contexts of deeper layers need, and which layers of blocks have coefficients.
#[derive(Clone, Debug, Default)]
pub struct FrameEnergies {
    /// Whether each layer of each block has coefficients.
    pub coded: [Vec<bool>; 3],
    /// Energies of the lowest nodes of the layers above: 64 of each block for layer 1.
    cubes: Vec<[u8; 64]>,
    /// 512 of each block for layer 2.
    cells: Vec<Option<Box<[u8; 512]>>>,
}

impl FrameEnergies {
    /// Energies of so many blocks, of which none is coded.
    #[must_use]
    pub fn new(blocks: usize) -> Self {
        Self {
            coded: [0; 3].map(|_| vec![false; blocks]),
            cubes: vec![[0; 64]; blocks],
            cells: vec![None; blocks],
        }
    }

    /// Energies around a layer of a block, when its coding begins.
    #[must_use]
    pub fn begin(&self, block: usize, layer: u8) -> NodeEnergies {
        let mut energies = NodeEnergies::default();
        match layer {
            0 => {}
            1 => energies.above[..64].copy_from_slice(&self.cubes[block]),
            _ => {
                if let Some(cells) = &self.cells[block] {
                    energies.above = **cells;
                }
            }
        }
        energies
    }

    /// Keeps the energies of a layer of a block.
    pub fn end(&mut self, block: usize, layer: u8, energies: &NodeEnergies) {
        match layer {
            0 => self.cubes[block].copy_from_slice(&energies.here[..64]),
            1 => self.cells[block] = energies.here[..512].try_into().ok().map(Box::new),
            _ => {}
        }
    }
}

/// Energies of the nodes of a block: those of one level, by place, and of the level above.
#[derive(Clone, Debug)]
pub struct NodeEnergies {
    /// Energy of the block's mean.
    pub root: u32,
    above: [u8; 512],
    here: Vec<u8>,
    begun: bool,
}

impl Default for NodeEnergies {
    fn default() -> Self {
        Self { root: 0, above: [0; 512], here: vec![0; 512], begun: false }
    }
}

impl NodeEnergies {
    /// Goes on to the next level: what was coded last lies above it.
    pub fn begin_level(&mut self) {
        if self.begun {
            self.above.copy_from_slice(&self.here[..512]);
        }
        self.begun = true;
        self.here.clear();
        self.here.resize(4096, 0);
    }

    /// Classes of the energy of a node's parent, and of the nodes before it along each axis.
    #[must_use]
    pub fn around(&self, level: usize, place: usize) -> (usize, usize) {
        let parent = if level == 0 { self.root } else { u32::from(self.above[place >> 3]) };
        let at = wide_position(place);
        let neighbours: u32 = (0..3)
            .filter(|axis| at[*axis] > 0)
            .map(|axis| {
                let mut next = at;
                next[axis] -= 1;
                u32::from(self.here[interleave(next)])
            })
            .sum();
        (class(parent), class(neighbours))
    }

    /// Enters the energy of a node.
    pub fn set(&mut self, place: usize, energy: u32) {
        self.here[place] = energy.min(u32::from(MAX_ENERGY)) as u8;
    }
}
