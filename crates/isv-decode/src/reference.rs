//! The frame that the next one is predicted from.

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

    /// Its block look-up.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// Stitches the 3x3x3 neighbourhood of a reference block (Fig. 7).
    ///
    /// A block that is not there lies wholly beyond the truncation band, so its samples are the truncation distance, with
    /// the sign of the centre block's voxel nearest to it (the middle one along an axis on which neither is ahead).
    pub fn stitch(&self, centre: u32, out: &mut StitchedReference) {
        let grid = self.volume.grid();
        let (edge, limit) = (grid.edge, grid.truncation.codes());
        let block = self.volume.block(centre as usize);
        let nearest = |offset: usize| [0, edge.voxels() / 2, edge.voxels() - 1][offset];
        let neighbourhood = self.index.neighbourhood(self.volume.coords()[centre as usize]);
        for (slot, neighbour) in neighbourhood.into_iter().enumerate() {
            match neighbour {
                Some(index) => out.put_block(slot, self.volume.block(index as usize)),
                None => {
                    let [x, y, z] = [slot % 3, slot / 3 % 3, slot / 9].map(nearest);
                    let inside = block[edge.voxel_index(x, y, z)] < 0;
                    out.fill_block(slot, if inside { -limit } else { limit });
                }
            }
        }
    }
}
