//! The samples of a frame around a block that is displaced by whole voxels: what predicting the block reads.

use super::MainReference;
use isv_kernels::window::{Block, WindowRows};
use isv_volume::BlockCoord;

/// Voxels along a block's edge.
const EDGE: i32 = 8;

/// What stands where the frame has no block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The truncation distance, with the sign of the voxel of the block at this coordinate that is nearest; outside if there is
    /// no such block.
    Truncation(BlockCoord),
    /// This sample.
    Sample(i16),
}

/// A block's voxels and the layer after them along each axis.
#[derive(Clone, Debug)]
pub struct Window {
    rows: WindowRows,
    place: Option<([i32; 3], Missing)>,
    /// What stands for each of the 2x2x2 blocks that the window touches, where it is missing.
    fills: Box<[Block; 8]>,
}

impl Default for Window {
    fn default() -> Self {
        Self { rows: WindowRows::default(), place: None, fills: Box::new([[0; 512]; 8]) }
    }
}

impl Window {
    /// The samples of a frame from this voxel on. They stay until the next call, which does nothing if it asks for the same.
    pub fn look_at(&mut self, reference: &MainReference, first: [i32; 3], missing: Missing) {
        if self.place != Some((first, missing)) {
            self.place = Some((first, missing));
            self.load(reference, first, missing);
        }
    }

    /// The samples.
    #[must_use]
    pub fn rows(&self) -> &WindowRows {
        &self.rows
    }

    fn load(&mut self, reference: &MainReference, first: [i32; 3], missing: Missing) {
        let lowest = BlockCoord::from(first.map(|c| c.div_euclid(EDGE)));
        let within = first.map(|c| c.rem_euclid(EDGE) as usize);
        let volume = reference.volume();
        let limit = volume.grid().truncation.codes();
        let fill = |slot: usize| {
            let coord = lowest.offset([slot & 1, slot >> 1 & 1, slot >> 2].map(|s| s as i32));
            match missing {
                Missing::Sample(sample) => sample,
                Missing::Truncation(centre) if is_inside_towards(reference, centre, coord) => -limit,
                Missing::Truncation(_) => limit,
            }
        };
        let slots = reference.reference().index().octet(lowest);
        for slot in (0..8).filter(|slot| slots[*slot].is_none()) {
            self.fills[slot].fill(fill(slot));
        }
        let blocks: [&Block; 8] = std::array::from_fn(|slot| match slots[slot] {
            Some(block) => volume.block(block as usize).try_into().expect("blocks of an edge of 8"),
            None => &self.fills[slot],
        });
        self.rows.load(&blocks, within);
    }
}

/// Whether the voxel of a block that is nearest to another block lies inside; not if there is no block.
fn is_inside_towards(reference: &MainReference, block: BlockCoord, other: BlockCoord) -> bool {
    let nearest = [other.x - block.x, other.y - block.y, other.z - block.z]
        .map(|d| [0, EDGE / 2, EDGE - 1][(d.signum() + 1) as usize] as usize);
    let [x, y, z] = nearest;
    let block = reference.reference().index().get(block);
    block.is_some_and(|block| reference.volume().block(block as usize)[(z * 8 + y) * 8 + x] < 0)
}
