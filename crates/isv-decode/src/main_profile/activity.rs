//! Where the surface is expected to be: the frame before, moved on as it was moving.

use super::{MainReference, Missing, Vector, Window};
use isv_kernels::signs::inside;
use isv_kernels::simd::vectorized;
use isv_kernels::window::{SIDE, WindowRows};
use isv_volume::NeighbourFinder;
use rayon::prelude::*;

/// Quarter voxels to a voxel.
const QUARTERS: i32 = 4;
/// Stands for samples of blocks that are not there. No sample is as low.
const UNKNOWN: i16 = i16::MIN;

/// How much surface is expected in a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Activity {
    /// Edges between voxels of different sign.
    crossings: u16,
    /// Smallest distance from the surface, in codes.
    nearest: u16,
}

impl Activity {
    /// Classes of [`Self::class`].
    pub const CLASSES: usize = 9;
    /// Classes of [`Self::fine_class`].
    pub const FINE_CLASSES: usize = 37;

    /// Of a block that stays as it is.
    fn of_still(coded: bool) -> Self {
        Self { crossings: u16::from(coded), nearest: 0 }
    }

    /// Whether surface is expected at all.
    #[must_use]
    pub fn is_expected(self) -> bool {
        self.crossings > 0
    }

    /// 0 to 3 by the distance, 4 to 8 by the crossings.
    #[must_use]
    pub fn class(self) -> usize {
        match (self.crossings, self.nearest) {
            (0, 513..) => 0,
            (0, 257..) => 1,
            (0, 129..) => 2,
            (0, _) => 3,
            (..5, _) => 4,
            (..12, _) => 5,
            (..30, _) => 6,
            (..70, _) => 7,
            _ => 8,
        }
    }

    /// 0 to 15 by the distance in quarter voxels, 16 to 36 by the crossings in fours.
    #[must_use]
    pub fn fine_class(self) -> usize {
        match self.crossings {
            0 => usize::from(self.nearest / 64).min(15),
            crossings => 16 + usize::from(crossings / 4).min(20),
        }
    }
}

/// The activity of every block of the reference's volume, in its order. Where blocks are marked to stay as they are, surface is
/// expected in those that were coded.
#[must_use]
pub fn expected_activity(reference: &MainReference, still: &[bool]) -> Vec<Activity> {
    // Both ways give the same for blocks that stand still, and of a scene that moves, or whose still cells are told, there are
    // few.
    let own_motion = (0..still.len()).filter(|block| moves(reference, *block)).count();
    let (moving, stills) = match 8 * own_motion < still.len() && !still.contains(&true) {
        true => (moving_blocks(reference), stills(reference)),
        false => (Vec::new(), Vec::new()),
    };
    let activity = |(window, finder): &mut (Window, NeighbourFinder), (block, still): (usize, &bool)| {
        if *still {
            return Activity::of_still(reference.coded_at(block).is_some());
        }
        finder.turn_to(reference.volume().coords()[block]);
        match moving.get(block) {
            Some(false) => activity_standing(block, &stills, finder),
            _ => activity_in(window_ahead(reference, block, window, finder)),
        }
    };
    let blocks = still.par_iter().enumerate();
    blocks.map_init(|| (Window::default(), reference.finder()), activity).collect()
}

/// Whether a block has a vector other than zero.
fn moves(reference: &MainReference, block: usize) -> bool {
    let vector = reference.coded_at(block).and_then(|coded| coded.vector);
    vector.is_some_and(|vector| vector != Vector::ZERO)
}

/// For each block, whether it or one around it has a vector other than zero. The others are expected to stay where they are.
fn moving_blocks(reference: &MainReference) -> Vec<bool> {
    let coords = reference.volume().coords();
    let (mut moving, mut finder) = (vec![false; coords.len()], reference.finder());
    for (block, coord) in coords.iter().enumerate() {
        if moves(reference, block) {
            finder.turn_to(*coord);
            finder.neighbourhood().iter().flatten().for_each(|block| moving[*block as usize] = true);
        }
    }
    moving
}

/// What the activity of a block that stays where it is takes of it and of those after it.
#[derive(Clone, Copy, Debug)]
struct Still {
    /// Which voxels lie inside, a word a z.
    inside: [u64; 8],
    /// Smallest distance from the surface, in codes.
    nearest: u16,
}

fn stills(reference: &MainReference) -> Vec<Still> {
    let still = |samples: &[i16; 512]| Still { inside: inside(samples), nearest: nearest(samples) };
    let volume = reference.volume();
    let samples = |block| volume.block(block).try_into().expect("blocks of an edge of 8");
    (0..volume.block_count()).into_par_iter().map(|block| still(samples(block))).collect()
}

/// Smallest magnitude.
fn nearest(samples: &[i16; 512]) -> u16 {
    vectorized(
        #[inline(always)]
        || {
            let mut nearest = [u16::MAX; 16];
            for samples in samples.as_chunks::<16>().0 {
                for lane in 0..16 {
                    nearest[lane] = nearest[lane].min(samples[lane].unsigned_abs());
                }
            }
            nearest.into_iter().fold(u16::MAX, u16::min)
        },
    )
}

/// [`activity_in`] the window that begins with a block. `finder`: at the block.
fn activity_standing(block: usize, stills: &[Still], finder: &NeighbourFinder) -> Activity {
    /// Voxels that have another one after them along x and y in their block, and the first along x.
    const BEFORE_LAST: [u64; 2] = [0x7f7f_7f7f_7f7f_7f7f, !0 >> 8];
    const FIRST_X: u64 = 0x0101_0101_0101_0101;
    let Still { inside, nearest } = &stills[block];
    // Where there is no block, no voxel differs from the last ones before it.
    let after = |slot: usize| finder.get(slot).map(|block| &stills[block as usize].inside);
    let [x, y, z] = [14, 16, 22].map(after);
    let mut crossings = z.map_or(0, |z| (inside[7] ^ z[0]).count_ones());
    for (layer, word) in inside.iter().enumerate() {
        let differs = [word ^ word >> 1, word ^ word >> 8];
        crossings += (differs[0] & BEFORE_LAST[0]).count_ones() + (differs[1] & BEFORE_LAST[1]).count_ones();
        crossings += x.map_or(0, |x| ((word >> 7 ^ x[layer]) & FIRST_X).count_ones());
        crossings += y.map_or(0, |y| ((word >> 56 ^ y[layer]) & 0xff).count_ones());
    }
    crossings += inside.windows(2).map(|pair| (pair[0] ^ pair[1]).count_ones()).sum::<u32>();
    Activity { crossings: crossings as u16, nearest: *nearest }
}

/// The reference where the surface at a block is expected to come from. `finder`: at the block.
fn window_ahead<'a>(
    reference: &MainReference,
    block: usize,
    window: &'a mut Window,
    finder: &NeighbourFinder,
) -> &'a WindowRows {
    let (coord, drift) = (reference.volume().coords()[block].to_array(), drift(reference, block, finder));
    let first = std::array::from_fn(|axis| 8 * coord[axis] + drift[axis]);
    window.look_at(reference, first, Missing::Sample(UNKNOWN));
    window.rows()
}

/// The whole voxels by which the surface at a block is expected to go on moving: its vector, or the mean of those around it.
fn drift(reference: &MainReference, block: usize, finder: &NeighbourFinder) -> [i32; 3] {
    let own = reference.coded_at(block).and_then(|coded| coded.vector);
    let (sum, count) = match own {
        Some(vector) => (vector.0.map(i32::from), 1),
        None => sum_around(reference, finder),
    };
    // Rounded half up.
    sum.map(|s| if count == 0 { 0 } else { (2 * s + QUARTERS * count).div_euclid(2 * QUARTERS * count) })
}

/// Sum and number of the vectors in a block's neighbourhood.
fn sum_around(reference: &MainReference, finder: &NeighbourFinder) -> ([i32; 3], i32) {
    let around = finder.neighbourhood();
    let vectors = around.iter().flatten().filter_map(|n| reference.coded_at(*n as usize)?.vector);
    vectors.fold(([0; 3], 0), |(sum, count), Vector(v)| {
        (std::array::from_fn(|axis| sum[axis] + i32::from(v[axis])), count + 1)
    })
}

/// Counts crossings in a window, its far faces included.
fn activity_in(window: &WindowRows) -> Activity {
    vectorized(
        #[inline(always)]
        || {
            let (mut nearest, mut crossings) = ([u16::MAX; 8], [0u16; 8]);
            for row in (0..8).flat_map(|z| (0..8).map(move |y| z * SIDE + y)) {
                let samples = window.eight(row, 0);
                let after = [window.eight(row, 1), window.eight(row + 1, 0), window.eight(row + SIDE, 0)];
                for lane in 0..8 {
                    let sample = samples[lane];
                    let known = sample != UNKNOWN;
                    let distance = if known { sample.unsigned_abs() } else { u16::MAX };
                    nearest[lane] = nearest[lane].min(distance);
                    for next in after {
                        let differs = (next[lane] ^ sample) < 0;
                        crossings[lane] += u16::from(known & (next[lane] != UNKNOWN) & differs);
                    }
                }
            }
            let nearest = nearest.into_iter().fold(u16::MAX, u16::min);
            Activity { crossings: crossings.iter().sum(), nearest }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reference;
    use crate::extension::{Extended, FrameBlocks};
    use crate::main_profile::FrameSymbols;
    use isv_volume::{BlockCoord, BlockEdge, BlockSet, Grid, SparseVolume, Truncation, VoxelSize};
    use std::collections::BTreeMap;

    /// Blocks of noise, some of whose neighbours are missing: by signs as by the window.
    #[test]
    fn what_stands_still_has_the_activity_of_its_window() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(8).unwrap(),
        };
        let all = (0..216).map(|i| BlockCoord::from([i % 6 - 3, i / 6 % 6 - 3, i / 36 - 3]));
        let mut coords: Vec<_> = all.filter(|c| (c.x * 5 + c.y * 3 + c.z) % 4 != 0).collect();
        coords.sort_unstable_by_key(|coord| coord.morton());
        // Some blocks hardly leave one side, others are all noise.
        let sample = |i: usize| {
            let (block, noise) = (i / 512, (i as u32).wrapping_mul(2_654_435_761) >> 20);
            (noise as i16 - 2048) / (1 + block % 5) as i16 + (block % 3 * 400) as i16
        };
        let samples = (0..coords.len() * 512).map(|i| sample(i).clamp(-2048, 2048)).collect();
        let volume = SparseVolume::from_parts(grid, coords, samples, BTreeMap::new());
        let all = BlockSet::of(volume.coords());
        let blocks = FrameBlocks { all, ..FrameBlocks::default() };
        let extended = Extended { reference: Reference::new(volume), blocks };
        let reference = MainReference::new(extended, FrameSymbols::default(), BTreeMap::new());
        let (mut window, mut finder) = (Window::default(), reference.finder());
        let (stills, found) = (
            stills(&reference),
            expected_activity(&reference, &vec![false; reference.volume().block_count()]),
        );
        for (block, found) in found.into_iter().enumerate() {
            finder.turn_to(reference.volume().coords()[block]);
            let expected = activity_in(window_ahead(&reference, block, &mut window, &finder));
            assert_eq!(activity_standing(block, &stills, &finder), expected);
            assert_eq!(found, expected);
        }
    }
}
