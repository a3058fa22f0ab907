//! Unobserved voxels, after the samples.

use crate::main_profile::debris::debris;
use crate::main_profile::target::Targets;
use isv_decode::ReferenceBlocks;
use isv_decode::extension::Extended;
use isv_decode::main_profile::crossed_cells::crossed_corners;
use isv_decode::main_profile::syntax::masks::{MaskModels, context};
use isv_entropy::RangeEncoder;
use isv_volume::{BlockEdge, VoxelMask};
use std::cell::LazyCell;
use std::collections::BTreeMap;

/// Writes what can be written of the masks of a frame's unsettled blocks, coded or extrapolated: their voxels in cells that the decoded surface
/// crosses, where these were not observed or are debris. Returns it too, by index in the extended volume.
///
/// `unobserved`: the source's mask of a block of the extended volume; asked for only if the source is not wholly observed.
pub(crate) fn write<'a>(
    models: &mut MaskModels,
    targets: &Targets,
    extended: &Extended,
    unobserved: impl Fn(u32) -> Option<&'a VoxelMask>,
    reference: Option<ReferenceBlocks>,
) -> (BTreeMap<u32, VoxelMask>, Vec<u8>) {
    let mut wanted = BTreeMap::new();
    // Masks that come only of debris are rare, and so are frames where the corners are needed but the source is wholly observed.
    let crossed = LazyCell::new(|| crossed_corners(extended));
    if !targets.source().unobserved_masks().is_empty() {
        wanted.extend(crossed.iter().filter_map(|(block, corners)| {
            let mask = unobserved(*block)?.intersection(corners);
            (!mask.is_empty()).then_some((*block, mask))
        }));
    }
    for (block, debris) in debris(extended, &wanted, targets) {
        wanted.entry(block).or_insert_with(|| VoxelMask::empty(BlockEdge::E8)).insert_all(&debris);
    }
    let models = &mut models.0;
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut models.any, !wanted.is_empty());
    let mut masks = BTreeMap::new();
    if wanted.is_empty() {
        return (masks, encoder.finish());
    }
    for (block, corners) in &*crossed {
        let context = context(extended.reference.blocks(), *block, &masks, reference);
        let mask = wanted.remove(block);
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
            encoder
                .encode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, &mask)], mask.contains(voxel));
        }
        masks.insert(*block, mask);
    }
    (masks, encoder.finish())
}
