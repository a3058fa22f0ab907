//! A decoded volume sampled down.

use super::ReducedGrid;
use super::regroup::regroup;
use crate::main::extension::DecodedBlocks;
use isv_volume::SparseVolume;
use rayon::prelude::*;

/// A frame's volume in larger voxels: each is the mean of the voxels in it, in codes of the larger voxel, rounded half up.
///
/// Profile `main` is reduced so, after a full decode. Its levels are chosen for the surface alone, and the lowest of them do not
/// make a coarse field.
pub(crate) fn downsample(extended: &DecodedBlocks, reduced: &ReducedGrid) -> SparseVolume {
    let volume = extended.volume();
    let edge = volume.grid().edge;
    let (side, size) = (reduced.side(), reduced.lod.voxels() as usize);
    let mut samples = vec![0; volume.block_count() * side.pow(3)];
    samples.par_chunks_exact_mut(side.pow(3)).enumerate().for_each(|(block, out)| {
        let fine = volume.block(block);
        for (voxel, out) in out.iter_mut().enumerate() {
            let corner = [voxel % side, voxel / side % side, voxel / side / side].map(|c| size * c);
            let sum: i32 = (0..size.pow(3))
                .map(|i| {
                    let by = [i % size, i / size % size, i / size / size];
                    let [x, y, z] = [0, 1, 2].map(|axis| corner[axis] + by[axis]);
                    i32::from(fine[edge.voxel_index(x, y, z)])
                })
                .sum();
            // The mean of size^3 samples, of which a code is `size` times larger now.
            let shift = 4 * reduced.lod.reduction();
            let mean = (sum + (1 << shift >> 1)) >> shift;
            *out = mean.clamp(-i32::from(reduced.limit), i32::from(reduced.limit)) as i16;
        }
    });
    let coded = extended.sets().coded.marks_in(&extended.sets().all);
    regroup(reduced, volume.coords(), &samples, volume.unobserved_masks(), |block| !coded[block])
}
