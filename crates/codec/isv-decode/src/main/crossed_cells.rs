//! The cells that the surface of a decoded frame crosses. Marching cubes reads their corners, so of no other voxel does it
//! matter whether it was observed.
//!
//! Signs are bits, and a row of voxels along x is a number. A block and one layer of voxels around it are ten rows of ten bits in
//! each of ten layers.

use crate::main::cell_corners::{Bits, reaching};
use crate::main::extension::{DecodedBlocks, ExtensionPlan, FrameBlocks};
use isv_kernels::signs::inside;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockIndex, NeighbourFinder, Neighbourhood, OCTET_SLOTS, SparseVolume, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Voxels of a block and one layer around it, along an axis.
pub(crate) const SIDE: usize = 10;
/// The rows of one z by y, `x` from the lowest bit on; what is beyond the tenth is empty.
pub(crate) type Layer = [u16; 24];
/// Rows that are worked on at a time.
const LANES: usize = 16;
/// The rows of a block, `8 z + y`.
pub(crate) type Rows = [u8; 64];

/// The unsettled blocks of an extended volume, in order, that have corners of crossed cells, with those voxels. Corners of a
/// crossed cell differ in sign and are all there and observed.
#[must_use]
pub fn crossed_corners(extended: &DecodedBlocks) -> Vec<(u32, VoxelMask)> {
    in_blocks(extended, &BTreeMap::new(), Wanted::Corners, Within::Unsettled)
}

/// The unsettled blocks of an extended volume, in order, where crossed cells begin, with the voxels that are the lowest corners of
/// these. `unobserved`: by index of its blocks, more voxels that were not observed.
#[must_use]
pub fn crossed_cells(
    extended: &DecodedBlocks,
    unobserved: &BTreeMap<u32, VoxelMask>,
) -> Vec<(u32, VoxelMask)> {
    in_blocks(extended, unobserved, Wanted::Cells, Within::Unsettled)
}

/// The crossed cells of which a frame says whether they are drawn: those with a corner in an unsettled block. By the block of their
/// lowest corners, in order, with these voxels.
#[must_use]
pub fn cells_at_unsettled(extended: &DecodedBlocks) -> Vec<(u32, VoxelMask)> {
    in_blocks(extended, &BTreeMap::new(), Wanted::Cells, Within::Reach)
}

/// The blocks of a frame where cells may begin that have a corner in an unsettled block, in order, with the lowest corners of these.
#[must_use]
pub fn beginnings_at_unsettled(plan: &ExtensionPlan) -> Vec<(u32, Bits)> {
    let FrameBlocks { all, unsettled, .. } = plan.blocks();
    let near = unsettled.dilated().marks_in(all);
    let unsettled = unsettled.marks_in(all);
    let mut finder = NeighbourFinder::new(plan.index());
    let blocks = (0..).zip(plan.coords()).zip(near).filter(|(_, near)| *near);
    let beginnings = blocks.filter_map(|((block, coord), _)| {
        finder.turn_to(*coord);
        let octet = finder.octet().map(|block| block.is_some_and(|block| unsettled[block as usize]));
        let cells = reaching(octet);
        (cells != [0; 8]).then_some((block, cells))
    });
    beginnings.collect()
}

/// Blocks whose voxels are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Within {
    /// Unsettled ones.
    Unsettled,
    /// Settled ones too, where cells begin that have a corner in an unsettled block.
    Reach,
}

/// Voxels that are looked for in a block.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    /// Corners of crossed cells.
    Corners,
    /// The lowest ones.
    Cells,
}

/// Wanted voxels by block, in order.
fn in_blocks(
    extended: &DecodedBlocks,
    unobserved: &BTreeMap<u32, VoxelMask>,
    wanted: Wanted,
    within: Within,
) -> Vec<(u32, VoxelMask)> {
    let FrameBlocks { all, coded, unsettled, .. } = extended.sets();
    // All that cells of these blocks reach into.
    let some = (unsettled != all).then(|| unsettled.dilated().intersection(all));
    let near = some.as_ref().unwrap_or(all);
    let some_index = some.as_ref().map(BlockIndex::from_set);
    let index = some_index.as_ref().unwrap_or(extended.index());
    let numbers: Vec<u32> =
        (0..).zip(near.marks_in(all)).filter_map(|(block, near)| near.then_some(block)).collect();
    let volume = extended.volume();
    let blocks = numbers.par_iter().zip(coded.marks_in(near));
    let signs_of = |(block, coded): (&u32, bool)| {
        let masks = [volume.unobserved(*block as usize), unobserved.get(block)];
        match coded {
            true => Signs::of_coded(volume, *block as usize, masks),
            false => Signs::of_extrapolated(volume, *block as usize, masks),
        }
    };
    let (signs, parts): (Vec<Signs>, Vec<Parts>) = blocks.map(signs_of).unzip();
    let unsettled = unsettled.marks_in(near);
    let is_unsettled = |block: Option<u32>| block.is_some_and(|block| unsettled[block as usize]);
    let voxels = |finder: &mut NeighbourFinder, (block, own): (&u32, &bool)| {
        if !own && within == Within::Unsettled {
            return None;
        }
        finder.turn_to(volume.coords()[*block as usize]);
        let around = finder.neighbourhood();
        if !is_mixed(&around, &parts) {
            return None;
        }
        let reach = if *own { [!0; 8] } else { reaching(OCTET_SLOTS.map(|slot| is_unsettled(around[slot]))) };
        let words = wanted_in(&around, &signs, wanted);
        let words: Bits = std::array::from_fn(|z| words[z] & reach[z]);
        (words != [0; 8]).then(|| (*block, VoxelMask::from_words(&words)))
    };
    let blocks = numbers.par_iter().zip(&unsettled);
    let voxels = blocks.map_init(|| NeighbourFinder::new(index), voxels);
    voxels.flatten_iter().collect()
}

/// Which observed voxels of a block lie inside and outside the surface.
#[derive(Clone, Copy, Debug)]
struct Signs {
    inside: Rows,
    outside: Rows,
}

impl Signs {
    /// Signs of a block that was coded, and where they lie.
    fn of_coded(volume: &SparseVolume, block: usize, unobserved: [Option<&VoxelMask>; 2]) -> (Self, Parts) {
        let inside = inside(volume.block(block).try_into().expect("blocks of an edge of 8"));
        Self::of_observed(inside, unobserved)
    }

    /// Signs of a block that was extrapolated, and where they lie: all of it has one sign.
    fn of_extrapolated(
        volume: &SparseVolume,
        block: usize,
        unobserved: [Option<&VoxelMask>; 2],
    ) -> (Self, Parts) {
        let is_inside = volume.block(block)[0] < 0;
        match unobserved {
            [None, None] if is_inside => {
                (Self { inside: [!0; 64], outside: [0; 64] }, Parts { inside: !0, outside: 0 })
            }
            [None, None] => (Self { inside: [0; 64], outside: [!0; 64] }, Parts { inside: 0, outside: !0 }),
            masks => Self::of_observed([if is_inside { !0 } else { 0 }; 8], masks),
        }
    }

    fn of_observed(mut inside: [u64; 8], unobserved: [Option<&VoxelMask>; 2]) -> (Self, Parts) {
        let mut outside = inside.map(|word| !word);
        for mask in unobserved.into_iter().flatten() {
            for (z, unobserved) in mask.words().iter().enumerate() {
                inside[z] &= !unobserved;
                outside[z] &= !unobserved;
            }
        }
        let parts = Parts { inside: touching(&inside), outside: touching(&outside) };
        (Self { inside: rows(&inside), outside: rows(&outside) }, parts)
    }
}

/// The rows of words of one z.
pub(crate) fn rows(words: &Bits) -> Rows {
    let mut rows = [0; 64];
    rows.as_chunks_mut::<8>().0.iter_mut().zip(words).for_each(|(rows, word)| *rows = word.to_le_bytes());
    rows
}

/// Whether a block has voxels inside, and outside, that touch the blocks around it. Bit `s` is for the block in whose
/// neighbourhood this one has slot `s`.
#[derive(Clone, Copy, Debug)]
struct Parts {
    inside: u32,
    outside: u32,
}

/// The slots towards whose middle block some voxels of a set lie at the very face, edge or corner. For slot 13 any voxel of the
/// set counts.
fn touching(words: &[u64; 8]) -> u32 {
    const ALONG_X: [u64; 3] = [0x8080_8080_8080_8080, !0, 0x0101_0101_0101_0101];
    const ALONG_Y: [u64; 3] = [0xff << 56, !0, 0xff];
    let along_z = [words[7], words.iter().fold(0, |any, word| any | word), words[0]];
    let mut slots = 0;
    for (z, layer) in along_z.into_iter().enumerate() {
        for (y, rows) in ALONG_Y.into_iter().enumerate() {
            for (x, voxels) in ALONG_X.into_iter().enumerate() {
                slots |= u32::from(layer & rows & voxels != 0) << (9 * z + 3 * y + x);
            }
        }
    }
    slots
}

/// Whether there are voxels of both signs in a block and the layer around it.
fn is_mixed(around: &Neighbourhood, parts: &[Parts]) -> bool {
    let (mut inside, mut outside) = (0, 0);
    for (slot, block) in around.iter().enumerate() {
        if let Some(block) = block {
            let parts = parts[*block as usize];
            inside |= parts.inside >> slot & 1;
            outside |= parts.outside >> slot & 1;
        }
    }
    inside & outside != 0
}

fn wanted_in(around: &Neighbourhood, signs: &[Signs], wanted: Wanted) -> Bits {
    vectorized(
        #[inline(always)]
        || {
            let (mut inside, mut outside) = ([&[0; 64]; 27], [&[0; 64]; 27]);
            for (slot, block) in around.iter().enumerate() {
                if let Some(block) = block {
                    let signs = &signs[*block as usize];
                    (inside[slot], outside[slot]) = (&signs.inside, &signs.outside);
                }
            }
            let crossed = crossed(&layers(&inside), &layers(&outside));
            match wanted {
                Wanted::Corners => corner_words(&crossed),
                Wanted::Cells => cell_words(&crossed),
            }
        },
    )
}

/// The crossed cells of a block and one layer before it, by their lowest corner.
type CrossedCells = [Layer; SIDE - 1];

#[inline(always)]
fn crossed(inside: &[Layer; SIDE], outside: &[Layer; SIDE]) -> CrossedCells {
    let mut crossed: CrossedCells = [[0; 24]; SIDE - 1];
    for z in 0..SIDE - 1 {
        let ([in0, in1], [out0, out1]) = ([&inside[z], &inside[z + 1]], [&outside[z], &outside[z + 1]]);
        for y in 0..LANES {
            let all_in = in0[y] & in0[y + 1] & in1[y] & in1[y + 1];
            let all_out = out0[y] & out0[y + 1] & out1[y] & out1[y + 1];
            let there = (in0[y] | out0[y]) & (in1[y] | out1[y]);
            let next = (in0[y + 1] | out0[y + 1]) & (in1[y + 1] | out1[y + 1]);
            let there = there & next;
            crossed[z][y] = (there & there >> 1) & !(all_in & all_in >> 1) & !(all_out & all_out >> 1);
        }
    }
    crossed
}

/// The corners of crossed cells among the voxels of the block in the middle: a word a z.
#[inline(always)]
fn corner_words(crossed: &CrossedCells) -> Bits {
    std::array::from_fn(|z| {
        let row = |y: usize| {
            let cells = crossed[z][y] | crossed[z + 1][y] | crossed[z][y + 1] | crossed[z + 1][y + 1];
            ((cells | cells << 1) >> 1) as u8
        };
        u64::from_le_bytes(std::array::from_fn(row))
    })
}

/// The lowest corners of crossed cells among them.
#[inline(always)]
fn cell_words(crossed: &CrossedCells) -> Bits {
    std::array::from_fn(|z| u64::from_le_bytes(std::array::from_fn(|y| (crossed[z + 1][y + 1] >> 1) as u8)))
}

/// The layers of a block and its surroundings from the rows of the blocks around it, those of one sign.
#[inline(always)]
pub(crate) fn layers(around: &[&Rows; 27]) -> [Layer; SIDE] {
    let mut layers = [[0; 24]; SIDE];
    for (z, layer) in layers.iter_mut().enumerate() {
        // Which block along z, and which of its layers.
        let (along_z, within) = match z {
            0 => (0, 7),
            1..=8 => (1, z - 1),
            _ => (2, 0),
        };
        let rows = |slot: usize| &around[9 * along_z + slot].as_chunks::<8>().0[within];
        layer[0] = join_rows(rows(0)[7], rows(1)[7], rows(2)[7]);
        let (before, level, after) = (rows(3), rows(4), rows(5));
        for y in 0..8 {
            layer[1 + y] = join_rows(before[y], level[y], after[y]);
        }
        layer[SIDE - 1] = join_rows(rows(6)[0], rows(7)[0], rows(8)[0]);
    }
    layers
}

/// The row of a block and one voxel at either end, from those of three blocks along x.
#[inline(always)]
fn join_rows(before: u8, level: u8, after: u8) -> u16 {
    u16::from(before >> 7) | u16::from(level) << 1 | u16::from(after & 1) << 9
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::{BlockCoord, BlockEdge, Grid, Truncation, VoxelSize};

    /// Around a block in the middle of others of noise, one of them with a mask: against a search of all cells.
    #[test]
    fn corners_and_cells_are_those_of_a_search_of_all() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        let mut coords: Vec<_> = (0..8).map(|i| BlockCoord::from([i % 2, i / 2 % 2, i / 4])).collect();
        coords.sort_unstable_by_key(|coord| coord.morton());
        let noise: Vec<i16> =
            (0..8 * 512u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 21) as i16 - 1000).collect();
        let words: [u64; 8] = std::array::from_fn(|z| 0x1357_9bdf_0246_8ace_u64.rotate_left(7 * z as u32));
        let masks = BTreeMap::from([(3, VoxelMask::from_words(&words))]);
        let extended = DecodedBlocks::from_coded(&SparseVolume::from_parts(grid, coords, noise, masks));
        let volume = extended.volume();
        // 1 inside, 0 outside, nothing where not there or not observed.
        let side = |voxel: [i32; 3]| {
            let block = extended.index().get(BlockCoord::from(voxel.map(|c| c >> 3)))? as usize;
            let at = voxel.iter().rev().fold(0, |at, c| at * 8 + (c & 7) as usize);
            let observed = volume.unobserved(block).is_none_or(|mask| !mask.contains(at));
            observed.then(|| volume.block(block)[at] < 0)
        };
        let corners = |cell: [i32; 3]| {
            (0..8).map(move |c| [cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)])
        };
        let is_crossed = |cell: [i32; 3]| {
            let sides: Option<Vec<bool>> = corners(cell).map(side).collect();
            sides.is_some_and(|sides| sides.contains(&true) && sides.contains(&false))
        };
        let found: BTreeMap<_, _> = crossed_corners(&extended).into_iter().collect();
        let cells: BTreeMap<_, _> = crossed_cells(&extended, &BTreeMap::new()).into_iter().collect();
        for (block, coord) in volume.coords().iter().enumerate() {
            for voxel in 0..512 {
                let at = [voxel % 8, voxel / 8 % 8, voxel / 64];
                let origin = coord.to_array();
                let lowest: [i32; 3] = std::array::from_fn(|axis| 8 * origin[axis] + at[axis] as i32 - 1);
                let expected = corners(lowest).any(is_crossed);
                let mask = found.get(&(block as u32));
                assert_eq!(mask.is_some_and(|mask| mask.contains(voxel)), expected, "{coord:?} {at:?}");
                let is_lowest = cells.get(&(block as u32)).is_some_and(|cells| cells.contains(voxel));
                assert_eq!(is_lowest, is_crossed(lowest.map(|c| c + 1)), "{coord:?} {at:?}");
            }
        }
        assert!(!found.is_empty() && found.len() < volume.block_count());
        assert!(!cells.is_empty() && cells.len() < found.len());
        // All of a block masked: no cell of it is left, nor one that reaches into it.
        let middle =
            volume.coords().iter().position(|coord| *coord == BlockCoord::from([1, 1, 1])).unwrap() as u32;
        let masked = crossed_cells(&extended, &BTreeMap::from([(middle, VoxelMask::full(BlockEdge::E8))]));
        let reaches = |coord: BlockCoord, voxel: usize| {
            let at = [voxel % 8, voxel / 8 % 8, voxel / 64];
            coord.to_array().iter().zip(at).all(|(block, c)| *block == 1 || *block == 0 && c == 7)
        };
        for (block, coord) in volume.coords().iter().enumerate() {
            let of = |cells: &BTreeMap<u32, VoxelMask>, voxel| {
                cells.get(&(block as u32)).is_some_and(|c| c.contains(voxel))
            };
            let masked: BTreeMap<_, _> = masked.iter().cloned().collect();
            for voxel in 0..512 {
                assert_eq!(
                    of(&masked, voxel),
                    of(&cells, voxel) && !reaches(*coord, voxel),
                    "{coord:?} {voxel}"
                );
            }
        }
    }
}
