//! Unobserved voxels, after the samples.

use isv_decode::ReferenceBlocks;
use isv_decode::main::syntax::masks::{MaskModels, context};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockEdge, VoxelMask};
use std::collections::BTreeMap;

/// Writes the masks of a frame's unsettled blocks, coded or extrapolated, by their index in its extended volume.
///
/// - `corners`: the frame's blocks that have corners of crossed cells, in order, with these voxels. All masks are part of them.
///   Asked for only if there are masks.
/// - `reference`: the frame before.
pub(crate) fn write<'a>(
    models: &mut MaskModels,
    frame: ReferenceBlocks,
    reference: Option<ReferenceBlocks>,
    masks: &BTreeMap<u32, VoxelMask>,
    corners: impl FnOnce() -> &'a [(u32, VoxelMask)],
) -> Vec<u8> {
    let models = &mut models.0;
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut models.any, !masks.is_empty());
    if masks.is_empty() {
        return encoder.finish();
    }
    for (block, corners) in corners() {
        let context = context(frame, *block, masks, reference);
        let mask = masks.get(block);
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
            encoder
                .encode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, mask)], mask.contains(voxel));
        }
    }
    encoder.finish()
}
