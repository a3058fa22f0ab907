//! The frame that the next one is predicted from.

use crate::shared::{ReferenceBlocks, stitch};
use isv_kernels::warp::StitchedReference;
use isv_volume::{BlockIndex, SparseVolume};

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

    /// The volume.
    #[must_use]
    pub fn volume(&self) -> &SparseVolume {
        &self.volume
    }

    /// Look-up of the volume's blocks.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// The volume's blocks, without their samples.
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
        let (volume, limit) = (&self.volume, self.volume.grid().truncation.codes());
        let centre = volume.coords()[centre as usize];
        stitch(self.blocks(), centre, limit, |block| volume.block(block as usize), out);
    }
}
