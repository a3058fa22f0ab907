//! Symbols to samples: what the encoder and every decoder do alike.

use super::compensation::{MotionField, predict_block, vectors_around};
use super::frame::{ColourFrame, ColourShape, Sample, clamped, mean, rounded};
use super::reader::Reader;
use super::symbols::{Coefficient, ColourSymbols};
use super::transform::{
    DIFFERENCES, add_difference, by_slot, dequantized, dequantized_mean, differences, side_weights,
};
use super::tree::{BlockTree, TreeLevel, UPPER_LEVELS};
use super::upsampling::{LevelMeans, ParentWindow, predict_root};
use crate::main::BlockMode;
use isv_format::ColourKind;
use isv_kernels::simd::vectorized;
use isv_volume::{NeighbourFinder, Neighbourhood};
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 32;

/// Quantizer steps of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourSteps {
    /// Step of luma, in 1/16 of an 8-bit step.
    pub luma: u32,
    /// Step of both colour differences, in the same unit.
    pub chroma: u32,
}

impl ColourSteps {
    /// The finest steps.
    pub const FINEST: Self = Self { luma: 1, chroma: 1 };

    /// Step of a channel.
    #[must_use]
    #[inline(always)]
    pub fn channel(&self, channel: usize) -> u32 {
        if channel == 0 { self.luma } else { self.chroma }
    }
}

/// Coefficients of a block in order, those that are zero too.
#[derive(Debug)]
struct Cursor<'a> {
    rest: &'a [Coefficient],
    place: u32,
}

impl<'a> Cursor<'a> {
    fn new(coefficients: &'a [Coefficient], place: u32) -> Self {
        let before = coefficients.partition_point(|c| c.place < place);
        Self { rest: &coefficients[before..], place }
    }

    /// The levels at the next place, unless all are zero.
    #[inline(always)]
    fn next(&mut self) -> Option<[i16; 3]> {
        let place = self.place;
        self.place += 1;
        let (first, rest) = self.rest.split_first().filter(|(first, _)| first.place == place)?;
        self.rest = rest;
        Some(first.levels)
    }

    /// The levels of the next node, by difference; `None` if all are zero.
    #[inline(always)]
    fn node(&mut self, children: u8) -> Option<[[i16; 3]; DIFFERENCES]> {
        let end = self.place + children.count_ones() - 1;
        if self.rest.first().is_none_or(|first| first.place >= end) {
            self.place = end;
            return None;
        }
        let mut levels = [[0; 3]; DIFFERENCES];
        for difference in differences(children) {
            levels[difference] = self.next().unwrap_or_default();
        }
        Some(levels)
    }
}

/// Adds the differences of a node to the values of its children.
#[inline(always)]
pub fn add_differences(
    values: &mut [[i32; 3]; 8],
    children: u8,
    weights: &[u32; 8],
    levels: &[[i16; 3]; DIFFERENCES],
    steps: &ColourSteps,
) {
    for difference in differences(children).filter(|difference| levels[*difference] != [0; 3]) {
        let sides = side_weights(weights, difference);
        let by = [0, 1, 2].map(|c| dequantized(i32::from(levels[difference][c]), steps.channel(c), sides));
        add_difference(values, difference, by, sides);
    }
}

/// Change of a block's mean, from its levels.
fn mean_change(weight: u32, levels: [i16; 3], steps: &ColourSteps) -> [i32; 3] {
    [0, 1, 2].map(|c| dequantized_mean(i32::from(levels[c]), steps.channel(c), weight))
}

/// The residual at each leaf of a tree, from the coefficients of its layers; nothing if all are zero.
#[must_use]
pub fn residual(tree: &BlockTree, layers: [&[Coefficient]; 3], steps: &ColourSteps) -> Option<Vec<[i32; 3]>> {
    let depth = tree.depth();
    if layers[..=usize::from(depth)].iter().all(|layer| layer.is_empty()) {
        return None;
    }
    let mut cursor = Cursor::new(layers[0], 0);
    let root = tree.levels()[0].weights[0];
    let mut values = vec![mean_change(root, cursor.next().unwrap_or_default(), steps)];
    for layer in 0..=depth {
        if layer > 0 {
            cursor = Cursor::new(layers[usize::from(layer)], 0);
        }
        for level in BlockTree::layer_levels(layer) {
            let [nodes, below] = [0, 1].map(|step| &tree.levels()[level + step]);
            let mut next = Vec::with_capacity(below.places.len());
            let mut weights = &below.weights[..];
            for (children, value) in nodes.children.iter().zip(&values) {
                let (own, rest) = weights.split_at(children.count_ones() as usize);
                weights = rest;
                let mut of_children = [*value; 8];
                if let Some(levels) = cursor.node(*children) {
                    add_differences(&mut of_children, *children, &by_slot(*children, own), &levels, steps);
                }
                next.extend((0..8).filter(|slot| children >> slot & 1 != 0).map(|slot| of_children[slot]));
            }
            values = next;
        }
    }
    Some(values)
}

/// The samples of a block in each layer, to be written.
#[derive(Debug)]
pub struct BlockLayers<'a>([&'a mut [Sample]; 3]);

/// Splits the layers of a frame into those of its blocks.
fn block_layers<'a>(shape: &ColourShape, layers: &'a mut [Vec<Sample>; 3]) -> Vec<BlockLayers<'a>> {
    let mut rest = layers.each_mut().map(Vec::as_mut_slice);
    let blocks = 0..shape.depths().len();
    let of_block = |block: usize| {
        let mut layer = 0;
        BlockLayers(rest.each_mut().map(|rest| {
            let samples = rest.split_off_mut(..shape.block_samples(block, layer).len());
            layer += 1;
            samples.expect("as many as were counted")
        }))
    };
    blocks.map(of_block).collect()
}

impl BlockLayers<'_> {
    /// Writes the samples of a block's deepest layer, and their means into the layers above.
    fn put(&mut self, depth: u8, leaves: &[Sample]) {
        let depth = usize::from(depth);
        self.0[depth].copy_from_slice(leaves);
        let [voxels, halves, quarters] = &mut self.0;
        match depth {
            0 => {}
            1 => {
                vectorized(
                    #[inline(always)]
                    || put_means(voxels, halves),
                );
            }
            _ => {
                let mut counts = vec![0; halves.len()];
                for ((half, count), quarters) in
                    halves.iter_mut().zip(&mut counts).zip(quarters.as_chunks::<8>().0)
                {
                    *half = mean_of(quarters, |quarter| i32::from(quarter[3]));
                    *count = quarters.iter().map(|quarter| i32::from(quarter[3])).sum();
                }
                let below = halves.as_chunks::<8>().0.iter().zip(counts.as_chunks::<8>().0);
                for (voxel, (halves, counts)) in voxels.iter_mut().zip(below) {
                    let mut counts = counts.iter();
                    *voxel = mean_of(halves, |_| *counts.next().expect("a count for each half"));
                }
            }
        }
    }
}

/// Writes the mean of each voxel's half cells.
#[inline(always)]
fn put_means(voxels: &mut [Sample], halves: &[Sample]) {
    for (voxel, halves) in voxels.iter_mut().zip(halves.as_chunks::<8>().0) {
        // All values are 0 where there is no sample.
        let mut sums = [0; 4];
        for half in halves {
            for lane in 0..4 {
                sums[lane] += i32::from(half[lane]);
            }
        }
        *voxel = mean(sums);
    }
}

/// The mean of samples by their weights; none if all are 0.
#[inline(always)]
fn mean_of(samples: &[Sample; 8], mut weight: impl FnMut(&Sample) -> i32) -> Sample {
    let (mut sums, mut all) = ([0i32; 3], 0);
    for sample in samples {
        let weight = weight(sample);
        all += weight;
        (0..3).for_each(|c| sums[c] += weight * i32::from(sample[c]));
    }
    if all == 0 { [0; 4] } else { clamped(sums.map(|sum| rounded(sum, all))) }
}

/// Decodes a frame from its symbols. `shape` has the depths of these. `before`: the frame before, which frames of kind
/// [`ColourKind::Intra`] do not look at.
#[must_use]
pub fn reconstruct(
    kind: ColourKind,
    shape: ColourShape,
    symbols: &ColourSymbols,
    steps: &ColourSteps,
    before: &ColourFrame,
) -> ColourFrame {
    let mut layers = shape.layers();
    if kind.predicts() {
        reconstruct_inter(&shape, &mut layers, &symbols.modes, steps, before, &ReadLevels(symbols));
    }
    if symbols.modes.contains(&BlockMode::Spatial) {
        reconstruct_intra(kind, &shape, &mut layers, &symbols.modes, steps, &mut ReadLevels(symbols));
    }
    ColourFrame { shape, layers }
}

/// Source of the levels of inter blocks: the decoder reads them, the encoder chooses them from the prediction.
pub trait InterLevels: Sync {
    /// State of a thread.
    type Worker;

    /// Creates the state of a thread.
    fn worker(&self) -> Self::Worker;

    /// The coefficients of each layer of a block. `predicted`: samples of its deepest layer, by slot.
    fn levels(&self, worker: &mut Self::Worker, block: usize, predicted: &[Sample]) -> [&[Coefficient]; 3];
}

impl InterLevels for ReadLevels<'_> {
    type Worker = ();

    fn worker(&self) {}

    fn levels(&self, (): &mut (), block: usize, _predicted: &[Sample]) -> [&[Coefficient]; 3] {
        [0, 1, 2].map(|layer| self.0.layers[layer].of_block(block))
    }
}

/// Writes the samples of all blocks that are predicted from the frame before.
pub fn reconstruct_inter<L: InterLevels>(
    shape: &ColourShape,
    layers: &mut [Vec<Sample>; 3],
    modes: &[BlockMode],
    steps: &ColourSteps,
    before: &ColourFrame,
    source: &L,
) {
    let mut layers = block_layers(shape, layers);
    layers.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, layers)| {
        let mut predictor = InterPredictor::new(shape, modes, before);
        let (mut worker, mut tree) = (source.worker(), BlockTree::default());
        for (block, layers) in (chunk * CHUNK..).zip(layers) {
            if modes[block] == BlockMode::Spatial {
                continue;
            }
            let predicted = predictor.predict(block);
            let coefficients = source.levels(&mut worker, block, predicted);
            if coefficients.iter().any(|layer| !layer.is_empty()) {
                shape.build_tree(block, &mut tree);
                add_residual(predicted, &tree, coefficients, steps);
            }
            layers.put(shape.depths()[block], predicted);
        }
    });
}

/// Adds the residual of a block to its prediction, within the range of samples.
fn add_residual(
    predicted: &mut [Sample],
    tree: &BlockTree,
    coefficients: [&[Coefficient]; 3],
    steps: &ColourSteps,
) {
    let Some(residual) = residual(tree, coefficients, steps) else { return };
    for (slot, by) in tree.leaf_slots().zip(residual) {
        let sample = &mut predicted[slot];
        *sample = clamped([0, 1, 2].map(|c| i32::from(sample[c]) + by[c]));
    }
}

/// Predicts blocks from the frame before.
#[derive(Debug)]
struct InterPredictor<'a> {
    shape: &'a ColourShape,
    modes: &'a [BlockMode],
    finder: NeighbourFinder<'a>,
    reader: Reader<'a>,
    predicted: Vec<Sample>,
}

impl<'a> InterPredictor<'a> {
    /// Creates a predictor. `modes`: of all blocks of the frame.
    fn new(shape: &'a ColourShape, modes: &'a [BlockMode], before: &'a ColourFrame) -> Self {
        let (finder, reader) = (NeighbourFinder::new(shape.cells().index()), Reader::new(before));
        Self { shape, modes, finder, reader, predicted: Vec::new() }
    }

    /// Predicts the samples of a block: those of its deepest layer, by slot.
    fn predict(&mut self, block: usize) -> &mut [Sample] {
        self.finder.turn_to(self.shape.cells().coords()[block]);
        let around = vectors_around(&self.finder, self.modes);
        let field = MotionField::new(&around);
        let (reader, shape, out) = (&mut self.reader, self.shape, &mut self.predicted);
        vectorized(
            #[inline(always)]
            || predict_block(reader, shape, block, &field, out),
        );
        &mut self.predicted
    }
}

/// Means of the nodes above the voxels' cells: of each block one, eight, 64.
type UpperMeans = [Vec<Sample>; UPPER_LEVELS];

/// Source of the levels of intra blocks: the decoder reads them, the encoder chooses them from the prediction.
pub trait IntraLevels: Sync {
    /// State of a thread.
    type Worker;
    /// State of one tree level of a block, kept from node to node.
    type Block: Send;

    /// Creates the state of a thread.
    fn worker(&self) -> Self::Worker;

    /// The levels of a block's mean. Called for one block after the other.
    fn root(&mut self, block: usize, weight: u32, predicted: [i32; 3]) -> [i16; 3];

    /// Begins a level of a block, in a layer.
    fn begin(&self, block: usize, tree: &BlockTree, layer: u8, level: usize) -> Self::Block;

    /// The levels of a node's differences; `None` if all are zero.
    fn node(
        &self,
        worker: &mut Self::Worker,
        block: &mut Self::Block,
        node: &IntraNode,
    ) -> Option<[[i16; 3]; DIFFERENCES]>;

    /// Takes the states of a tree level of all blocks, in block order.
    fn end(&mut self, layer: u8, level: usize, blocks: Vec<(usize, Self::Block)>);
}

/// A node of an intra block, whose children are predicted.
#[derive(Clone, Copy, Debug)]
pub struct IntraNode<'a> {
    /// Place of the node at its level.
    pub place: usize,
    /// Which children it has.
    pub children: u8,
    /// Their weights by slot.
    pub weights: &'a [u32; 8],
    /// The number of its first child among the nodes of the level below.
    pub first_child: usize,
    /// Their means as predicted, by slot.
    pub predicted: &'a [[i32; 3]; 8],
}

/// The levels that a frame's symbols have.
struct ReadLevels<'a>(&'a ColourSymbols);

impl<'a> IntraLevels for ReadLevels<'a> {
    type Worker = ();
    type Block = Cursor<'a>;

    fn worker(&self) {}

    fn root(&mut self, block: usize, _weight: u32, _predicted: [i32; 3]) -> [i16; 3] {
        Cursor::new(self.0.layers[0].of_block(block), 0).next().unwrap_or_default()
    }

    fn begin(&self, block: usize, tree: &BlockTree, layer: u8, level: usize) -> Cursor<'a> {
        Cursor::new(self.0.layers[usize::from(layer)].of_block(block), first_place(tree, layer, level))
    }

    fn node(
        &self,
        (): &mut (),
        cursor: &mut Cursor<'a>,
        node: &IntraNode,
    ) -> Option<[[i16; 3]; DIFFERENCES]> {
        cursor.node(node.children)
    }

    fn end(&mut self, _layer: u8, _level: usize, _blocks: Vec<(usize, Cursor<'a>)>) {}
}

/// Writes the samples of all blocks that are predicted from blocks of the same frame: level by level, from the blocks' means down.
/// `kind`: of the frame, which tells whether inter blocks are among these.
pub fn reconstruct_intra<L: IntraLevels>(
    kind: ColourKind,
    shape: &ColourShape,
    layers: &mut [Vec<Sample>; 3],
    modes: &[BlockMode],
    steps: &ColourSteps,
    source: &mut L,
) {
    let intra: Vec<usize> = (0..modes.len()).filter(|b| modes[*b] == BlockMode::Spatial).collect();
    let sources = IntraSources { modes, constrained: kind.constrains_intra() };
    let mut upper = upper_means(shape, &layers[0], &sources, &intra);
    put_roots(shape, &mut upper[0], &sources, steps, source);
    let deepest = shape.depths().iter().max().copied().unwrap_or(0);
    for layer in 0..=deepest {
        for level in BlockTree::layer_levels(layer) {
            let below = predict_level(shape, &upper, layers, steps, (layer, level), &intra, &sources, source);
            let out = if level + 1 < UPPER_LEVELS {
                &mut upper[level + 1]
            } else {
                &mut layers[usize::from(layer)]
            };
            let mut ended = Vec::with_capacity(below.len());
            for LevelBlock { block, start, samples, state } in below {
                out[start..][..samples.len()].copy_from_slice(&samples);
                ended.push((block, state));
            }
            source.end(layer, level, ended);
        }
    }
}

/// The blocks that intra blocks are predicted from.
#[derive(Clone, Copy, Debug)]
struct IntraSources<'a> {
    modes: &'a [BlockMode],
    /// Whether inter blocks are left out.
    constrained: bool,
}

impl IntraSources<'_> {
    fn is_intra(&self, block: usize) -> bool {
        self.modes[block] == BlockMode::Spatial
    }

    /// Whether a block counts.
    fn contains(&self, block: usize) -> bool {
        !self.constrained || self.is_intra(block)
    }

    /// The blocks around the one that a finder is turned to, of those that count.
    fn around(&self, finder: &NeighbourFinder) -> Neighbourhood {
        finder.neighbourhood().map(|block| block.filter(|block| self.contains(*block as usize)))
    }
}

/// The means above the cells of the inter blocks around intra blocks, if they count; zeros for all others.
fn upper_means(shape: &ColourShape, cells: &[Sample], sources: &IntraSources, intra: &[usize]) -> UpperMeans {
    let count = shape.depths().len();
    let mut upper = [1, 8, 64].map(|nodes| vec![[0; 4]; nodes * count]);
    let mut tree = BlockTree::default();
    let mut is_needed = vec![false; count];
    let mut finder = NeighbourFinder::new(shape.cells().index());
    for block in intra {
        finder.turn_to(shape.cells().coords()[*block]);
        sources.around(&finder).into_iter().flatten().for_each(|near| is_needed[near as usize] = true);
    }
    for block in (0..count).filter(|block| is_needed[*block] && !sources.is_intra(*block)) {
        shape.build_tree_to(block, UPPER_LEVELS, &mut tree);
        let mut values: Vec<Sample> = cells[shape.block_samples(block, 0)].to_vec();
        for level in (0..UPPER_LEVELS).rev() {
            let [nodes, below] = [0, 1].map(|step| &tree.levels()[level + step]);
            let (mut rest, mut weights) = (&values[..], &below.weights[..]);
            let mut means = Vec::with_capacity(nodes.places.len());
            for (place, children) in nodes.places.iter().zip(&nodes.children) {
                let count = children.count_ones() as usize;
                let mean = weighted_mean(&rest[..count], &weights[..count]);
                (rest, weights) = (&rest[count..], &weights[count..]);
                means.push(mean);
                upper[level][(block << (3 * level)) + usize::from(*place)] = mean;
            }
            values = means;
        }
    }
    upper
}

fn weighted_mean(samples: &[Sample], weights: &[u32]) -> Sample {
    let (mut sums, mut all) = ([0i64; 3], 0i64);
    for (sample, weight) in samples.iter().zip(weights) {
        all += i64::from(*weight);
        (0..3).for_each(|c| sums[c] += i64::from(*weight) * i64::from(sample[c]));
    }
    clamped(sums.map(|sum| (sum + all / 2).div_euclid(all) as i32))
}

/// Writes the means of intra blocks, one after the other: each is predicted from those that precede it and from inter blocks, if they
/// count.
fn put_roots<L: IntraLevels>(
    shape: &ColourShape,
    roots: &mut [Sample],
    sources: &IntraSources,
    steps: &ColourSteps,
    source: &mut L,
) {
    let mut finder = NeighbourFinder::new(shape.cells().index());
    let mut tree = BlockTree::default();
    for block in (0..roots.len()).filter(|block| sources.is_intra(*block)) {
        finder.turn_to(shape.cells().coords()[block]);
        shape.build_tree_to(block, UPPER_LEVELS, &mut tree);
        let predicted = predicted_root(&finder, block, sources, |block| roots[block]);
        let weight = tree.levels()[0].weights[0];
        let change = mean_change(weight, source.root(block, weight, predicted), steps);
        roots[block] = clamped([0, 1, 2].map(|c| predicted[c] + change[c]));
    }
}

/// The prediction of an intra block's mean, from blocks that precede it and from inter blocks, if they count.
fn predicted_root(
    finder: &NeighbourFinder,
    block: usize,
    sources: &IntraSources,
    root: impl Fn(usize) -> Sample,
) -> [i32; 3] {
    let known = |other: usize| other < block || !sources.is_intra(other);
    let around = sources.around(finder).into_iter().enumerate();
    predict_root(around.filter_map(|(slot, other)| {
        let other = other? as usize;
        (slot != 13 && known(other)).then(|| (slot, root(other)))
    }))
}

/// The means of the children of a level's nodes in an intra block.
struct LevelBlock<S> {
    block: usize,
    /// Start of the block's nodes in the level below.
    start: usize,
    samples: Vec<Sample>,
    state: S,
}

/// The means of the children of all nodes of a level in intra blocks.
#[expect(clippy::too_many_arguments, reason = "what is known above the level, and who chooses what is added")]
fn predict_level<L: IntraLevels>(
    shape: &ColourShape,
    upper: &UpperMeans,
    layers: &[Vec<Sample>; 3],
    steps: &ColourSteps,
    (layer, level): (u8, usize),
    intra: &[usize],
    sources: &IntraSources,
    source: &L,
) -> Vec<LevelBlock<L::Block>> {
    let level_means = LevelMeans {
        level,
        cells: shape.cells(),
        depths: shape.depths(),
        means: if level < UPPER_LEVELS { &upper[level] } else { &layers[level - UPPER_LEVELS] },
        shallow: &layers[0],
        starts: shape.starts(),
    };
    // Above the cells every place has a mean.
    let upper_count = (level + 1 < UPPER_LEVELS).then(|| 1 << (3 * (level + 1)));
    let of_chunk = |chunk: &[usize]| {
        let mut finder = NeighbourFinder::new(shape.cells().index());
        let (mut window, mut tree) = (ParentWindow::default(), BlockTree::default());
        let (mut worker, mut out, mut predicted) = (source.worker(), Vec::new(), Vec::new());
        for block in chunk.iter().copied().filter(|block| layer <= shape.depths()[*block]) {
            finder.turn_to(shape.cells().coords()[block]);
            window.gather(&level_means, &sources.around(&finder));
            shape.build_tree_to(block, level + 1, &mut tree);
            let mut state = source.begin(block, &tree, layer, level);
            let [nodes, below] = [0, 1].map(|step| &tree.levels()[level + step]);
            let (start, count) = match upper_count {
                Some(count) => (block * count, count),
                None => (shape.block_samples(block, layer).start, shape.block_samples(block, layer).len()),
            };
            let mut samples = vec![[0; 4]; count];
            let mut slots = tree.slots(layer);
            let mut first_child = 0;
            predict_nodes(&window, nodes, below, &mut predicted);
            let predicted = predicted.iter_mut();
            for ((place, children), (weights, values)) in
                nodes.places.iter().zip(&nodes.children).zip(predicted)
            {
                let place = usize::from(*place);
                let node = IntraNode { place, children: *children, weights, first_child, predicted: values };
                if let Some(levels) = source.node(&mut worker, &mut state, &node) {
                    add_differences(values, *children, weights, &levels, steps);
                }
                first_child += children.count_ones() as usize;
                for child in (0..8).filter(|child| children >> child & 1 != 0) {
                    let slot = match upper_count {
                        Some(_) => place << 3 | child,
                        None => slots.next().expect("a slot for each child"),
                    };
                    samples[slot] = clamped(values[child]);
                }
            }
            out.push(LevelBlock { block, start, samples, state });
        }
        out
    };
    intra.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
}

/// Predicts the children of all nodes of a block's level: their weights and means, by slot.
fn predict_nodes(
    window: &ParentWindow,
    nodes: &TreeLevel,
    below: &TreeLevel,
    out: &mut Vec<([u32; 8], [[i32; 3]; 8])>,
) {
    out.clear();
    vectorized(
        #[inline(always)]
        || {
            let mut first_child = 0;
            for (place, children) in nodes.places.iter().zip(&nodes.children) {
                let weights = by_slot(*children, &below.weights[first_child..]);
                first_child += children.count_ones() as usize;
                out.push((weights, predicted_children(window, usize::from(*place), *children, &weights)));
            }
        },
    );
}

/// The children of a node as predicted from the nodes around it, moved so that their weighted mean is the node's.
#[inline(always)]
fn predicted_children(
    window: &ParentWindow,
    place: usize,
    children: u8,
    weights: &[u32; 8],
) -> [[i32; 3]; 8] {
    let mut values = [[0; 3]; 8];
    let mut sums = [0; 4];
    let mut rest = children;
    while rest != 0 {
        let child = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let predicted = window.predict(place << 3 | child);
        // A block's weights are 2^15 at most together.
        let weight = weights[child] as i32;
        for lane in 0..4 {
            sums[lane] += weight * i32::from(predicted[lane]);
        }
        for c in 0..3 {
            values[child][c] = i32::from(predicted[c]);
        }
    }
    let (own, mean) = (window.mean(place), mean(sums));
    for value in &mut values {
        for c in 0..3 {
            value[c] += i32::from(own[c]) - i32::from(mean[c]);
        }
    }
    values
}

/// The place in its layer of the first coefficient of a level.
#[must_use]
pub fn first_place(tree: &BlockTree, layer: u8, level: usize) -> u32 {
    let before = BlockTree::layer_levels(layer).start..level;
    let root = u32::from(layer == 0);
    root + before.map(|level| level_differences(tree, level)).sum::<u32>()
}

/// How many differences the nodes of a level have.
#[must_use]
pub fn level_differences(tree: &BlockTree, level: usize) -> u32 {
    let [nodes, below] = [0, 1].map(|step| tree.levels()[level + step].places.len() as u32);
    below - nodes
}
