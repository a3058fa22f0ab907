//! Where the surface is expected to be: the frame before, moved on as it was moving.

use super::{MainReference, Vector};
use isv_volume::{BlockCoord, BlockIndex};
use rayon::prelude::*;

/// Quarter voxels to a voxel.
const QUARTERS: i32 = 4;
/// Voxels of a block and the layer after it, along an axis.
const SIDE: usize = 9;
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

/// The activity of every block of the reference's volume, in its order.
#[must_use]
pub fn expected_activity(reference: &MainReference) -> Vec<Activity> {
    let volume = reference.volume();
    (0..volume.block_count())
        .into_par_iter()
        .map(|block| activity_at(reference, volume.coords()[block], drift(reference, block)))
        .collect()
}

/// The whole voxels by which the surface at a block is expected to go on moving: its vector, or the mean of those around it.
fn drift(reference: &MainReference, block: usize) -> [i32; 3] {
    let own = reference.coded_at(block).and_then(|coded| coded.vector);
    let (sum, count) = match own {
        Some(vector) => (vector.0.map(i32::from), 1),
        None => sum_around(reference, block),
    };
    // Rounded half up.
    sum.map(|s| if count == 0 { 0 } else { (2 * s + QUARTERS * count).div_euclid(2 * QUARTERS * count) })
}

/// Sum and number of the vectors in a block's neighbourhood.
fn sum_around(reference: &MainReference, block: usize) -> ([i32; 3], i32) {
    let around = reference.reference().index().neighbourhood(reference.volume().coords()[block]);
    let vectors = around.into_iter().flatten().filter_map(|n| reference.coded_at(n as usize)?.vector);
    vectors.fold(([0; 3], 0), |(sum, count), Vector(v)| {
        (std::array::from_fn(|axis| sum[axis] + i32::from(v[axis])), count + 1)
    })
}

/// Counts crossings in the reference at a block displaced by whole voxels, its far faces included.
fn activity_at(reference: &MainReference, coord: BlockCoord, drift: [i32; 3]) -> Activity {
    let window = window_at(reference, coord, drift);
    let mut found = Activity { crossings: 0, nearest: u16::MAX };
    for z in 0..SIDE - 1 {
        for y in 0..SIDE - 1 {
            for x in 0..SIDE - 1 {
                let at = (z * SIDE + y) * SIDE + x;
                let sample = window[at];
                if sample == UNKNOWN {
                    continue;
                }
                found.nearest = found.nearest.min(sample.unsigned_abs());
                for stride in [1, SIDE, SIDE * SIDE] {
                    let next = window[at + stride];
                    found.crossings += u16::from(next != UNKNOWN && (next < 0) != (sample < 0));
                }
            }
        }
    }
    found
}

/// The reference's samples at a block displaced by whole voxels, with one more layer, x fastest.
fn window_at(reference: &MainReference, coord: BlockCoord, drift: [i32; 3]) -> [i16; SIDE * SIDE * SIDE] {
    let (index, volume): (&BlockIndex, _) = (reference.reference().index(), reference.volume());
    let mut window = [UNKNOWN; SIDE * SIDE * SIDE];
    let blocks = drift.map(|d| d.div_euclid(8));
    let within = drift.map(|d| d.rem_euclid(8) as usize);
    // The window spans two blocks along each axis, or three samples of it: 9 voxels from `within` on.
    for slot in 0..8 {
        let step = [slot & 1, slot >> 1 & 1, slot >> 2];
        let offset = std::array::from_fn(|axis| blocks[axis] + step[axis] as i32);
        let Some(block) = index.get(coord.offset(offset)) else { continue };
        let samples = volume.block(block as usize);
        // Voxels of the window along an axis that this block has, and where they begin in it.
        let span = |axis: usize| {
            let split = 8 - within[axis];
            if step[axis] == 0 { (0..split.min(SIDE), within[axis]) } else { (split..SIDE, 0) }
        };
        let [(xs, x0), (ys, y0), (zs, z0)] = [span(0), span(1), span(2)];
        for z in zs.clone() {
            for y in ys.clone() {
                let from = ((z - zs.start + z0) * 8 + y - ys.start + y0) * 8 + x0;
                let to = (z * SIDE + y) * SIDE;
                window[to + xs.start..to + xs.end].copy_from_slice(&samples[from..from + xs.len()]);
            }
        }
    }
    window
}
