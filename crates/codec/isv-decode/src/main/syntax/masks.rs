//! Unobserved voxels (W = 0 in Eq. 2), after the samples. Only voxels of cells that the surface crosses can matter, so all others
//! count as observed.

use crate::ReferenceBlocks;
use crate::shared::syntax::SyntaxError;
use crate::shared::syntax::masks::{MaskContext, MaskModels as VoxelModels, blocks_before};
use isv_entropy::RangeDecoder;
use isv_volume::{BlockEdge, VoxelMask};
use std::collections::BTreeMap;

/// Models of the masks of a frame.
#[derive(Clone, Debug, Default)]
pub struct MaskModels(pub VoxelModels);

impl MaskModels {
    /// Reads the masks of a frame's unsettled blocks, coded or extrapolated, by their index in its extended volume. `corners`: those
    /// of its blocks that have corners of crossed cells, in order, with these voxels; asked for only if there are masks.
    /// `reference`: the frame before.
    ///
    /// # Errors
    /// That of `corners`, a block whose mask is announced but empty, or bytes that end too early.
    pub fn read<E: From<SyntaxError>>(
        &mut self,
        bytes: &[u8],
        frame: ReferenceBlocks,
        reference: Option<ReferenceBlocks>,
        corners: impl FnOnce() -> Result<Vec<(u32, VoxelMask)>, E>,
    ) -> Result<BTreeMap<u32, VoxelMask>, E> {
        let models = &mut self.0;
        let mut masks = BTreeMap::new();
        let mut decoder = RangeDecoder::new(bytes);
        if !decoder.decode(&mut models.any) {
            return Ok(masks);
        }
        for (block, corners) in corners()? {
            let context = context(frame, block, &masks, reference);
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
                return Err(SyntaxError("a mask of unobserved voxels is empty").into());
            }
            if decoder.overran() {
                return Err(SyntaxError("the masks end too early").into());
            }
            masks.insert(block, mask);
        }
        if decoder.overran() {
            return Err(SyntaxError("the masks end too early").into());
        }
        Ok(masks)
    }
}

/// Context of a block of a frame, by its index there; `masks` holds those of the blocks before it.
#[must_use]
pub fn context<'a>(
    frame: ReferenceBlocks,
    block: u32,
    masks: &'a BTreeMap<u32, VoxelMask>,
    reference: Option<ReferenceBlocks<'a>>,
) -> MaskContext<'a> {
    let coord = frame.coords[block as usize];
    MaskContext::new(coord, blocks_before(coord, frame.index), masks, reference)
}
