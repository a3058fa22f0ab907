//! The blocks that a surface needs.

use crate::signs::Signs;
use crate::window::SignWindow;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockEdge, Neighbourhood, SparseVolume};
use rayon::prelude::*;

/// The volume without the blocks that its surface does not need. Blocks stay that have a voxel at most one
/// voxel (along every axis) away from a corner of a cell that the surface crosses.
///
/// [`extract_surface`](crate::extract_surface) gives the same mesh, bit for bit, with its normals. The voxel
/// of margin is what the normals read. It leaves room for a codec to move the surface by as much without
/// tearing it. What is lost is the distance farther away, out to the truncation.
#[must_use]
pub fn surface_band(volume: &SparseVolume) -> SparseVolume {
    let keep = match volume.grid().edge {
        BlockEdge::E4 => needed_blocks::<4>(volume),
        BlockEdge::E8 => needed_blocks::<8>(volume),
        BlockEdge::E16 => needed_blocks::<16>(volume),
    };
    volume.select(|block| keep[block])
}

/// Which blocks stay.
fn needed_blocks<const SIDE: usize>(volume: &SparseVolume) -> Vec<bool> {
    let signs = Signs::<SIDE>::new(volume);
    let index = volume.index();
    let crossed = signs.crossed_blocks(volume, &index);
    let needed: Vec<(Neighbourhood, Slots)> = crossed
        .par_iter()
        .map(|&block| {
            let around = index.neighbourhood(volume.coords()[block as usize]);
            let slots = vectorized(
                #[inline(always)]
                || needed_slots(&SignWindow::gather(&signs, &around)),
            );
            (around, slots)
        })
        .collect();
    let mut keep = vec![false; volume.block_count()];
    for (around, slots) in needed {
        for (slot, block) in around.into_iter().enumerate() {
            if let Some(block) = block.filter(|_| slots >> slot & 1 != 0) {
                keep[block as usize] = true;
            }
        }
    }
    keep
}

/// Slots of a [`Neighbourhood`], one bit each.
type Slots = u32;

/// The blocks that the crossed cells of the middle block reach with a voxel of margin.
#[inline(always)]
fn needed_slots<const SIDE: usize>(window: &SignWindow<SIDE>) -> Slots {
    let mut slots = 0;
    for z in 0..SIDE {
        for (y, cells) in window.crossed_cells(z).into_iter().enumerate() {
            if cells == 0 {
                continue;
            }
            let along_x = [cells & 1 != 0, true, cells >> (SIDE - 2) != 0];
            for (dz, near_z) in reach(z, SIDE).into_iter().enumerate() {
                for (dy, near_y) in reach(y, SIDE).into_iter().enumerate() {
                    for (dx, near_x) in along_x.into_iter().enumerate() {
                        slots |= Slots::from(near_x && near_y && near_z) << (9 * dz + 3 * dy + dx);
                    }
                }
            }
        }
    }
    slots
}

/// Whether a cell, which spans two voxels from `cell` on, comes within a voxel of the block before, this one, and the next.
fn reach(cell: usize, side: usize) -> [bool; 3] {
    [cell == 0, true, cell + 2 >= side]
}
