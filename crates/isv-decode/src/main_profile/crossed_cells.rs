//! The cells that the surface of a decoded frame crosses. Marching cubes reads their corners, so of no other voxel does it
//! matter whether it was observed.
//!
//! Signs are bits. A block and one layer of voxels around it are ten layers along z, each a number with ten bits a row.

use crate::extension::Extended;
use isv_kernels::signs::inside;
use isv_volume::{Neighbourhood, SparseVolume, VoxelMask};
use rayon::prelude::*;

/// Voxels of a block and one layer around it, along an axis.
const SIDE: usize = 10;
/// The voxels of one z, `x + 10 y`.
type Layer = u128;
/// Those that are the lowest corner of a cell within the layer.
const LOWEST_CORNERS: Layer = lowest_corners();

const fn lowest_corners() -> Layer {
    let mut corners = 0;
    let mut y = 0;
    while y < SIDE - 1 {
        corners |= 0x1ff << (SIDE * y);
        y += 1;
    }
    corners
}

/// For each block of an extended volume, its voxels that are corners of crossed cells: cells whose corners differ in sign and
/// are all there and observed. `None` where there are none.
#[must_use]
pub fn crossed_corners(extended: &Extended) -> Vec<Option<VoxelMask>> {
    let volume = &extended.volume;
    let blocks = (0..volume.block_count()).into_par_iter();
    let (signs, parts): (Vec<Signs>, Vec<Parts>) = blocks
        .map(|block| {
            let signs = Signs::of_block(volume, block);
            (signs, Parts::of(&signs))
        })
        .unzip();
    let corners =
        |around: &Neighbourhood| if is_mixed(around, &parts) { corners_in(around, &signs) } else { None };
    extended.around.par_iter().map(corners).collect()
}

/// Which observed voxels of a block lie inside and outside the surface: a word a z.
#[derive(Clone, Copy, Debug)]
struct Signs {
    inside: [u64; 8],
    outside: [u64; 8],
}

impl Signs {
    fn of_block(volume: &SparseVolume, block: usize) -> Self {
        let inside = inside(volume.block(block).try_into().expect("blocks of an edge of 8"));
        let mut signs = Self { inside, outside: inside.map(|word| !word) };
        if let Some(mask) = volume.unobserved(block) {
            for (z, unobserved) in mask.words().iter().enumerate() {
                signs.inside[z] &= !unobserved;
                signs.outside[z] &= !unobserved;
            }
        }
        signs
    }
}

/// Whether a block has voxels inside, and outside, that touch the blocks around it: bit `s` for the block in whose
/// neighbourhood this one has slot `s`.
#[derive(Clone, Copy, Debug)]
struct Parts {
    inside: u32,
    outside: u32,
}

impl Parts {
    fn of(signs: &Signs) -> Self {
        Self { inside: touching(&signs.inside), outside: touching(&signs.outside) }
    }
}

/// The slots towards whose middle block some voxels of a set lie at the very face, edge or corner; all of the set for slot 13.
fn touching(words: &[u64; 8]) -> u32 {
    const ALONG_X: [u64; 3] = [0x8080_8080_8080_8080, !0, 0x0101_0101_0101_0101];
    const ALONG_Y: [u64; 3] = [0xff << 56, !0, 0xff];
    let along_z = [words[7], words.iter().fold(0, |any, word| any | word), words[0]];
    let touches = |slot: usize| along_z[slot / 9] & ALONG_Y[slot / 3 % 3] & ALONG_X[slot % 3] != 0;
    (0..27).fold(0, |slots, slot| slots | u32::from(touches(slot)) << slot)
}

/// Whether there are voxels of both signs in a block and the layer around it.
fn is_mixed(around: &Neighbourhood, parts: &[Parts]) -> bool {
    let (mut inside, mut outside) = (0, 0);
    for (slot, block) in around.iter().enumerate() {
        if let Some(block) = block {
            let parts = parts[*block as usize];
            inside |= parts.inside & 1 << slot;
            outside |= parts.outside & 1 << slot;
        }
    }
    inside != 0 && outside != 0
}

fn corners_in(around: &Neighbourhood, signs: &[Signs]) -> Option<VoxelMask> {
    let around = around.map(|block| Some(&signs[block? as usize]));
    let inside = layers(&around, |signs| &signs.inside);
    let outside = layers(&around, |signs| &signs.outside);
    // Crossed cells by their lowest corner, which can be in the layer before the block.
    let mut crossed = [0; SIDE - 1];
    for (z, cells) in crossed.iter_mut().enumerate() {
        let [low, high] = [z, z + 1].map(|z| [inside[z], outside[z]]);
        let there = all_corners(low[0] | low[1], high[0] | high[1]);
        *cells = there & !all_corners(low[0], high[0]) & !all_corners(low[1], high[1]) & LOWEST_CORNERS;
    }
    let mut words = [0; 8];
    for (z, word) in words.iter_mut().enumerate() {
        let cells = crossed[z] | crossed[z + 1];
        let along_x = cells | cells << 1;
        let corners = along_x | along_x << SIDE;
        *word =
            (0..8).fold(0, |word, y| word | u64::from((corners >> (SIDE * (y + 1) + 1)) as u8) << (8 * y));
    }
    (words != [0; 8]).then(|| VoxelMask::from_words(&words))
}

/// The cells between two layers, by their lowest corner, of which all corners are in a set.
fn all_corners(low: Layer, high: Layer) -> Layer {
    let along_z = low & high;
    let along_y = along_z & along_z >> SIDE;
    along_y & along_y >> 1
}

/// The layers of a block and its surroundings, of one sign.
fn layers<'a>(around: &[Option<&'a Signs>; 27], of: impl Fn(&'a Signs) -> &'a [u64; 8]) -> [Layer; SIDE] {
    let mut layers = [0; SIDE];
    for (slot, signs) in around.iter().enumerate() {
        let Some(words) = signs.map(&of) else { continue };
        let place = |word: u64| in_layer(word, slot % 3, slot / 3 % 3);
        match slot / 9 {
            0 => layers[0] |= place(words[7]),
            1 => words.iter().enumerate().for_each(|(z, word)| layers[z + 1] |= place(*word)),
            _ => layers[9] |= place(words[0]),
        }
    }
    layers
}

/// What a word of the block at a step along x and y has in a layer around the middle block: steps are 0 before, 1 level, 2 after.
fn in_layer(word: u64, along_x: usize, along_y: usize) -> Layer {
    let row = |y: usize| {
        let bits = Layer::from((word >> (8 * y)) as u8);
        match along_x {
            0 => bits >> 7,
            1 => bits << 1,
            _ => (bits & 1) << 9,
        }
    };
    match along_y {
        0 => row(7),
        1 => (0..8).fold(0, |layer, y| layer | row(y) << (SIDE * (y + 1))),
        _ => row(0) << (SIDE * 9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extension::ExtensionPlan;
    use isv_volume::{BlockCoord, BlockEdge, Grid, Truncation, VoxelSize};
    use std::collections::BTreeMap;

    /// Around a block in the middle of others of noise, one of them with a mask: against a search of all cells.
    #[test]
    fn corners_are_those_of_all_crossed_cells() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(8).unwrap(),
        };
        let mut coords: Vec<_> = (0..8).map(|i| BlockCoord::from([i % 2, i / 2 % 2, i / 4])).collect();
        coords.sort_unstable_by_key(|coord| coord.morton());
        let samples = (0..8 * 512u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 21) as i16 - 1000).collect();
        let words: [u64; 8] = std::array::from_fn(|z| 0x1357_9bdf_0246_8ace_u64.rotate_left(7 * z as u32));
        let masks = BTreeMap::from([(3, VoxelMask::from_words(&words))]);
        let plan = ExtensionPlan::new(&coords);
        let extended = plan.extend(&SparseVolume::from_parts(grid, coords, samples, masks));
        let volume = &extended.volume;
        // 1 inside, 0 outside, nothing where not there or not observed.
        let side = |voxel: [i32; 3]| {
            let block = extended.index.get(BlockCoord::from(voxel.map(|c| c >> 3)))? as usize;
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
        let found = crossed_corners(&extended);
        for (block, coord) in volume.coords().iter().enumerate() {
            for voxel in 0..512 {
                let at = [voxel % 8, voxel / 8 % 8, voxel / 64];
                let origin = coord.to_array();
                let lowest: [i32; 3] = std::array::from_fn(|axis| 8 * origin[axis] + at[axis] as i32 - 1);
                let expected = corners(lowest).any(is_crossed);
                let mask = found[block].as_ref();
                assert_eq!(mask.is_some_and(|mask| mask.contains(voxel)), expected, "{coord:?} {at:?}");
            }
        }
        assert!(found.iter().any(Option::is_none) && found.iter().any(Option::is_some));
    }
}
