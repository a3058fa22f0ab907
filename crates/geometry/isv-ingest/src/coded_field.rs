//! The field of a decoded frame whose stream coded more than the surface.

use isv_volume::{BlockIndex, BlockSet, CODES_PER_VOXEL, SparseVolume, VoxelMask};
use std::collections::BTreeMap;

/// A coded block whose samples are all farther from the surface than this (voxels) was not coded for the surface.
const FAR_VOXELS: i32 = 3;
/// Distance in quarters of the truncation, used instead of [`FAR_VOXELS`] if it is less.
const FAR_QUARTERS: i32 = 3;
/// A stream of the full band has more than one such block in so many. One of the surface band has none but for what coarse
/// steps erase.
const COMMONNESS: usize = 64;

/// The field of a frame of profile `main` that was coded with the full band; `None` if only blocks at the surface were coded.
///
/// The coded blocks keep their samples, and their voxels stay observed unless a mask says otherwise. The decoder made up all other
/// blocks: they are left out, but for voxels that its surface needs.
///
/// `coded`: the blocks of the full resolution that were coded. Volumes of a lower one have too few blocks to tell by, and give `None`.
#[must_use]
pub fn coded_field(volume: &SparseVolume, coded: &BlockSet) -> Option<SparseVolume> {
    let is_coded = marks_of(volume, coded)?;
    let blocks = (0..volume.block_count()).filter(|block| is_coded[*block]);
    let limit = i32::from(volume.grid().truncation.codes());
    let far = (FAR_VOXELS * i32::from(CODES_PER_VOXEL as i16)).min(limit * FAR_QUARTERS / 4);
    let far_blocks = blocks.filter(|block| is_far(volume.block(*block), far)).count();
    let coded_blocks = is_coded.iter().filter(|coded| **coded).count();
    if far_blocks * COMMONNESS <= coded_blocks {
        return None;
    }
    let index = volume.index();
    let mut kept = is_coded.clone();
    let mut masks = BTreeMap::new();
    for block in (0..volume.block_count()).filter(|block| !is_coded[*block]) {
        let needed = needed_voxels(volume, &index, block);
        if needed.count() > 0 {
            kept[block] = true;
            let mut mask = VoxelMask::full(volume.grid().edge);
            (0..volume.grid().edge.block_voxels())
                .filter(|voxel| needed.contains(*voxel))
                .for_each(|voxel| mask.remove(voxel));
            masks.insert(block as u32, mask);
        }
    }
    let mut field = volume.clone();
    masks.retain(|_, mask| !mask.is_empty());
    field.add_unobserved(masks);
    Some(field.select(|block| kept[block]))
}

/// For each block of a volume, whether it was coded. `None` if no block was, or the volume has not all of those that were.
fn marks_of(volume: &SparseVolume, coded: &BlockSet) -> Option<Vec<bool>> {
    let all = BlockSet::from_coords(volume.coords());
    let is_whole = !coded.is_empty() && coded.difference(&all).is_empty();
    is_whole.then(|| coded.marks_in(&all))
}

/// Whether all samples lie on one side, so many codes from the surface or more.
fn is_far(samples: &[i16], far: i32) -> bool {
    let inside = samples[0] < 0;
    samples.iter().all(|sample| (*sample < 0) == inside && i32::from(*sample).abs() >= far)
}

/// The observed voxels of a block with an observed voxel of the other sign beside them, across a face, an edge or a corner.
fn needed_voxels(volume: &SparseVolume, index: &BlockIndex, block: usize) -> VoxelMask {
    let edge = volume.grid().edge;
    let side = edge.voxels() as i32;
    let coord = volume.coords()[block];
    let around = index.neighbourhood(coord);
    let inside = volume.block(block)[0] < 0;
    let mut needed = VoxelMask::empty(edge);
    let opposed = |block: u32| volume.block(block as usize).iter().any(|sample| (*sample < 0) != inside);
    // Blocks that were made up have one sign.
    if !around.iter().flatten().any(|block| opposed(*block)) {
        return needed;
    }
    let is_inside = |at: [i32; 3]| {
        let slot = at.map(|c| c.div_euclid(side) + 1);
        let block = around[(9 * slot[2] + 3 * slot[1] + slot[0]) as usize]? as usize;
        let [x, y, z] = at.map(|c| c.rem_euclid(side) as usize);
        let voxel = edge.voxel_index(x, y, z);
        let observed = volume.unobserved(block).is_none_or(|mask| !mask.contains(voxel));
        observed.then(|| volume.block(block)[voxel] < 0)
    };
    for voxel in 0..edge.block_voxels() {
        let n = edge.voxels();
        let at = [voxel % n, voxel / n % n, voxel / n / n].map(|c| c as i32);
        let beside = |step: i32| {
            let step = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
            is_inside(std::array::from_fn(|axis| at[axis] + step[axis]))
        };
        if is_inside(at).is_some_and(|own| (0..27).any(|step| beside(step) == Some(!own))) {
            needed.insert(voxel);
        }
    }
    needed
}
