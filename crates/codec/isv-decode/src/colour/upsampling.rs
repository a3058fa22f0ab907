//! Prediction of a node's children from its mean and those of the nodes around it.

use super::cells::ColourCells;
use super::frame::{Sample, mean, rounded};
use super::morton::{interleave, wide_position};
use super::tree::UPPER_LEVELS;
use isv_volume::Neighbourhood;

/// Parts of a node's edge that lie nearer to the node's middle than to the next one's: three of four.
const NEAR: i32 = 3;

/// Means of all nodes of a frame at one level.
///
/// Above the voxels' cells each block has a mean for every place of the level, whether there is a node or not. From there down it
/// has a mean for each cell, or eight or 64 for each cell of a deep block.
#[derive(Clone, Copy, Debug)]
pub struct LevelMeans<'a> {
    /// Level of the nodes: 0 is the block.
    pub level: usize,
    /// The cells of the frame.
    pub cells: &'a ColourCells,
    /// Depth of each block.
    pub depths: &'a [u8],
    /// Means at the level.
    pub means: &'a [Sample],
    /// Means of voxels' cells, for blocks that are not deep enough to have some at the level.
    pub shallow: &'a [Sample],
    /// Start of each block's samples in each layer.
    pub starts: &'a [[u32; 3]],
}

impl LevelMeans<'_> {
    /// The mean of a node by its place, if the block has one there.
    #[inline(always)]
    fn get(&self, block: usize, place: usize) -> Option<Sample> {
        let cells = &self.cells.blocks()[block];
        match self.level {
            0 => Some(self.means[block]),
            1 => (cells.crossed[place] != 0).then(|| self.means[8 * block + place]),
            2 => (cells.crossed[place >> 3] >> (8 * (place & 7)) & 0xff != 0)
                .then(|| self.means[64 * block + place]),
            UPPER_LEVELS => cells.cell(place).map(|cell| self.means[cell]),
            _ => {
                let cell = cells.cell(place >> 3)?;
                if self.cells.surfels()[cell].halves >> (place & 7) & 1 == 0 {
                    return None;
                }
                match self.depths[block] {
                    0 => Some(self.shallow[cell]),
                    _ => Some(
                        self.means[self.starts[block][1] as usize + 8 * (cell - cells.first()) + (place & 7)],
                    ),
                }
            }
        }
    }
}

/// Means of a block's nodes at one level, and of the next ones around the block.
#[derive(Clone, Debug, Default)]
pub struct ParentWindow {
    /// Nodes along an edge, with one on either side.
    side: usize,
    /// Means by place, x fastest; the last value is 1 where there is a node.
    means: Vec<Sample>,
}

impl ParentWindow {
    /// Takes the means around a block.
    pub fn gather(&mut self, level: &LevelMeans, around: &Neighbourhood) {
        let inner = 1usize << level.level;
        self.side = inner + 2;
        self.means.clear();
        self.means.resize(self.side * self.side * self.side, [0; 4]);
        for (slot, block) in around.iter().enumerate() {
            let Some(block) = block.map(|block| block as usize) else { continue };
            let ranges = [slot % 3, slot / 3 % 3, slot / 9].map(|step| match step {
                0 => (inner - 1..inner, 0),
                1 => (0..inner, 1),
                _ => (0..1, inner + 1),
            });
            let [(xs, to_x), (ys, to_y), (zs, to_z)] = ranges;
            let [from_x, from_y, from_z] = [xs.start, ys.start, zs.start];
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        if let Some(mean) = level.get(block, interleave([x, y, z])) {
                            let at = [x - from_x + to_x, y - from_y + to_y, z - from_z + to_z];
                            self.means[(at[2] * self.side + at[1]) * self.side + at[0]] = mean;
                        }
                    }
                }
            }
        }
    }

    /// The mean of a node of the block by its place.
    #[must_use]
    #[inline(always)]
    pub fn mean(&self, place: usize) -> Sample {
        let [x, y, z] = wide_position(place);
        self.means[((z + 1) * self.side + y + 1) * self.side + x + 1]
    }

    /// Predicts a child by its place at the level below. The prediction is the mean of those of the eight nearest nodes that are
    /// there, with weights of 3 and 1 along each axis.
    #[must_use]
    #[inline(always)]
    pub fn predict(&self, child: usize) -> Sample {
        let parent = wide_position(child >> 3);
        let first = ((parent[2] + 1) * self.side + parent[1] + 1) * self.side + parent[0] + 1;
        let strides = [1, self.side, self.side * self.side];
        // Towards the side of the parent that the child is on.
        let steps: [isize; 3] = std::array::from_fn(|axis| {
            if child >> axis & 1 != 0 { strides[axis] as isize } else { -(strides[axis] as isize) }
        });
        let mut sums = [0; 4];
        for corner in 0..8usize {
            let (mut at, mut weight) = (first as isize, 1);
            for (axis, step) in steps.iter().enumerate() {
                if corner >> axis & 1 != 0 {
                    at += step;
                } else {
                    weight *= NEAR;
                }
            }
            // All values are 0 where there is no node.
            let mean = &self.means[at as usize];
            for lane in 0..4 {
                sums[lane] += weight * i32::from(mean[lane]);
            }
        }
        // The parent itself is one of them.
        mean(sums)
    }
}

/// Weights of the blocks around a block in the prediction of its mean, by how many axes they are away along.
const ROOT_WEIGHTS: [i32; 4] = [0, 3, 2, 1];

/// The prediction of a block's mean from those around it that are known, by slot; grey without any.
#[must_use]
pub fn predict_root(around: impl Iterator<Item = (usize, Sample)>) -> [i32; 3] {
    let (mut sums, mut weights) = ([0; 3], 0);
    for (slot, mean) in around {
        let away = [slot % 3, slot / 3 % 3, slot / 9].iter().filter(|step| **step != 1).count();
        weights += ROOT_WEIGHTS[away];
        (0..3).for_each(|channel| sums[channel] += ROOT_WEIGHTS[away] * i32::from(mean[channel]));
    }
    match weights {
        0 => [128 << super::frame::SAMPLE_BITS, 0, 0],
        _ => sums.map(|sum| rounded(sum, weights)),
    }
}
