//! Sign changes that no surface explains.
//!
//! Next to the outline of a thing its hidden inside meets the free space that was seen beside it. A surface
//! drawn between the two would run on behind the thing like a curtain. But a distance changes by no more than
//! one voxel from a voxel to the next, and there it changes by more.

use crate::backend::UNKNOWN;
use crate::blocks::Blocks;
use isv_volume::{BlockIndex, CODES_PER_VOXEL};
use rayon::prelude::*;

/// Difference of neighbours of different sign, in codes, that noise and slant do not explain.
const LARGEST_STEP: i32 = 2 * CODES_PER_VOXEL;

impl Blocks {
    /// Makes the farther one of two neighbours unobserved where their signs differ and their distances contradict.
    pub(crate) fn open_contradictions(&mut self) {
        let (index, size) = (BlockIndex::new(&self.coords), self.grid.edge.block_voxels());
        let found: Vec<_> =
            (0..self.coords.len()).into_par_iter().map(|block| self.contradictions(block, &index)).collect();
        for (block, voxel) in found.into_iter().flatten() {
            self.unobserved[block].insert(voxel);
            self.samples[block * size + voxel] = UNKNOWN;
        }
    }

    /// The voxels, by block and index, that the steps along the axes which start in a block find wrong.
    fn contradictions(&self, block: usize, index: &BlockIndex) -> Vec<(usize, usize)> {
        let (edge, size) = (self.grid.edge, self.grid.edge.block_voxels());
        let n = edge.voxels();
        let samples_of = |block: usize| &self.samples[block * size..(block + 1) * size];
        let own = samples_of(block);
        let mut found = Vec::new();
        for (axis, step) in [[1, 0, 0], [0, 1, 0], [0, 0, 1]].into_iter().enumerate() {
            let (next, stride) =
                (index.get(self.coords[block].offset(step)), 1 << (axis * edge.log2() as usize));
            let across = next.map(|next| (next as usize, samples_of(next as usize)));
            for voxel in 0..size {
                let last = voxel / stride % n == n - 1;
                let (other, samples, neighbour) = match across {
                    _ if !last => (block, own, voxel + stride),
                    Some((other, samples)) => (other, samples, voxel + stride - n * stride),
                    None => continue,
                };
                if contradict(own[voxel], samples[neighbour]) {
                    let worse = farther(own[voxel], samples[neighbour]);
                    found.push(if worse { (block, voxel) } else { (other, neighbour) });
                }
            }
        }
        found
    }
}

/// Whether the samples of two neighbours have different signs and differ by too much.
fn contradict(a: i16, b: i16) -> bool {
    (a < 0) != (b < 0) && a != UNKNOWN && b != UNKNOWN && (i32::from(a) - i32::from(b)).abs() > LARGEST_STEP
}

/// Whether `a` is farther from zero than `b`, or as far and behind a surface.
fn farther(a: i16, b: i16) -> bool {
    (a.abs(), b) > (b.abs(), a)
}
