//! How blocks are predicted, and vectors.

use isv_decode::main::BlockMode;
use isv_decode::main::syntax::modes::{MOST_CANDIDATES, ModeContext, ModeModels};
use isv_entropy::{BitCount, DecisionSink};

/// Writes the mode of a block. `step`: of new vectors, in quarter voxels.
pub(crate) fn write(
    models: &mut ModeModels,
    sink: &mut impl DecisionSink,
    context: &ModeContext,
    mode: BlockMode,
    step: i32,
) {
    sink.put_mixed(models.spatial(context), mode == BlockMode::Spatial);
    match mode {
        BlockMode::Spatial => {}
        BlockMode::New { vector } => {
            sink.put_mixed(models.new_vector(context), true);
            let first = context.candidates.as_slice()[0];
            for axis in 0..3 {
                let difference = i32::from(vector.0[axis]) - i32::from(first.0[axis]);
                debug_assert_eq!(difference % step, 0);
                models.component(axis, context).encode(sink, difference / step);
            }
        }
        BlockMode::Merged { candidate, .. } => {
            sink.put_mixed(models.new_vector(context), false);
            let last = context.candidates.len() - 1;
            for k in 0..last.min(usize::from(candidate) + 1) {
                sink.put_mixed(models.merge(k, context), k == usize::from(candidate));
            }
        }
    }
}

/// Bits that [`write`] would take for merging with each of the candidates.
pub(crate) fn merge_bits(models: &mut ModeModels, context: &ModeContext) -> [f32; MOST_CANDIDATES] {
    let mut before = BitCount::default();
    before.put_mixed(models.spatial(context), false);
    before.put_mixed(models.new_vector(context), false);
    let mut bits = [f32::INFINITY; MOST_CANDIDATES];
    let last = context.candidates.len() - 1;
    for (k, bits) in bits.iter_mut().enumerate().take(last) {
        let mut merged = before;
        merged.put_mixed(models.merge(k, context), true);
        before.put_mixed(models.merge(k, context), false);
        *bits = merged.0;
    }
    bits[last] = before.0;
    bits
}
