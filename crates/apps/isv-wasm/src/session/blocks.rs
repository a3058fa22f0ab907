//! How the blocks of a frame are coded, as overlays draw it.

use isv_decode::{BlockCoding, BlockDetail};

/// Three lists, an entry a block each, in Morton order.
#[derive(Debug, Default)]
pub(crate) struct Blocks {
    /// x, y and z in blocks, and what the block is. That is 0 for one that stays as it is, 1 for one coded
    /// without the frame before, 2 for one predicted from it.
    pub(crate) places: Vec<[i32; 4]>,
    /// Bits that it takes.
    pub(crate) bits: Vec<f32>,
    /// From where it is predicted to where it is, x, y and z in metres.
    pub(crate) motion: Vec<[f32; 3]>,
}

impl Blocks {
    /// Forgets all of them.
    pub(crate) fn clear(&mut self) {
        self.places.clear();
        self.bits.clear();
        self.motion.clear();
    }

    /// Becomes these blocks. `voxel_size` in metres.
    pub(crate) fn set(&mut self, blocks: &[BlockDetail], voxel_size: f64) {
        self.clear();
        for block in blocks {
            let (coding, from) = match block.coding {
                BlockCoding::Still => (0, [0; 3]),
                BlockCoding::Alone => (1, [0; 3]),
                BlockCoding::Predicted { from } => (2, from),
            };
            let [x, y, z] = block.coord.to_array();
            self.places.push([x, y, z, coding]);
            self.bits.push(block.bits);
            // In quarter voxels.
            self.motion.push(from.map(|quarters| (-f64::from(quarters) / 4.0 * voxel_size) as f32));
        }
    }
}
