//! What a frame's blocks are to become, and how much each voxel matters.

use super::encoder::Band;
use isv_volume::{BlockCoord, BlockIndex, CODES_PER_VOXEL, SparseVolume, VoxelMask};
use rayon::prelude::*;

/// Samples of a block in voxels.
pub(crate) type Field = [f32; 512];

/// Weight of voxels at the ends of edges that the surface crosses: marching cubes reads those and no others.
const CROSSED: f32 = 1.0;
/// Weight of all other observed voxels, and of unobserved ones.
const FAR: f32 = 0.001;
const UNOBSERVED: f32 = 0.0005;
/// Weight of every voxel when the whole band is wanted.
const WHOLE_BAND: f32 = 0.25;
/// Voxels this near to the surface, in voxels, tell of its motion, with at least this weight.
const NEAR: f32 = 1.5;
const NEAR_WEIGHT: f32 = 0.3;

/// A voxel that tells of motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearVoxel {
    /// Where it is in the block.
    pub voxel: u16,
    /// Where it is in a stitched neighbourhood, from the block's first voxel on.
    pub offset: usize,
    /// Its sample in voxels.
    pub sample: f32,
    pub weight: f32,
}

/// What one block is to become.
#[derive(Clone, Debug)]
pub(crate) struct BlockTarget {
    pub coord: BlockCoord,
    pub samples: Field,
    /// Weight of each voxel's squared error.
    pub weights: Field,
    /// Voxels whose samples do not matter as long as they keep their sign.
    pub only_sign: VoxelMask,
    pub near: Vec<NearVoxel>,
}

/// The blocks of a volume that are coded, in Morton order: those that the surface touches, or all.
pub(crate) fn targets(volume: &SparseVolume, band: Band) -> Vec<BlockTarget> {
    let index = volume.index();
    let blocks = (0..volume.block_count()).into_par_iter();
    blocks.filter_map(|block| target(volume, &index, block, band)).collect()
}

fn target(volume: &SparseVolume, index: &BlockIndex, block: usize, band: Band) -> Option<BlockTarget> {
    let crossed = crossed_voxels(volume, index, block);
    if crossed.is_empty() && band == Band::Surface {
        return None;
    }
    let mask = volume.unobserved(block);
    let (mut samples, mut weights) = ([0.0; 512], [0.0; 512]);
    let mut only_sign = VoxelMask::empty(volume.grid().edge);
    let mut near = Vec::new();
    for (voxel, code) in volume.block(block).iter().enumerate() {
        let sample = f32::from(*code) / CODES_PER_VOXEL as f32;
        let unobserved = mask.is_some_and(|mask| mask.contains(voxel));
        samples[voxel] = sample;
        weights[voxel] = match band {
            _ if unobserved => UNOBSERVED,
            _ if crossed.contains(voxel) => CROSSED,
            Band::Full => WHOLE_BAND,
            Band::Surface => {
                only_sign.insert(voxel);
                FAR
            }
        };
        if !unobserved && (crossed.contains(voxel) || sample.abs() < NEAR) {
            let offset = (voxel / 64 * 24 + voxel / 8 % 8) * 24 + voxel % 8;
            near.push(NearVoxel {
                voxel: voxel as u16,
                offset,
                sample,
                weight: weights[voxel].max(NEAR_WEIGHT),
            });
        }
    }
    Some(BlockTarget { coord: volume.coords()[block], samples, weights, only_sign, near })
}

/// The observed voxels of a block with an observed face neighbour of the other sign.
fn crossed_voxels(volume: &SparseVolume, index: &BlockIndex, block: usize) -> VoxelMask {
    let mut crossed = VoxelMask::empty(volume.grid().edge);
    let samples = volume.block(block);
    let mask = volume.unobserved(block);
    let observed = |mask: Option<&VoxelMask>, voxel: usize| !mask.is_some_and(|mask| mask.contains(voxel));
    let coord = volume.coords()[block];
    for (axis, stride) in [1usize, 8, 64].into_iter().enumerate() {
        let step = |by: i32| coord.offset(std::array::from_fn(|a| if a == axis { by } else { 0 }));
        let [before, after] = [-1, 1].map(|by| index.get(step(by)).map(|block| block as usize));
        for voxel in (0..512).filter(|voxel| observed(mask, *voxel)) {
            let inside = samples[voxel] < 0;
            let place = voxel / stride % 8;
            let differs = |block: Option<usize>, voxel: usize| {
                block.is_some_and(|block| {
                    (volume.block(block)[voxel] < 0) != inside && observed(volume.unobserved(block), voxel)
                })
            };
            let (below, above) = match place {
                0 => (differs(before, voxel + 7 * stride), differs(Some(block), voxel + stride)),
                7 => (differs(Some(block), voxel - stride), differs(after, voxel - 7 * stride)),
                _ => (differs(Some(block), voxel - stride), differs(Some(block), voxel + stride)),
            };
            if below || above {
                crossed.insert(voxel);
            }
        }
    }
    crossed
}
