//! Samples where no reading has the voxel in its band.
//!
//! They need samples all the same, and those that continue the field around them cost least to code and keep coding
//! from inventing a sign.

use crate::blocks::{Blocks, UNKNOWN};
use isv_volume::{BlockEdge, CODES_PER_VOXEL, VoxelMask};
use rayon::prelude::*;

/// Samples of at least this keep their sign through coding: one voxel. Beside a crossing that is no surface the field is
/// bent, and it takes twice as much.
const SAFE: i16 = CODES_PER_VOXEL as i16;

impl Blocks {
    /// Lets the field of each block run on through all its voxels.
    pub(crate) fn continue_field(&mut self) {
        let edge = self.grid.edge;
        self.samples.par_chunks_exact_mut(edge.block_voxels()).for_each(|block| {
            fill_unknown(block, edge);
            limit_slope(block, edge);
        });
    }

    /// Makes voxels unobserved whose sign coding could turn, but for the corners of surface cells, which are given: the field
    /// beside what was trimmed or contradicted still crosses zero, and would show as specks.
    pub(crate) fn guard(&mut self, surface: &[VoxelMask]) {
        let edge = self.grid.edge;
        let blocks =
            self.samples.par_chunks_exact(edge.block_voxels()).zip(&mut self.unobserved).zip(surface);
        blocks.filter(|((_, mask), _)| !mask.is_empty()).for_each(|((block, mask), surface)| {
            let turning = |voxel: usize, safe| block[voxel].abs() < safe && !surface.contains(voxel);
            for voxel in (0..block.len()).filter(|voxel| turning(*voxel, SAFE)) {
                mask.insert(voxel);
                for_each_neighbour(edge, voxel, |neighbour| {
                    if turning(neighbour, 2 * SAFE) {
                        mask.insert(neighbour);
                    }
                });
            }
        });
    }
}

/// Gives unknown voxels the mean of their known neighbours, layer by layer; 0 if the whole block is unknown.
fn fill_unknown(block: &mut [i16], edge: BlockEdge) {
    let mut unknown: Vec<usize> = (0..block.len()).filter(|voxel| block[*voxel] == UNKNOWN).collect();
    if unknown.len() == block.len() {
        return block.fill(0);
    }
    let mut layer = Vec::new();
    while !unknown.is_empty() {
        layer.clear();
        layer.extend(unknown.iter().filter_map(|voxel| Some((*voxel, known_mean(block, edge, *voxel)?))));
        for (voxel, sample) in &layer {
            block[*voxel] = *sample;
        }
        unknown.retain(|voxel| block[*voxel] == UNKNOWN);
    }
}

/// Mean of the known ones of the six neighbours inside the block, if there are any.
fn known_mean(block: &[i16], edge: BlockEdge, voxel: usize) -> Option<i16> {
    let (mut sum, mut count) = (0, 0);
    for_each_neighbour(edge, voxel, |neighbour| {
        if block[neighbour] != UNKNOWN {
            sum += i32::from(block[neighbour]);
            count += 1;
        }
    });
    (count > 0).then(|| (sum / count) as i16)
}

/// Brings samples nearer to zero that are too far from it beside their neighbours: no voxel is farther from the surface
/// than its neighbour by more than one voxel, nor by more than that from a neighbour on the other side. Free and hidden
/// voxels, which are only known to lie beyond the band, come down to the field around them.
fn limit_slope(block: &mut [i16], edge: BlockEdge) {
    let limit = |block: &mut [i16], voxel: usize| {
        let sample = block[voxel];
        let mut nearest = sample.abs();
        for_each_neighbour(edge, voxel, |neighbour| {
            let same_side = (block[neighbour] < 0) == (sample < 0);
            nearest = nearest.min(if same_side { block[neighbour].abs() } else { 0 });
        });
        block[voxel] = sample.signum() * sample.abs().min(nearest + CODES_PER_VOXEL as i16);
    };
    // There and back, every voxel hears of every other one.
    (0..block.len()).for_each(|voxel| limit(block, voxel));
    (0..block.len()).rev().for_each(|voxel| limit(block, voxel));
}

/// Visits the neighbours of a voxel along the axes, inside its block.
fn for_each_neighbour(edge: BlockEdge, voxel: usize, mut visit: impl FnMut(usize)) {
    let last = edge.voxels() - 1;
    for axis in 0..3 {
        let stride = 1 << (axis * edge.log2() as usize);
        let at = (voxel / stride) & last;
        if at > 0 {
            visit(voxel - stride);
        }
        if at < last {
            visit(voxel + stride);
        }
    }
}
