//! Where the surface is expected to be: the frame before, moved on as it was moving.

use super::{MainReference, Missing, Vector, Window};
use isv_kernels::simd::vectorized;
use isv_kernels::window::{SIDE, WindowRows};
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
        .map_init(Window::default, |window, block| {
            let (coord, drift) = (volume.coords()[block].to_array(), drift(reference, block));
            let first = std::array::from_fn(|axis| 8 * coord[axis] + drift[axis]);
            window.look_at(reference, first, Missing::Sample(UNKNOWN));
            activity_in(window.rows())
        })
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
    let around = reference.around(block).iter().flatten();
    let vectors = around.filter_map(|n| reference.coded_at(*n as usize)?.vector);
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
