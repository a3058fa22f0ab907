//! From the stream's blocks at reduced resolution to whole blocks of larger voxels.

use super::ReducedGrid;
use isv_volume::{BlockCoord, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// Puts the `2^3` (`4^3`) blocks of the stream that a block of larger voxels covers together.
///
/// A larger voxel is unobserved if half of its voxels or more are; in an extrapolated block, if any is. It is unobserved, too,
/// where no block of the stream is; samples are the truncation distance there.
///
/// `is_extrapolated`: whether a block was extrapolated. Its sign is a guess where it meets unobserved voxels. These are then one
/// layer, which tells that there is no surface between it and another guess. One layer can be less than half of a larger voxel.
pub(super) fn regroup(
    parameters: &ReducedGrid,
    coords: &[BlockCoord],
    samples: &[i16],
    unobserved: &BTreeMap<u32, VoxelMask>,
    is_extrapolated: impl Fn(usize) -> bool,
) -> SparseVolume {
    let edge = parameters.grid.edge;
    let voxels = parameters.side().pow(3);
    let group_of = |coord: &BlockCoord| coord.to_array().map(|c| c >> parameters.lod.reduction());
    let (mut groups, mut grouped, mut masks) = (Vec::new(), Vec::new(), BTreeMap::new());
    let mut block = 0;
    // The blocks of a group follow each other in Morton order.
    for members in coords.chunk_by(|a, b| group_of(a) == group_of(b)) {
        let start = grouped.len();
        grouped.resize(start + edge.block_voxels(), parameters.limit);
        let mut hidden = VoxelMask::full(edge);
        for coord in members {
            let place = Place::new(parameters, coord);
            place.copy_samples(&samples[block * voxels..][..voxels], &mut grouped[start..]);
            let enough = if is_extrapolated(block) { 1 } else { parameters.lod.voxels().pow(3).div_ceil(2) };
            place.mark_observed(unobserved.get(&(block as u32)), enough as usize, &mut hidden);
            block += 1;
        }
        if !hidden.is_empty() {
            masks.insert(groups.len() as u32, hidden);
        }
        groups.push(BlockCoord::from(group_of(&members[0])));
    }
    SparseVolume::from_parts(parameters.grid, groups, grouped, masks)
}

/// Place of a block of the stream in its group.
struct Place<'a> {
    parameters: &'a ReducedGrid,
    /// First voxel of the block in the group.
    corner: [usize; 3],
}

impl<'a> Place<'a> {
    fn new(parameters: &'a ReducedGrid, coord: &BlockCoord) -> Self {
        let in_group = coord.to_array().map(|c| c & (parameters.lod.voxels() as i32 - 1));
        Self { parameters, corner: in_group.map(|c| c as usize * parameters.side()) }
    }

    /// Index in the group of voxel `(x, y, z)` of the block.
    fn voxel(&self, [x, y, z]: [usize; 3]) -> usize {
        let [cx, cy, cz] = self.corner;
        self.parameters.grid.edge.voxel_index(cx + x, cy + y, cz + z)
    }

    fn copy_samples(&self, samples: &[i16], group: &mut [i16]) {
        let side = self.parameters.side();
        for (row, values) in samples.chunks_exact(side).enumerate() {
            let to = self.voxel([0, row % side, row / side]);
            group[to..to + side].copy_from_slice(values);
        }
    }

    /// Takes the voxels that were observed out of the group's mask. `unobserved`: the block's mask in the stream; `enough`: so many of
    /// its voxels in a larger one hide that.
    fn mark_observed(&self, unobserved: Option<&VoxelMask>, enough: usize, hidden: &mut VoxelMask) {
        let side = self.parameters.side();
        for voxel in 0..side.pow(3) {
            let at = [voxel % side, voxel / side % side, voxel / side / side];
            if unobserved.is_none_or(|mask| self.unobserved_within(mask, at) < enough) {
                hidden.remove(self.voxel(at));
            }
        }
    }

    /// How many of the stream's voxels in a larger one are unobserved.
    fn unobserved_within(&self, unobserved: &VoxelMask, at: [usize; 3]) -> usize {
        let (edge, size) = (self.parameters.grid.edge, self.parameters.lod.voxels() as usize);
        let is_unobserved = |i: &usize| {
            let by = [i % size, i / size % size, i / size / size];
            let [x, y, z] = [0, 1, 2].map(|axis| size * at[axis] + by[axis]);
            unobserved.contains(edge.voxel_index(x, y, z))
        };
        (0..size.pow(3)).filter(is_unobserved).count()
    }
}
