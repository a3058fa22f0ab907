//! The frame that the next one is predicted from.

use isv_kernels::warp::StitchedReference;
use isv_volume::{BlockCoord, BlockIndex, SparseVolume, VoxelMask};
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

/// A reconstructed volume with its block look-up.
#[derive(Clone, Debug)]
pub struct Reference {
    volume: SparseVolume,
    index: BlockIndex,
}

impl Reference {
    /// Makes a decoded volume a reference.
    #[must_use]
    pub fn new(volume: SparseVolume) -> Self {
        let index = volume.index();
        Self { volume, index }
    }

    /// [`Self::new`] with the look-up of the volume's blocks.
    pub(crate) fn with_index(volume: SparseVolume, index: BlockIndex) -> Self {
        Self { volume, index }
    }

    /// The volume.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        &self.volume
    }

    /// Adds unobserved voxels, by block index.
    pub(crate) fn add_unobserved(&mut self, masks: BTreeMap<u32, VoxelMask>) {
        self.volume.add_unobserved(masks);
    }

    /// The volume alone.
    pub(crate) fn into_volume(self) -> SparseVolume {
        self.volume
    }

    /// Its block look-up.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// Its blocks.
    #[must_use]
    pub fn blocks(&self) -> ReferenceBlocks<'_> {
        ReferenceBlocks {
            coords: self.volume.coords(),
            index: &self.index,
            unobserved: self.volume.unobserved_masks(),
        }
    }

    /// Stitches the 3x3x3 neighbourhood of a reference block (Fig. 7). Where the reference has no block, the truncation distance stands,
    /// with the sign of the voxel of the block in the middle that is nearest.
    pub fn stitch(&self, centre: u32, out: &mut StitchedReference) {
        self.stitch_at(self.volume.coords()[centre as usize], out);
    }

    /// [`Self::stitch`] at any coordinate.
    pub(crate) fn stitch_at(&self, centre: BlockCoord, out: &mut StitchedReference) {
        let limit = self.volume.grid().truncation.codes();
        stitch(self.blocks(), centre, limit, |block| self.volume.block(block as usize), out);
    }
}

/// [`Reference::stitch`] of blocks whose samples are had by index, at any resolution.
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

/// What stands for all samples of a block that is not there. It lies wholly beyond the truncation band, so that is the truncation
/// distance, with the sign of the centre block's voxel nearest to it (the middle one along an axis on which neither is ahead); outside
/// the surface if there is no centre block either.
///
/// `side` is the number of voxels along an edge of the centre block; `towards` leads from it to the other, by the sign of each component.
pub(crate) fn fill(centre: Option<&[i16]>, side: usize, towards: [i32; 3], limit: i16) -> i16 {
    let [x, y, z] = towards.map(|step| [0, side / 2, side - 1][(step.signum() + 1) as usize]);
    let inside = centre.is_some_and(|centre| centre[(z * side + y) * side + x] < 0);
    if inside { -limit } else { limit }
}
