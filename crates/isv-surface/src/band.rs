//! The blocks that a surface needs.

use crate::bits::{PaddedBits, SignRows};
use isv_volume::{BlockEdge, Neighbourhood, SparseVolume};
use rayon::prelude::*;

/// The volume without the blocks that its surface does not need: what stays are the blocks with a voxel at most one voxel
/// (along every axis) away from a corner of a cell that the surface crosses.
///
/// [`extract_surface`](crate::extract_surface) gives the same mesh, bit for bit, with its normals. The voxel of margin is
/// what the normals read, and it leaves room for a codec to move the surface by as much without tearing it. What is lost
/// is the distance farther away, out to the truncation.
#[must_use]
pub fn surface_band(volume: &SparseVolume) -> SparseVolume {
    let signs = SignRows::new(volume);
    let index = volume.index();
    let needed: Vec<(Neighbourhood, Slots)> = volume
        .coords()
        .par_iter()
        .filter_map(|&coord| {
            let around = index.neighbourhood(coord);
            let slots = if signs.may_cross(&around) {
                needed_slots(&PaddedBits::gather(&signs, &around), volume.grid().edge)
            } else {
                0
            };
            (slots != 0).then_some((around, slots))
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
    volume.select(|block| keep[block])
}

/// Slots of a [`Neighbourhood`], one bit each.
type Slots = u32;

/// The blocks that the crossed cells of the middle block reach with a voxel of margin.
fn needed_slots(bits: &PaddedBits, edge: BlockEdge) -> Slots {
    let side = edge.voxels();
    let mut slots = 0;
    for z in 0..side {
        for y in 0..side {
            let cells = bits.crossed_cells(y, z);
            if cells == 0 {
                continue;
            }
            let along_x = [cells & 1 != 0, true, cells >> (side - 2) != 0];
            for (dz, near_z) in reach(z, side).into_iter().enumerate() {
                for (dy, near_y) in reach(y, side).into_iter().enumerate() {
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
