//! Cells and their corners, a bit each. A cell is named by its lowest corner, so its corners lie in that voxel's block and in the
//! seven after it, its octet.

use crate::ReferenceBlocks;
use crate::main::extension::FrameBlocks;
use isv_volume::{NeighbourFinder, VoxelMask};
use std::collections::{BTreeMap, BTreeSet};

/// A bit a voxel of a block: a word for each layer along z, x fastest.
pub type Bits = [u64; 8];

/// The first voxel of each row of a layer, and the last.
const FIRST: u64 = 0x0101_0101_0101_0101;
const LAST: u64 = FIRST << 7;

/// The corners of a block's cells, in each block of its octet.
fn corners(cells: &Bits) -> [Bits; 8] {
    let mut corners = [[0; 8]; 8];
    for (z, layer) in cells.iter().enumerate() {
        corners[0][z] = layer | layer << 1 & !FIRST;
        corners[1][z] = layer >> 7 & FIRST;
    }
    for along_x in 0..2 {
        for z in 0..8 {
            let layer = corners[along_x][z];
            corners[along_x][z] = layer | layer << 8;
            corners[along_x + 2][z] = layer >> 56;
        }
    }
    for along_xy in 0..4 {
        let layers = corners[along_xy];
        corners[along_xy + 4][0] = layers[7];
        for z in 1..8 {
            corners[along_xy][z] |= layers[z - 1];
        }
    }
    corners
}

/// The cells of a block with a corner among some voxels of its octet.
#[must_use]
pub fn cells_touching(octet: [&Bits; 8]) -> Bits {
    std::array::from_fn(|z| {
        let along_z =
            |slot: usize| octet[slot][z] | if z < 7 { octet[slot][z + 1] } else { octet[slot + 4][0] };
        let along_yz = |slot: usize| {
            let (own, next) = (along_z(slot), along_z(slot + 2));
            own | own >> 8 | next << 56
        };
        let (own, next) = (along_yz(0), along_yz(1));
        own | own >> 1 & !LAST | next << 7 & LAST
    })
}

/// The cells of a block with a corner in a block of its octet that counts.
pub(crate) fn reaching(octet: [bool; 8]) -> Bits {
    match octet {
        [true, ..] => [!0; 8],
        octet if !octet.contains(&true) => [0; 8],
        octet => cells_touching(octet.map(|counts| if counts { &[!0; 8] } else { &[0; 8] })),
    }
}

/// From the cells that have a corner in an unsettled block to these corners.
#[derive(Debug)]
pub struct CellCorners<'a> {
    frame: ReferenceBlocks<'a>,
    finder: NeighbourFinder<'a>,
    unsettled: Vec<bool>,
}

impl<'a> CellCorners<'a> {
    /// Looks for the corners of a frame's cells. `sets`: the frame's blocks.
    #[must_use]
    pub fn new(frame: ReferenceBlocks<'a>, sets: &FrameBlocks) -> Self {
        Self {
            frame,
            finder: NeighbourFinder::new(frame.index),
            unsettled: sets.unsettled.marks_in(&sets.all),
        }
    }

    /// The unsettled blocks that cells have corners in, in order, with these voxels: where all crossed cells are given,
    /// [`crossed_corners`](super::crossed_cells::crossed_corners). `cells`: by block, in order.
    #[must_use]
    pub fn of_cells(&mut self, cells: &[(u32, VoxelMask)]) -> Vec<(u32, VoxelMask)> {
        let blocks = self.reached(cells.iter().map(|(block, _)| *block));
        let within =
            |block| (block, VoxelMask::from_words(&self.within(block, |block| bits_of(cells, block))));
        blocks.into_iter().map(within).filter(|(_, corners)| !corners.is_empty()).collect()
    }

    /// The voxels of unsettled blocks that are corners of cells, but of none that is drawn. `cells`: by block, in order;
    /// `undrawn`: those of them that are not drawn.
    #[must_use]
    pub fn of_undrawn(
        &mut self,
        cells: &[(u32, VoxelMask)],
        undrawn: &BTreeMap<u32, Bits>,
    ) -> BTreeMap<u32, VoxelMask> {
        let undrawn_in = |block: u32| undrawn.get(&block).copied().unwrap_or_default();
        let drawn_in = |block: u32| {
            let (cells, undrawn) = (bits_of(cells, block), undrawn_in(block));
            std::array::from_fn(|z| cells[z] & !undrawn[z])
        };
        let mut masks = BTreeMap::new();
        for block in self.reached(undrawn.keys().copied()) {
            let (undrawn, drawn) = (self.within(block, undrawn_in), self.within(block, drawn_in));
            let mask: Bits = std::array::from_fn(|z| undrawn[z] & !drawn[z]);
            if mask != [0; 8] {
                masks.insert(block, VoxelMask::from_words(&mask));
            }
        }
        masks
    }

    /// The unsettled blocks in the octets of some blocks.
    fn reached(&mut self, blocks: impl Iterator<Item = u32>) -> BTreeSet<u32> {
        let mut reached = BTreeSet::new();
        for block in blocks {
            self.finder.turn_to(self.frame.coords[block as usize]);
            let octet = self.finder.octet().into_iter().flatten();
            reached.extend(octet.filter(|block| self.unsettled[*block as usize]));
        }
        reached
    }

    /// The corners in a block of the cells of all blocks whose octet has it.
    fn within(&mut self, block: u32, cells: impl Fn(u32) -> Bits) -> Bits {
        self.finder.turn_to(self.frame.coords[block as usize]);
        let mut within = [0; 8];
        for (slot, before) in self.finder.octet_at([-1; 3]).into_iter().enumerate() {
            let Some(cells) = before.map(&cells).filter(|cells| *cells != [0; 8]) else { continue };
            for (voxels, more) in within.iter_mut().zip(corners(&cells)[7 - slot]) {
                *voxels |= more;
            }
        }
        within
    }
}

/// The cells of a block in a list by block, in order.
fn bits_of(cells: &[(u32, VoxelMask)], block: u32) -> Bits {
    let place = cells.binary_search_by_key(&block, |(block, _)| *block);
    place.map_or([0; 8], |place| bits(&cells[place].1))
}

/// The bits of a mask of a block of 8 voxels.
#[must_use]
pub fn bits(mask: &VoxelMask) -> Bits {
    mask.words().try_into().expect("blocks of an edge of 8")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some bits of a block, as `seed` has it.
    fn some(seed: u64) -> Bits {
        std::array::from_fn(|z| {
            let noise = (seed + z as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            noise & noise.rotate_left(21) & noise.rotate_left(43)
        })
    }

    fn contains(bits: &Bits, [x, y, z]: [usize; 3]) -> bool {
        bits[z] >> (8 * y + x) & 1 != 0
    }

    /// The places of a block's cells' corners, counted from its first voxel.
    fn corner(cell: [usize; 3], number: usize) -> [usize; 3] {
        std::array::from_fn(|axis| cell[axis] + (number >> axis & 1))
    }

    /// The block of the octet that a place is in, and the voxel there.
    fn split(place: [usize; 3]) -> (usize, [usize; 3]) {
        ((0..3).map(|axis| (place[axis] >> 3) << axis).sum(), place.map(|c| c & 7))
    }

    fn places() -> impl Iterator<Item = [usize; 3]> {
        (0..512).map(|voxel| [voxel & 7, voxel >> 3 & 7, voxel >> 6])
    }

    #[test]
    fn corners_are_those_of_a_search_of_all() {
        for seed in 0..20 {
            let cells = some(seed);
            let mut expected = [[0u64; 8]; 8];
            for cell in places().filter(|cell| contains(&cells, *cell)) {
                for number in 0..8 {
                    let (slot, [x, y, z]) = split(corner(cell, number));
                    expected[slot][z] |= 1 << (8 * y + x);
                }
            }
            assert_eq!(corners(&cells), expected, "{seed}");
        }
    }

    #[test]
    fn cells_touch_the_voxels_that_are_their_corners() {
        for seed in 0..20 {
            let octet: [Bits; 8] = std::array::from_fn(|slot| some(seed * 8 + slot as u64));
            let touching = cells_touching(octet.each_ref());
            for cell in places() {
                let touches = (0..8).any(|number| {
                    let (slot, voxel) = split(corner(cell, number));
                    contains(&octet[slot], voxel)
                });
                assert_eq!(contains(&touching, cell), touches, "{seed}: {cell:?}");
            }
        }
    }

    #[test]
    fn only_cells_at_the_far_faces_reach_into_other_blocks() {
        assert_eq!(reaching([true; 8]), [!0; 8]);
        assert_eq!(reaching([false; 8]), [0; 8]);
        for slot in 1..8 {
            let cells = reaching(std::array::from_fn(|other| other == slot));
            for cell in places() {
                let reaches = (0..3).all(|axis| slot >> axis & 1 == 0 || cell[axis] == 7);
                assert_eq!(contains(&cells, cell), reaches, "{slot}: {cell:?}");
            }
        }
    }
}
