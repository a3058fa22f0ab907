//! Distances farther from the surface than was measured, continued outwards block by block.
//!
//! Distances grow by one a voxel along their gradient. The upwind discretisation of that gives a voxel's
//! distance from the smaller ones of its neighbours along each axis. It is that of Rouy & Tourin 1992, "A
//! viscosity solutions approach to shape-from-shading". Sweeps over the block, back and forth, settle it
//! (Zhao 2005, "A fast sweeping method for eikonal equations"). Distances come out a little too large. That
//! is good enough for voxels that the surface never sees: they want a sign and a slope.

use fearless_simd::{f32x8, prelude::*};

/// Voxels along the edge of a block.
const N: usize = 8;
/// Rows of voxels along x in a block.
const ROWS: usize = N * N;

/// Rows by the sums of y and z. Each comes after those that it looks back at, and not right after them, so
/// that it need not wait.
const DIAGONALS: [usize; ROWS] = {
    let (mut rows, mut place, mut sum) = ([0; ROWS], 0, 0);
    while sum < 2 * N - 1 {
        let mut row = 0;
        while row < ROWS {
            if row % N + row / N == sum {
                rows[place] = row;
                place += 1;
            }
            row += 1;
        }
        sum += 1;
    }
    rows
};

/// Farther than the far end of any block, and small enough for squares to be exact to a thousandth.
const UNKNOWN: f32 = 64.0;

/// Continues the distances of a block, x fastest, of which those up to `reach` are known. None of the others will be less than that.
#[inline(always)]
pub(crate) fn continue_outwards<S: Simd>(simd: S, distances: &mut [f32], reach: f32) {
    let rows = distances.as_chunks_mut::<N>().0;
    for row in &mut *rows {
        let distances = f32x8::simd_from(simd, *row);
        *row = distances.simd_le(reach).select(distances, f32x8::splat(simd, UNKNOWN)).into();
    }
    for place in 0..ROWS {
        settle(simd, rows, DIAGONALS[place], reach);
    }
    for place in (0..ROWS).rev() {
        settle(simd, rows, DIAGONALS[place], reach);
    }
}

/// Lowers the unknown distances of a row to what the rows around it and its own voxels say.
#[inline(always)]
fn settle<S: Simd>(simd: S, rows: &mut [[f32; N]], row: usize, reach: f32) {
    let own = f32x8::simd_from(simd, rows[row]);
    if own.simd_le(reach).all_true() {
        return;
    }
    let lower_of = |before: bool, after: bool, stride: usize| {
        let mut lower = f32x8::splat(simd, UNKNOWN);
        if before {
            lower = lower.min(f32x8::simd_from(simd, rows[row - stride]));
        }
        if after {
            lower = lower.min(f32x8::simd_from(simd, rows[row + stride]));
        }
        lower
    };
    let (y, z) = (row % N, row / N);
    let along = [beside::<S, 1, 7>(own), lower_of(y > 0, y + 1 < N, 1), lower_of(z > 0, z + 1 < N, N)];
    let lowest = own.min(upwind(along));
    // Straight along the row, however far.
    let lowest = lowest.min(beside::<S, 1, 7>(lowest) + 1.0);
    let lowest = lowest.min(beside::<S, 2, 6>(lowest) + 2.0);
    let lowest = lowest.min(beside::<S, 4, 4>(lowest) + 4.0);
    rows[row] = own.simd_le(reach).select(own, lowest.max(reach)).into();
}

/// For each voxel of a row, the lower distance of those `STEPS` before and after it. `REST` is 8 less that.
#[inline(always)]
fn beside<S: Simd, const STEPS: usize, const REST: usize>(row: f32x8<S>) -> f32x8<S> {
    let none = f32x8::splat(row.simd, UNKNOWN);
    row.slide::<STEPS>(none).min(none.slide::<REST>(row))
}

/// The distances of voxels from those of their neighbours along the three axes.
#[inline(always)]
fn upwind<S: Simd>([a, b, c]: [f32x8<S>; 3]) -> f32x8<S> {
    let (low, high) = (a.min(b), a.max(b));
    let (least, rest) = (low.min(c), low.max(c));
    let (middle, most) = (rest.min(high), rest.max(high));
    let one = least + 1.0;
    // Relative to the least: the numbers stay small.
    let (p, q) = (middle - least, most - least);
    let two = least + 0.5 * (p + (2.0 - p * p).max(0.0).sqrt());
    let sum = p + q;
    let three = least + (sum + (sum * sum - 3.0 * (p * p + q * q - 1.0)).max(0.0).sqrt()) * (1.0 / 3.0);
    let two_or_three = two.simd_le(most).select(two, three);
    one.simd_le(middle).select(one, two_or_three)
}
