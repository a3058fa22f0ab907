//! The set of coded blocks.

use super::skip_cells;
use crate::shared::syntax::block_set as octree;
use isv_decode::main::MainReference;
use isv_decode::main::activity::expected_activity;
use isv_decode::main::syntax::block_set::{BlockSetModels, ExpectedBlocks};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockCoord, BlockIndex, BlockSet};

/// Writes a set of blocks given in Morton order, and before it, which of the reference's stay as they are, if any do.
pub(crate) fn write(
    models: &mut BlockSetModels,
    coords: &[BlockCoord],
    reference: Option<&MainReference>,
    skipped: &BlockSet,
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    let Some(reference) = reference else {
        octree::encode(&mut models.octree, &mut encoder, coords, None);
        return encoder.finish();
    };
    let frame = reference.blocks();
    if !skipped.is_empty() {
        skip_cells::write(&mut models.skip_cells, &mut encoder, skipped, frame);
    }
    let index = BlockIndex::new(coords);
    let mut flags = ExpectedBlocks::new(frame, skipped, expected_activity(reference, skipped));
    for candidate in flags.candidates(skipped) {
        let coded = index.get(frame.blocks.coords[candidate.block as usize]).is_some();
        encoder.encode_mixed(models.flag(flags.context(candidate)), coded);
        if coded {
            flags.set_coded(candidate);
        }
    }
    let known = frame.blocks.index;
    let rest: Vec<_> = coords.iter().copied().filter(|coord| known.get(*coord).is_none()).collect();
    octree::encode(&mut models.octree, &mut encoder, &rest, None);
    encoder.finish()
}
