//! Unobserved voxels, after the samples.

use isv_decode::ReferenceBlocks;
use isv_decode::main_profile::syntax::masks::{CrossedCells, MaskModels};
use isv_decode::syntax::masks::MaskContext;
use isv_entropy::RangeEncoder;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// What of the masks of coded blocks, by block, can be written: their voxels in cells that the decoded surface crosses.
pub(crate) fn writable(
    coords: &[BlockCoord],
    volume: &SparseVolume,
    unobserved: impl Fn(usize) -> Option<VoxelMask>,
) -> BTreeMap<u32, VoxelMask> {
    let cells = CrossedCells::new(volume);
    let mut masks = BTreeMap::new();
    for (block, coord) in coords.iter().enumerate() {
        let Some(wanted) = unobserved(block) else { continue };
        let corners = cells.corners(*coord);
        let mut mask = VoxelMask::empty(BlockEdge::E8);
        let voxels = 0..BlockEdge::E8.block_voxels();
        voxels.filter(|v| wanted.contains(*v) && corners.contains(*v)).for_each(|v| mask.insert(v));
        if !mask.is_empty() {
            masks.insert(block as u32, mask);
        }
    }
    masks
}

/// Writes the masks of a frame's coded blocks.
pub(crate) fn write(
    models: &mut MaskModels,
    coords: &[BlockCoord],
    masks: &BTreeMap<u32, VoxelMask>,
    volume: &SparseVolume,
    reference: Option<ReferenceBlocks>,
) -> Vec<u8> {
    let models = &mut models.0;
    let mut encoder = RangeEncoder::new();
    encoder.encode(&mut models.any, !masks.is_empty());
    if masks.is_empty() {
        return encoder.finish();
    }
    let cells = CrossedCells::new(volume);
    let index = BlockIndex::new(coords);
    for (block, coord) in coords.iter().enumerate() {
        let context = MaskContext::new(*coord, &index, masks, reference);
        let mask = masks.get(&(block as u32));
        encoder.encode(&mut models.block[context.block()], mask.is_some());
        let Some(mask) = mask else { continue };
        let corners = cells.corners(*coord);
        for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
            encoder
                .encode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, mask)], mask.contains(voxel));
        }
    }
    encoder.finish()
}
