//! Unobserved voxels: a flag a block, and a bit a voxel in the blocks that have some.

use isv_decode::ReferenceBlocks;
use isv_decode::shared::syntax::masks::{MaskContext, MaskModels, blocks_before};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, VoxelMask};
use std::collections::BTreeMap;

/// Writes the masks of a frame's blocks.
pub(crate) fn write(
    models: &mut MaskModels,
    edge: BlockEdge,
    coords: &[BlockCoord],
    masks: &BTreeMap<u32, VoxelMask>,
    reference: Option<ReferenceBlocks>,
) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut models.any, !masks.is_empty());
    if masks.is_empty() {
        return encoder.finish();
    }
    let index = BlockIndex::new(coords);
    for (block, coord) in coords.iter().enumerate() {
        // The context looks only at the masks of blocks before this one.
        let context = MaskContext::new(*coord, blocks_before(*coord, &index), masks, reference);
        let mask = masks.get(&(block as u32));
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        for voxel in 0..edge.block_voxels() {
            encoder.encode(&mut models.voxel[context.voxel(edge, voxel, mask)], mask.contains(voxel));
        }
    }
    encoder.finish()
}
