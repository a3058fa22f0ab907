//! Unobserved voxels, after the samples.

use isv_decode::ReferenceBlocks;
use isv_decode::extension::Extended;
use isv_decode::main_profile::crossed_cells::crossed_corners;
use isv_decode::main_profile::syntax::masks::{MaskModels, context};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockEdge, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// Writes what can be written of the masks of a frame's unsettled blocks, coded or made up: their voxels in cells that the decoded surface
/// crosses. Returns it too, by index in the extended volume.
///
/// Nothing is written if the source is wholly observed. `unobserved`: the source's mask of a block of the extended volume.
pub(crate) fn write<'a>(
    models: &mut MaskModels,
    source: &SparseVolume,
    extended: &Extended,
    unobserved: impl Fn(u32) -> Option<&'a VoxelMask>,
    reference: Option<ReferenceBlocks>,
) -> (BTreeMap<u32, VoxelMask>, Vec<u8>) {
    let models = &mut models.0;
    let mut encoder = RangeEncoder::new();
    let mut masks = BTreeMap::new();
    let any = !source.unobserved_masks().is_empty();
    encoder.encode(&mut models.any, any);
    if !any {
        return (masks, encoder.finish());
    }
    for (block, corners) in crossed_corners(extended) {
        let context = context(extended.reference.blocks(), block, &masks, reference);
        let mask =
            unobserved(block).map(|wanted| wanted.intersection(&corners)).filter(|mask| !mask.is_empty());
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
            encoder
                .encode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, &mask)], mask.contains(voxel));
        }
        masks.insert(block, mask);
    }
    (masks, encoder.finish())
}
