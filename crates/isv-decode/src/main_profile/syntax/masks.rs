//! Unobserved voxels (W = 0 in Eq. 2), after the samples: only voxels of cells that the surface crosses can matter, so all
//! others count as observed.

use crate::ReferenceBlocks;
use crate::extension::Extended;
use crate::main_profile::crossed_cells::crossed_corners;
use crate::syntax::SyntaxError;
use crate::syntax::masks::{MaskContext, MaskModels as VoxelModels, blocks_before};
use isv_entropy::RangeDecoder;
use isv_volume::{BlockEdge, VoxelMask};
use std::collections::BTreeMap;

/// Models of the masks of a frame.
#[derive(Clone, Debug, Default)]
pub struct MaskModels(pub VoxelModels);

impl MaskModels {
    /// Reads the masks of a frame's unsettled blocks, coded or made up, by their index in its extended volume.
    ///
    /// # Errors
    /// A block whose mask is announced but empty, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        extended: &Extended,
        reference: Option<ReferenceBlocks>,
    ) -> Result<BTreeMap<u32, VoxelMask>, SyntaxError> {
        let models = &mut self.0;
        let mut masks = BTreeMap::new();
        let mut decoder = RangeDecoder::new(bytes);
        if !decoder.decode(&mut models.any) {
            return Ok(masks);
        }
        for (block, corners) in crossed_corners(extended) {
            let context = context(extended, block, &masks, reference);
            if !decoder.decode(&mut models.block[context.block()]) {
                continue;
            }
            let mut mask = VoxelMask::empty(BlockEdge::E8);
            for voxel in (0..BlockEdge::E8.block_voxels()).filter(|voxel| corners.contains(*voxel)) {
                if decoder.decode(&mut models.voxel[context.voxel(BlockEdge::E8, voxel, &mask)]) {
                    mask.insert(voxel);
                }
            }
            if mask.is_empty() {
                return Err(SyntaxError("a mask of unobserved voxels is empty"));
            }
            if decoder.overran() {
                return Err(SyntaxError("the masks end too early"));
            }
            masks.insert(block, mask);
        }
        if decoder.overran() {
            return Err(SyntaxError("the masks end too early"));
        }
        Ok(masks)
    }
}

/// Context of a block of an extended volume; `masks` holds those of the blocks before it.
#[must_use]
pub fn context<'a>(
    extended: &Extended,
    block: u32,
    masks: &'a BTreeMap<u32, VoxelMask>,
    reference: Option<ReferenceBlocks<'a>>,
) -> MaskContext<'a> {
    let coord = extended.volume().coords()[block as usize];
    MaskContext::new(coord, blocks_before(coord, extended.index()), masks, reference)
}
