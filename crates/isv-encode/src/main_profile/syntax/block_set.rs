//! The set of coded blocks.

use crate::syntax::block_set as octree;
use isv_decode::main_profile::MainReference;
use isv_decode::main_profile::syntax::block_set::{BlockSetModels, ExpectedBlocks};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockCoord, BlockIndex};

/// Writes a set of blocks given in Morton order.
pub(crate) fn write(
    models: &mut BlockSetModels,
    coords: &[BlockCoord],
    reference: Option<&MainReference>,
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    let Some(reference) = reference else {
        octree::encode(&mut models.octree, &mut encoder, coords, None);
        return encoder.finish();
    };
    let index = BlockIndex::new(coords);
    let mut flags = ExpectedBlocks::new(reference);
    for candidate in 0..flags.len() {
        let coded = index.get(reference.volume().coords()[candidate]).is_some();
        encoder.encode_mixed(models.flag(flags.context(candidate)), coded);
        flags.set(candidate, coded);
    }
    let known = reference.reference().index();
    let rest: Vec<_> = coords.iter().copied().filter(|coord| known.get(*coord).is_none()).collect();
    octree::encode(&mut models.octree, &mut encoder, &rest, None);
    encoder.finish()
}
