//! The samples of a frame around a block that is displaced by whole voxels: what predicting the block reads.

use super::MainReference;
use crate::shared::fill;
use isv_kernels::block8::{self, Block};
use isv_kernels::window::WindowRows;
use isv_volume::{BlockCoord, NeighbourFinder};

/// Voxels along a block's edge.
const EDGE: i32 = block8::EDGE as i32;

/// A block's voxels and the layer after them along each axis.
#[derive(Clone, Debug)]
pub struct Window<'a> {
    reference: &'a MainReference,
    finder: NeighbourFinder<'a>,
    rows: WindowRows,
    place: Option<([i32; 3], BlockCoord)>,
    /// What stands for each of the 2x2x2 blocks that the window touches, where it is missing: one sample throughout.
    fills: Box<[Block; 8]>,
}

impl<'a> Window<'a> {
    /// A window into a frame, which looks nowhere yet.
    #[must_use]
    pub fn new(reference: &'a MainReference) -> Self {
        let (finder, fills) = (reference.finder(), Box::new([[0; block8::SAMPLES]; 8]));
        Self { reference, finder, rows: WindowRows::default(), place: None, fills }
    }

    /// Looks at the samples from the first voxel of the block at `coord` and `voxels` from there on. They stay until the next
    /// call, which does nothing if it asks for the same.
    ///
    /// Where the frame has no block, the truncation distance stands. Its sign is that of the nearest voxel of the block at
    /// `centre`; outside if there is no such block.
    pub fn look_at(&mut self, coord: BlockCoord, voxels: [i32; 3], centre: BlockCoord) {
        let [x, y, z] = voxels;
        let first = [EDGE * coord.x + x, EDGE * coord.y + y, EDGE * coord.z + z];
        if self.place != Some((first, centre)) {
            self.place = Some((first, centre));
            self.finder.turn_to(coord);
            self.load(coord, voxels, centre);
        }
    }

    /// The samples.
    #[must_use]
    pub fn rows(&self) -> &WindowRows {
        &self.rows
    }

    fn load(&mut self, coord: BlockCoord, voxels: [i32; 3], centre: BlockCoord) {
        let offset = voxels.map(|c| c.div_euclid(EDGE));
        let volume = self.reference.volume();
        let limit = volume.grid().truncation.codes();
        let slots = self.finder.octet_at(offset);
        for slot in (0..8).filter(|slot| slots[*slot].is_none()) {
            let missing = coord.offset(offset).offset([slot & 1, slot >> 1 & 1, slot >> 2].map(|s| s as i32));
            let towards = [missing.x - centre.x, missing.y - centre.y, missing.z - centre.z];
            let centre = self.reference.index().get(centre).map(|block| volume.block(block as usize));
            let fill = fill(centre, block8::EDGE, towards, limit);
            if self.fills[slot][0] != fill {
                self.fills[slot] = [fill; block8::SAMPLES];
            }
        }
        let blocks: [&Block; 8] = std::array::from_fn(|slot| match slots[slot] {
            Some(block) => volume.block(block as usize).try_into().expect("blocks of an edge of 8"),
            None => &self.fills[slot],
        });
        self.rows.load(&blocks, voxels.map(|c| c.rem_euclid(EDGE) as usize));
    }
}
