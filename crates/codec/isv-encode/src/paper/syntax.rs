//! The writing side of the entropy-coded syntax of profile `paper`: each file mirrors the one of the same name in `isv-decode`.
//! Public for `isv-baseline`, whose codecs differ from isv in the transform and not in the syntax.

mod coefficients;
mod motion;

use crate::shared::syntax::{SliceSegments, SymbolSegments, block_set, masks};
use isv_decode::ReferenceBlocks;
use isv_decode::paper::FrameSymbols;
use isv_decode::paper::syntax::{CausalNeighbours, EntropyState};
use isv_format::SliceLayout;
use isv_volume::BlockEdge;
use rayon::prelude::*;

/// The mirror image of the decoder's `read_symbols`: writes the symbols of a frame in this many slices, and has the models
/// learn from them. `reference`: the blocks of the frame before, unless this is a keyframe.
#[must_use]
pub fn write_symbols(
    entropy: &mut EntropyState,
    edge: BlockEdge,
    symbols: &FrameSymbols,
    slices: usize,
    reference: Option<ReferenceBlocks>,
) -> SymbolSegments {
    let coords = &symbols.coords;
    let block_set = block_set::write(&mut entropy.block_set, coords, reference);
    let masks = masks::write(&mut entropy.masks, edge, coords, &symbols.unobserved, reference);
    let neighbours = CausalNeighbours::new(coords, symbols.prediction.has_motion());
    let layout = SliceLayout::new(coords.len(), slices);
    let coefficients = if coords.is_empty() { 0 } else { symbols.levels.len() / coords.len() };
    let slices = entropy.slices(slices);
    let slices = slices
        .par_iter_mut()
        .zip(layout.ranges().collect::<Vec<_>>())
        .map(|(models, range)| {
            let sources = &symbols.references[range.clone()];
            let vectors = &symbols.motion[range.clone()];
            let levels = &symbols.levels[range.start * coefficients..range.end * coefficients];
            let modes =
                motion::write(&mut models.motion, symbols.prediction, &range, sources, vectors, &neighbours);
            let (coefficients, dc_bits) = coefficients::write(&mut models.coefficients, sources, levels);
            SliceSegments { modes, coefficients, dc_bits }
        })
        .collect();
    SymbolSegments { block_set, masks, slices }
}
