//! Samples where no reading has the voxel in its band.
//!
//! They need samples all the same, and those that continue the field around them cost least to code and keep coding
//! from inventing a sign.

use crate::backend::UNKNOWN;
use crate::blocks::Blocks;
use isv_volume::{BlockEdge, CODES_PER_VOXEL, VoxelMask};
use rayon::prelude::*;

/// Samples of at least this keep their sign through coding: one voxel.
const SAFE: i16 = CODES_PER_VOXEL as i16;

impl Blocks {
    /// Lets the field of each block run on through all its voxels. Makes voxels unobserved whose sign coding
    /// could turn, but for the given corners of surface cells. Beside what was trimmed or contradicted, the
    /// field still crosses zero, and would show as specks.
    pub(crate) fn continue_field(&mut self, surface: &[VoxelMask]) {
        let edge = self.grid.edge;
        let blocks =
            self.samples.par_chunks_exact_mut(edge.block_voxels()).zip(&mut self.unobserved).zip(surface);
        blocks.for_each(|((block, mask), surface)| {
            fill_unknown(block, edge);
            let before = block.to_vec();
            limit_slope(block, edge);
            if !mask.is_empty() {
                let field = Continued { block, before: &before, surface, edge };
                (0..field.block.len()).filter(|voxel| field.could_turn(*voxel)).for_each(|v| mask.insert(v));
            }
        });
    }
}

/// A block whose field was continued.
struct Continued<'a> {
    block: &'a [i16],
    /// The samples before they were brought nearer to zero.
    before: &'a [i16],
    /// Corners of surface cells.
    surface: &'a VoxelMask,
    edge: BlockEdge,
}

impl Continued<'_> {
    /// Whether coding could turn a voxel that is no corner of a surface cell. How far a sample was brought
    /// nearer to zero counts against it, as bent fields are coded worst. Beside the surface only samples
    /// within the first voxel could turn, or pits would open where coding moves the surface.
    fn could_turn(&self, voxel: usize) -> bool {
        if self.surface.contains(voxel) {
            return false;
        }
        let mut beside_surface = false;
        for_each_neighbour(self.edge, voxel, |neighbour| beside_surface |= self.surface.contains(neighbour));
        let (now, before) = (self.block[voxel].abs(), self.before[voxel].abs());
        let reach = if beside_surface { SAFE } else { 2 * SAFE };
        now <= reach && 2 * now - before < SAFE
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

/// Brings samples nearer to zero that are too far from it beside their neighbours. No voxel is farther from
/// the surface than its neighbour by more than one voxel. The same bound holds towards a neighbour on the
/// other side. Free and hidden voxels, which are only known to lie beyond the band, come down to the field
/// around them.
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
