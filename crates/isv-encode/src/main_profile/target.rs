//! What a frame's blocks are to become, and how much each voxel matters.

use super::encoder::Band;
use super::tools::Tools;
use isv_volume::{BlockCoord, BlockIndex, CODES_PER_VOXEL, SparseVolume, VoxelMask};
use rayon::prelude::*;

/// Samples of a block in voxels.
pub(crate) type Field = [f32; 512];

/// Weight of voxels at the ends of edges that the surface crosses: marching cubes reads those and no others.
const CROSSED: f32 = 1.0;
/// Weight of all other observed voxels, and of unobserved ones.
const FAR: f32 = 0.001;
/// The former, where signs are not guarded.
const FAR_UNGUARDED: f32 = 0.01;
const UNOBSERVED: f32 = 0.0005;
/// Weight of every voxel when the whole band is wanted.
const WHOLE_BAND: f32 = 0.25;
/// Voxels this near to the surface, in voxels, tell of its motion, with at least this weight.
const NEAR: f32 = 1.5;
const NEAR_WEIGHT: f32 = 0.3;

/// Eight voxels along x of which some tell of motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearRow {
    /// Which row of the block: `8 z + y`.
    pub row: usize,
    /// Their samples in voxels.
    pub samples: [f32; 8],
    /// Their weights, 0 where they tell nothing.
    pub weights: [f32; 8],
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
    pub near: Vec<NearRow>,
}

/// The blocks of a volume that are coded, in Morton order: those that the surface touches, or all.
pub(crate) fn targets(volume: &SparseVolume, band: Band, tools: Tools) -> Vec<BlockTarget> {
    let index = volume.index();
    let blocks = (0..volume.block_count()).into_par_iter();
    blocks.filter_map(|block| target(volume, &index, block, band, tools)).collect()
}

fn target(
    volume: &SparseVolume,
    index: &BlockIndex,
    block: usize,
    band: Band,
    tools: Tools,
) -> Option<BlockTarget> {
    let crossed = crossed_voxels(volume, index, block);
    if crossed.is_empty() && band == Band::Surface {
        return None;
    }
    let mask = volume.unobserved(block);
    let (mut samples, mut weights) = ([0.0; 512], [0.0; 512]);
    let mut only_sign = VoxelMask::empty(volume.grid().edge);
    let mut near = Vec::with_capacity(64);
    for (row, codes) in volume.block(block).as_chunks::<8>().0.iter().enumerate() {
        let mut near_row = NearRow { row, samples: [0.0; 8], weights: [0.0; 8] };
        let byte = |mask: &VoxelMask| mask.words()[row / 8] >> (8 * (row % 8)) & 255;
        let (crossed, unobserved) = (byte(&crossed), mask.map_or(0, byte));
        for lane in 0..8 {
            let sample = f32::from(codes[lane]) / CODES_PER_VOXEL as f32;
            let [crossed, unobserved] = [crossed, unobserved].map(|bits| bits >> lane & 1 != 0);
            let weight = match band {
                _ if unobserved => UNOBSERVED,
                _ if crossed => CROSSED,
                Band::Full => WHOLE_BAND,
                Band::Surface if !tools.weights => CROSSED,
                Band::Surface if !tools.signs => FAR_UNGUARDED,
                Band::Surface => {
                    only_sign.insert(8 * row + lane);
                    FAR
                }
            };
            (samples[8 * row + lane], weights[8 * row + lane]) = (sample, weight);
            near_row.samples[lane] = sample;
            if !unobserved && (crossed || sample.abs() < NEAR) {
                near_row.weights[lane] = weight.max(NEAR_WEIGHT);
            }
        }
        if near_row.weights != [0.0; 8] {
            near.push(near_row);
        }
    }
    Some(BlockTarget { coord: volume.coords()[block], samples, weights, only_sign, near })
}

/// The observed voxels of a block with an observed face neighbour of the other sign.
///
/// A word holds one z, a bit a voxel: neighbours along x and y are a shift away, along z the next word.
fn crossed_voxels(volume: &SparseVolume, index: &BlockIndex, block: usize) -> VoxelMask {
    let coord = volume.coords()[block];
    let own = signs(volume, block);
    let mut words = [0; 8];
    for (axis, stride) in [1u32, 8, 64].into_iter().enumerate() {
        let at = |by: i32| coord.offset(std::array::from_fn(|a| if a == axis { by } else { 0 }));
        let beside = |by: i32| index.get(at(by)).map_or([(0, 0); 8], |block| signs(volume, block as usize));
        let (before, after) = (beside(-1), beside(1));
        // Lanes that have a neighbour below in the block.
        let inner: u64 = [!0x0101_0101_0101_0101, !0xff, 0][axis];
        for z in 0..8 {
            let below = |part: fn((u64, u64)) -> u64| match axis {
                2 => part(if z > 0 { own[z - 1] } else { before[7] }),
                _ => part(own[z]) << stride & inner | part(before[z]) >> (7 * stride) & !inner,
            };
            let above = |part: fn((u64, u64)) -> u64| match axis {
                2 => part(if z < 7 { own[z + 1] } else { after[0] }),
                _ => {
                    part(own[z]) >> stride & (inner >> stride)
                        | part(after[z]) << (7 * stride) & !(inner >> stride)
                }
            };
            let (inside, observed) = own[z];
            let differs = |beside: [u64; 2]| (inside ^ beside[0]) & observed & beside[1];
            words[z] |= differs([below(|s| s.0), below(|s| s.1)]) | differs([above(|s| s.0), above(|s| s.1)]);
        }
    }
    let mut crossed = VoxelMask::empty(volume.grid().edge);
    for (z, word) in words.iter().enumerate() {
        (0..64).filter(|bit| word >> bit & 1 != 0).for_each(|bit| crossed.insert(64 * z + bit));
    }
    crossed
}

/// Which voxels of a block lie inside, and which are observed: a word a z.
fn signs(volume: &SparseVolume, block: usize) -> [(u64, u64); 8] {
    let mut words = [(0, !0); 8];
    for (samples, (inside, _)) in volume.block(block).as_chunks::<64>().0.iter().zip(&mut words) {
        for (bit, sample) in samples.iter().enumerate() {
            *inside |= u64::from(*sample < 0) << bit;
        }
    }
    if let Some(mask) = volume.unobserved(block) {
        words.iter_mut().zip(mask.words()).for_each(|((_, observed), unobserved)| *observed = !unobserved);
    }
    words
}
