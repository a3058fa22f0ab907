//! Quantized coefficients of colour, layer by layer and block by block: which nodes have any, and what they are.

use isv_decode::colour::symbols::{Coefficient, LayerCoefficients};
use isv_decode::colour::syntax::coefficients::{
    CoefficientModels, LayerBlocks, MAX_PREFIX, NodeContext, NodeEnergies, ROOT_LEVEL, UNARY_MAGNITUDES,
    energy, kind,
};
use isv_decode::colour::transform::{DIFFERENCES, differences};
use isv_decode::colour::tree::BlockTree;
use isv_entropy::{DecisionSink, RangeEncoder};

/// Writes a layer of a slice's blocks.
pub(crate) fn write(
    models: &mut CoefficientModels,
    layer: u8,
    blocks: &mut LayerBlocks,
    coefficients: &LayerCoefficients,
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    let mut tree = BlockTree::default();
    for block in blocks.range.clone() {
        if layer > blocks.shape.depths()[block] {
            continue;
        }
        let of_block = coefficients.of_block(block);
        encoder.encode_mixed(models.coded(&blocks.context(block, layer)), !of_block.is_empty());
        if of_block.is_empty() {
            continue;
        }
        blocks.shape.build_tree(block, &mut tree);
        let mut energies = blocks.energies.begin(block, layer);
        write_block(models, &mut encoder, &tree, layer, kind(blocks.modes[block]), &mut energies, of_block);
        blocks.energies.end(block, layer, &energies);
        blocks.energies.coded[usize::from(layer)][block] = true;
    }
    encoder.finish()
}

fn write_block(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    tree: &BlockTree,
    layer: u8,
    kind: usize,
    energies: &mut NodeEnergies,
    coefficients: &[Coefficient],
) {
    let mut rest = coefficients.iter().peekable();
    let mut place = 0;
    let mut next = |count: u32| {
        let mut levels = [[0; 3]; DIFFERENCES];
        while let Some(coefficient) = rest.next_if(|c| c.place < place + count) {
            levels[(coefficient.place - place) as usize] = coefficient.levels;
        }
        place += count;
        levels
    };
    if layer == 0 {
        let levels = next(1)[0];
        write_root(models, sink, kind, levels);
        energies.root = energy(levels.map(i32::from));
    }
    for level in BlockTree::layer_levels(layer) {
        energies.begin_level();
        let nodes = &tree.levels()[level];
        for (node, children) in nodes.places.iter().zip(&nodes.children) {
            let count = children.count_ones() - 1;
            if count == 0 {
                continue;
            }
            let in_order = next(count);
            let mut levels = [[0; 3]; DIFFERENCES];
            differences(*children).zip(in_order).for_each(|(difference, own)| levels[difference] = own);
            let (parent, neighbours) = energies.around(level, usize::from(*node));
            let context = NodeContext { level, kind, parent, neighbours, count: count as usize };
            write_node(models, sink, &context, *children, &levels);
            energies.set(usize::from(*node), node_energy(&levels));
        }
    }
}

/// The energy of all differences of a node.
pub(crate) fn node_energy(levels: &[[i16; 3]; DIFFERENCES]) -> u32 {
    levels.iter().map(|levels| energy(levels.map(i32::from))).sum()
}

/// Writes the levels of a block's mean.
pub(crate) fn write_root(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    kind: usize,
    levels: [i16; 3],
) {
    let context = NodeContext { level: ROOT_LEVEL, kind, parent: 0, neighbours: 0, count: 1 };
    sink.put_mixed(models.node(&context), levels != [0; 3]);
    if levels != [0; 3] {
        write_levels(models, sink, &context, 0, 0, true, levels);
    }
}

/// Writes the levels of a node's differences.
pub(crate) fn write_node(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    context: &NodeContext,
    children: u8,
    levels: &[[i16; 3]; DIFFERENCES],
) {
    let is_coded = levels.iter().any(|levels| *levels != [0; 3]);
    sink.put_mixed(models.node(context), is_coded);
    if !is_coded {
        return;
    }
    let mut so_far = 0;
    for (number, difference) in differences(children).enumerate() {
        let last = number + 1 == context.count && so_far == 0;
        write_levels(models, sink, context, difference, so_far, last, levels[difference]);
        so_far += energy(levels[difference].map(i32::from));
    }
}

/// Writes the levels of a difference. `some`: whether they cannot all be zero.
fn write_levels(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    context: &NodeContext,
    difference: usize,
    so_far: u32,
    some: bool,
    levels: [i16; 3],
) {
    let levels = levels.map(i32::from);
    let [luma, chroma, _] = levels;
    for (channel, level) in levels.into_iter().enumerate() {
        match channel {
            0 => sink.put_mixed(models.luma(context, difference, so_far), level != 0),
            2 if some && luma == 0 && chroma == 0 => {}
            _ => {
                // What comes before a channel: both for the second, the luma alone for the first.
                let others = if channel == 1 { [luma, 0] } else { [luma, chroma] };
                sink.put_mixed(models.chroma(context, channel, others, so_far), level != 0);
            }
        }
        if level != 0 {
            write_level(models, sink, context, channel, so_far, level);
        }
    }
}

/// Writes a level that is not zero.
fn write_level(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    context: &NodeContext,
    channel: usize,
    so_far: u32,
    level: i32,
) {
    let magnitude = level.abs();
    for unary in 1..=UNARY_MAGNITUDES.min(magnitude) {
        sink.put_mixed(models.magnitude(context, channel, unary, so_far), magnitude > unary);
    }
    if magnitude > UNARY_MAGNITUDES {
        // An Exp-Golomb code of order 0.
        let rest = (magnitude - UNARY_MAGNITUDES) as u32;
        let prefix = rest.ilog2();
        debug_assert!(prefix < MAX_PREFIX);
        (0..prefix).for_each(|_| sink.put_raw(1, 1));
        sink.put_raw(0, 1);
        sink.put_raw(rest - (1 << prefix), prefix);
    }
    sink.put_raw(u32::from(level < 0), 1);
}
