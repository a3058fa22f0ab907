//! How the colour of blocks is predicted, and how deep its samples are.

use crate::main::syntax::modes as main_modes;
use isv_decode::colour::syntax::modes::{ColourModeModels, DepthContext, ModeBlocks};
use isv_decode::main::BlockMode;
use isv_decode::main::syntax::modes::{ModeContext, ModeModels};
use isv_entropy::RangeEncoder;

/// Writes the modes and depths of a slice's blocks. `modes`, `depths`: of all blocks of the frame.
pub(crate) fn write(
    models: &mut ColourModeModels,
    blocks: &ModeBlocks,
    modes: &[BlockMode],
    depths: &[u8],
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    for block in blocks.range.clone() {
        if blocks.predicts {
            let context = context(blocks, block, modes);
            main_modes::write(&mut models.modes, &mut encoder, &context, modes[block], 1);
        }
        let context = DepthContext::new(block, blocks, |n| depths[n]);
        for depth in 0..blocks.max_depth.min(depths[block] + 1) {
            encoder.encode_mixed(models.deeper(&context, depth), depth < depths[block]);
        }
    }
    encoder.finish()
}

/// The context of a block's mode, given the modes of the blocks before it.
pub(crate) fn context(blocks: &ModeBlocks, block: usize, modes: &[BlockMode]) -> ModeContext {
    ModeContext::new(
        block,
        blocks.causal,
        |n| modes[n],
        blocks.before[block].map(|before| before.for_modes()),
    )
}

/// Lets models learn from the mode of a block, without writing it.
pub(crate) fn learn(models: &mut ModeModels, context: &ModeContext, mode: BlockMode) {
    main_modes::write(models, &mut RangeEncoder::new(), context, mode, 1);
}
