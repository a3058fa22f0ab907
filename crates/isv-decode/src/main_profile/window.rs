//! The samples of a frame around a block that is displaced by whole voxels: what predicting the block reads.

use super::MainReference;
use isv_kernels::window::{ROW, ROWS, SIDE, WindowRows};
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
#[derive(Clone, Debug, Default)]
pub struct Window {
    rows: WindowRows,
    place: Option<([i32; 3], Missing)>,
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
        let (index, volume) = (reference.reference().index(), reference.volume());
        let limit = volume.grid().truncation.codes();
        let block = |coord: BlockCoord| {
            let block: &[i16; 512] = volume.block(index.get(coord)? as usize).try_into().expect("edge 8");
            Some(block)
        };
        let fill = |coord: BlockCoord| match missing {
            Missing::Sample(sample) => sample,
            Missing::Truncation(centre) => {
                let nearest = [coord.x - centre.x, coord.y - centre.y, coord.z - centre.z]
                    .map(|d| [0, EDGE / 2, EDGE - 1][(d.signum() + 1) as usize] as usize);
                let [x, y, z] = nearest;
                let inside = block(centre).is_some_and(|centre| centre[(z * 8 + y) * 8 + x] < 0);
                if inside { -limit } else { limit }
            }
        };
        self.rows.first = within[0];
        let slots: [_; 8] = std::array::from_fn(|slot| {
            let coord = lowest.offset([slot & 1, slot >> 1 & 1, slot >> 2].map(|s| s as i32));
            // Along y and z a window that begins with a block ends in the next one, in its first layer.
            block(coord).ok_or_else(|| [fill(coord); 8])
        });
        for row in 0..ROWS {
            let [y, z] = [within[1] + row % SIDE, within[2] + row / SIDE];
            let (pair, start) = ((z / 8 * 2 + y / 8) * 2, (z % 8 * 8 + y % 8) * 8);
            let out: &mut [i16; ROW] = &mut self.rows.samples[row];
            for half in 0..2 {
                let values: &[i16; 8] = match &slots[pair + half] {
                    Ok(block) => block[start..start + 8].try_into().expect("eight samples"),
                    Err(fill) => fill,
                };
                out[8 * half..8 * half + 8].copy_from_slice(values);
            }
        }
    }
}
