//! The blocks of a frame that the next one is predicted from.

use isv_kernels::warp::StitchedReference;
use isv_volume::{BlockCoord, BlockIndex, VoxelMask};
use std::collections::BTreeMap;

/// The blocks of a reference, without their samples: what the syntax of the next frame needs of it.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceBlocks<'a> {
    /// Blocks in Morton order.
    pub coords: &'a [BlockCoord],
    /// Their look-up.
    pub index: &'a BlockIndex,
    /// Unobserved voxels by block index; no empty masks.
    pub unobserved: &'a BTreeMap<u32, VoxelMask>,
}

/// Stitches the 3x3x3 neighbourhood of a block (Fig. 7), of blocks whose samples are had by index, at any resolution. Where there is no
/// block, the truncation distance stands, with the sign of the voxel of the block in the middle that is nearest.
pub(crate) fn stitch<'a>(
    blocks: ReferenceBlocks,
    centre: BlockCoord,
    limit: i16,
    samples: impl Fn(u32) -> &'a [i16],
    out: &mut StitchedReference,
) {
    let side = out.block_side();
    let neighbourhood = blocks.index.neighbourhood(centre);
    let centre = neighbourhood[13].map(&samples);
    for (slot, neighbour) in neighbourhood.into_iter().enumerate() {
        match neighbour {
            Some(block) => out.put_block(slot, samples(block)),
            None => {
                let towards = [slot % 3, slot / 3 % 3, slot / 9].map(|step| step as i32 - 1);
                out.fill_block(slot, fill(centre, side, towards, limit));
            }
        }
    }
}

/// Value that stands for all samples of a block that is not there.
///
/// The block lies wholly beyond the truncation band, so the value is the truncation distance. Its sign is that of the centre
/// block's voxel nearest to the block; outside the surface if there is no centre block either. Along an axis on which neither
/// block is ahead, the nearest voxel is the middle one.
///
/// `side` is the number of voxels along an edge of the centre block. `towards` leads from the centre block to the other, by the
/// sign of each component.
pub(crate) fn fill(centre: Option<&[i16]>, side: usize, towards: [i32; 3], limit: i16) -> i16 {
    let [x, y, z] = towards.map(|step| [0, side / 2, side - 1][(step.signum() + 1) as usize]);
    let inside = centre.is_some_and(|centre| centre[(z * side + y) * side + x] < 0);
    if inside { -limit } else { limit }
}
