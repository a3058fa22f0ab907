//! Unobserved voxels, after the samples.

use isv_decode::ReferenceBlocks;
use isv_decode::main_profile::syntax::masks::{CrossedCells, MaskModels};
use isv_decode::syntax::masks::MaskContext;
use isv_entropy::RangeEncoder;
use isv_volume::{BlockEdge, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// Writes what can be written of the masks of a frame's blocks, coded or made up: their voxels in cells that the decoded surface
/// crosses. Returns it too, by index in the extended `volume`.
///
/// Nothing is written if the source is wholly observed. `unobserved`: the source's mask of a block of the extended volume.
pub(crate) fn write<'a>(
    models: &mut MaskModels,
    source: &SparseVolume,
    volume: &SparseVolume,
    unobserved: impl Fn(usize) -> Option<&'a VoxelMask>,
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
    let cells = CrossedCells::new(volume);
    for (block, coord) in volume.coords().iter().enumerate() {
        let corners = cells.corners(*coord);
        if corners.is_empty() {
            continue;
        }
        let context = MaskContext::new(*coord, cells.index(), &masks, reference);
        let mask = unobserved(block).and_then(|wanted| common(wanted, &corners));
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
            encoder
                .encode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, &mask)], mask.contains(voxel));
        }
        masks.insert(block as u32, mask);
    }
    (masks, encoder.finish())
}

/// Voxels of both masks, if there are any.
fn common(a: &VoxelMask, b: &VoxelMask) -> Option<VoxelMask> {
    let mut mask = VoxelMask::empty(BlockEdge::E8);
    let voxels = 0..BlockEdge::E8.block_voxels();
    voxels.filter(|voxel| a.contains(*voxel) && b.contains(*voxel)).for_each(|voxel| mask.insert(voxel));
    (!mask.is_empty()).then_some(mask)
}
