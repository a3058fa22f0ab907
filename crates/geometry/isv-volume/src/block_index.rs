//! From block coordinate to block index.

use crate::block_set::CELL_LOG2;
use crate::{BlockCoord, BlockSet};
use foldhash::HashMap;
use std::hash::{Hash, Hasher};

/// Block indices of a block's 3x3x3 neighbourhood; `None` where there is no block. Entry `(dz + 1) * 9 + (dy + 1) * 3 +
/// (dx + 1)` is the neighbour at offset `(dx, dy, dz)`; entry 13 is the block itself.
pub type Neighbourhood = [Option<u32>; 27];

/// Two bits, each followed by two empty places.
const SPREAD: [u32; 4] = [0, 1, 8, 9];

/// Look-up from block coordinate to block index.
///
/// Blocks are kept as bits of cells of 4x4x4 blocks. As the list is in Morton order, the blocks of a cell
/// follow one another. A block's index is that of the cell's first and the number of bits below its own.
#[derive(Clone, Debug, Default)]
pub struct BlockIndex {
    /// Hashed with a random key, as streams choose the blocks: with a known hash all of them could be made to collide.
    cells: HashMap<CellPlace, Cell>,
}

/// Place of a cell, in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CellPlace([i32; 3]);

impl CellPlace {
    #[inline(always)]
    fn new(block: BlockCoord) -> Self {
        Self(block.to_array().map(|c| c >> CELL_LOG2))
    }
}

impl Hash for CellPlace {
    /// In one word, which all places of blocks differ in.
    #[inline(always)]
    fn hash<H: Hasher>(&self, state: &mut H) {
        let [x, y, z] = self.0.map(|c| u64::from(c as u32));
        state.write_u64(x ^ y << 21 ^ z << 42);
    }
}

/// The blocks of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// One bit a block, in Morton order.
    blocks: u64,
    /// Index of the first.
    first: u32,
}

impl Cell {
    #[inline(always)]
    fn get(self, bit: u32) -> Option<u32> {
        let there = self.blocks >> bit & 1 != 0;
        there.then(|| self.first + (self.blocks & ((1 << bit) - 1)).count_ones())
    }
}

impl BlockIndex {
    /// Indexes a block list.
    ///
    /// # Panics
    /// In debug builds, if the blocks are not in Morton order.
    #[must_use]
    pub fn new(coords: &[BlockCoord]) -> Self {
        Self::from_set(&BlockSet::from_coords(coords))
    }

    /// Indexes the list of a set's blocks.
    #[must_use]
    pub fn from_set(set: &BlockSet) -> Self {
        let mut first = 0;
        let numbered = set.cells().iter().map(|cell| {
            let place = CellPlace::new(cell.corner());
            let numbered = Cell { blocks: cell.blocks, first };
            first += cell.blocks.count_ones();
            (place, numbered)
        });
        Self { cells: numbered.collect() }
    }

    /// Index of the block at a coordinate.
    #[must_use]
    #[inline]
    pub fn get(&self, coord: BlockCoord) -> Option<u32> {
        let [x, y, z] = coord.to_array().map(|c| SPREAD[(c & 3) as usize]);
        self.cells.get(&CellPlace::new(coord))?.get(x | y << 1 | z << 2)
    }

    /// Indices of the 3x3x3 blocks around a coordinate, which need not be a block itself.
    #[must_use]
    pub fn neighbourhood(&self, centre: BlockCoord) -> Neighbourhood {
        self.cube::<3, 27>(centre.offset([-1; 3]))
    }

    /// Indices of the 2x2x2 blocks from a coordinate on, x fastest.
    #[must_use]
    pub fn octet(&self, lowest: BlockCoord) -> [Option<u32>; 8] {
        self.cube::<2, 8>(lowest)
    }

    /// Indices of `SIDE^3` blocks from a coordinate on, x fastest. A cube of up to 5 blocks a side lies in at most two cells
    /// along each axis.
    #[inline]
    fn cube<const SIDE: usize, const BLOCKS: usize>(&self, lowest: BlockCoord) -> [Option<u32>; BLOCKS] {
        let lowest = lowest.to_array();
        let first = lowest.map(|c| c >> CELL_LOG2);
        let last = lowest.map(|c| (c + SIDE as i32 - 1) >> CELL_LOG2);
        let mut cells = [Cell::default(); 8];
        for (slot, cell) in cells.iter_mut().enumerate() {
            let place: [i32; 3] = std::array::from_fn(|axis| first[axis] + (slot >> axis & 1) as i32);
            if (0..3).all(|axis| place[axis] <= last[axis]) {
                *cell = self.cells.get(&CellPlace(place)).copied().unwrap_or_default();
            }
        }
        // Of the coordinates along each axis, which of the cells they are in, and their bits there.
        let along: [[(usize, u32); SIDE]; 3] = std::array::from_fn(|axis| {
            std::array::from_fn(|step| {
                let c = lowest[axis] + step as i32;
                (((c >> CELL_LOG2) - first[axis]) as usize, SPREAD[(c & 3) as usize])
            })
        });
        let mut out = [None; BLOCKS];
        for (slot, entry) in out.iter_mut().enumerate() {
            let [(cx, x), (cy, y), (cz, z)] =
                [along[0][slot % SIDE], along[1][slot / SIDE % SIDE], along[2][slot / (SIDE * SIDE)]];
            *entry = cells[cx | cy << 1 | cz << 2].get(x | y << 1 | z << 2);
        }
        out
    }
}

/// Slots of a [`Neighbourhood`] that hold an octet, the middle block first. Bit 0 of the position is the step
/// along x, bit 1 along y, bit 2 along z.
pub const OCTET_SLOTS: [usize; 8] = [13, 14, 16, 17, 22, 23, 25, 26];

/// Blocks along a cell's edge, and with those around it.
const CELL_EDGE: usize = 1 << CELL_LOG2;
const AROUND_EDGE: usize = CELL_EDGE + 2;
const AROUND: usize = AROUND_EDGE * AROUND_EDGE * AROUND_EDGE;

/// Blocks of each of the 3x3x3 cells around a cell that are in it or touch it: bits of a cell.
const TOUCHING: [u64; 27] = touching();

const fn touching() -> [u64; 27] {
    let mut touching = [0; 27];
    let mut place = 0;
    while place < AROUND {
        let (x, y, z) =
            (place % AROUND_EDGE, place / AROUND_EDGE % AROUND_EDGE, place / (AROUND_EDGE * AROUND_EDGE));
        // Counted from the lowest block of the cell before, along each axis.
        let (x, y, z) = (x + CELL_EDGE - 1, y + CELL_EDGE - 1, z + CELL_EDGE - 1);
        let slot = (z / CELL_EDGE * 3 + y / CELL_EDGE) * 3 + x / CELL_EDGE;
        let bit = SPREAD[x % CELL_EDGE] | SPREAD[y % CELL_EDGE] << 1 | SPREAD[z % CELL_EDGE] << 2;
        touching[slot] |= 1 << bit;
        place += 1;
    }
    touching
}

/// Distance from the first block of the cell before to the first of these, among the blocks of a cell and
/// those around it.
const FIRST_PLACE: usize = (CELL_EDGE - 1) * (1 + AROUND_EDGE + AROUND_EDGE * AROUND_EDGE);

/// How far each block of a cell is from the cell's first among these, by its bit.
const PLACES: [u8; 64] = places();

const fn places() -> [u8; 64] {
    let mut places = [0; 64];
    let mut bit = 0;
    while bit < 64 {
        let [x, y, z] = [bit & 1 | bit >> 2 & 2, bit >> 1 & 1 | bit >> 3 & 2, bit >> 2 & 1 | bit >> 4 & 2];
        places[bit] = ((z * AROUND_EDGE + y) * AROUND_EDGE + x) as u8;
        bit += 1;
    }
    places
}

/// Finds the blocks around one block after the other. What is found around a cell serves all of its blocks, so that blocks in
/// Morton order take hardly any look-ups.
#[derive(Clone, Debug)]
pub struct NeighbourFinder<'a> {
    index: &'a BlockIndex,
    /// The middle block, if there is one yet, and the cell that it is in.
    middle: Option<BlockCoord>,
    place: Option<CellPlace>,
    /// The blocks of that cell and those around it, x fastest.
    blocks: [Option<u32>; AROUND],
    /// Beginning of the 3x3x3 blocks around the middle block among these.
    lowest: usize,
}

impl<'a> NeighbourFinder<'a> {
    /// A finder that has not turned to a block yet, and finds nothing.
    #[must_use]
    pub fn new(index: &'a BlockIndex) -> Self {
        Self { index, middle: None, place: None, blocks: [None; AROUND], lowest: 0 }
    }

    /// Turns to a coordinate, which need not be that of a block.
    #[inline]
    pub fn turn_to(&mut self, middle: BlockCoord) {
        self.middle = Some(middle);
        let [x, y, z] = middle.to_array().map(|c| c as usize % CELL_EDGE);
        self.lowest = (z * AROUND_EDGE + y) * AROUND_EDGE + x;
        let place = CellPlace::new(middle);
        if self.place != Some(place) {
            self.place = Some(place);
            self.find_blocks(place);
        }
    }

    /// The block in a slot of the [`Neighbourhood`].
    #[must_use]
    #[inline(always)]
    pub fn get(&self, slot: usize) -> Option<u32> {
        self.blocks[self.lowest + (slot / 9 * AROUND_EDGE + slot / 3 % 3) * AROUND_EDGE + slot % 3]
    }

    /// The blocks in all slots.
    #[must_use]
    #[inline]
    pub fn neighbourhood(&self) -> Neighbourhood {
        let mut around = [None; 27];
        for (row, neighbours) in around.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let first = self.lowest + (row / 3 * AROUND_EDGE + row % 3) * AROUND_EDGE;
            neighbours.copy_from_slice(&self.blocks[first..first + 3]);
        }
        around
    }

    /// The middle block and those after it along each axis, as [`BlockIndex::octet`] has them.
    #[must_use]
    #[inline]
    pub fn octet(&self) -> [Option<u32>; 8] {
        OCTET_SLOTS.map(|slot| self.get(slot))
    }

    /// The 2x2x2 blocks that begin at an offset from the middle block, x fastest.
    #[must_use]
    pub fn octet_at(&self, offset: [i32; 3]) -> [Option<u32>; 8] {
        let Some(middle) = self.middle else { return [None; 8] };
        // Where it begins among the blocks that are known here.
        let [x, y, z] = middle.to_array().map(|c| (c & (CELL_EDGE as i32 - 1)) + 1);
        let first = [x + offset[0], y + offset[1], z + offset[2]];
        if first.iter().any(|c| !(0..AROUND_EDGE as i32 - 1).contains(c)) {
            return self.index.octet(middle.offset(offset));
        }
        let [x, y, z] = first.map(|c| c as usize);
        let lowest = (z * AROUND_EDGE + y) * AROUND_EDGE + x;
        let mut octet = [None; 8];
        for (slot, block) in octet.iter_mut().enumerate() {
            *block = self.blocks
                [lowest + ((slot >> 2) * AROUND_EDGE + (slot >> 1 & 1)) * AROUND_EDGE + (slot & 1)];
        }
        octet
    }

    /// Finds the blocks of a cell and those around it.
    fn find_blocks(&mut self, CellPlace([x, y, z]): CellPlace) {
        self.blocks = [None; AROUND];
        for (slot, touching) in TOUCHING.into_iter().enumerate() {
            let steps = [slot % 3, slot / 3 % 3, slot / 9];
            let place =
                CellPlace([x + steps[0] as i32 - 1, y + steps[1] as i32 - 1, z + steps[2] as i32 - 1]);
            let Some(cell) = self.index.cells.get(&place) else { continue };
            // Counted from the lowest block of the cell before, along each axis.
            let lowest = CELL_EDGE * ((steps[2] * AROUND_EDGE + steps[1]) * AROUND_EDGE + steps[0]);
            let mut blocks = cell.blocks & touching;
            while blocks != 0 {
                let bit = blocks.trailing_zeros();
                let place = lowest + usize::from(PLACES[bit as usize]) - FIRST_PLACE;
                self.blocks[place] = cell.get(bit);
                blocks &= blocks - 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks here and there, over several cells, on both sides of zero, in Morton order.
    fn some_blocks() -> Vec<BlockCoord> {
        let all = (0..20 * 20 * 20).map(|i| BlockCoord::from([i % 20 - 9, i / 20 % 20 - 11, i / 400 - 10]));
        let mut coords: Vec<_> = all.filter(|c| (c.x * 7 + c.y * 3 + c.z * 5).rem_euclid(4) == 1).collect();
        coords.sort_unstable_by_key(|coord| coord.morton());
        coords
    }

    #[test]
    fn every_block_is_found_and_no_other() {
        let coords = some_blocks();
        let index = BlockIndex::new(&coords);
        for i in 0..24 * 24 * 24 {
            let coord = BlockCoord::from([i % 24 - 11, i / 24 % 24 - 13, i / 576 - 12]);
            let expected = coords.iter().position(|c| *c == coord).map(|place| place as u32);
            assert_eq!(index.get(coord), expected, "{coord:?}");
        }
    }

    #[test]
    fn neighbourhood_runs_x_fastest_from_minus_one() {
        let index = BlockIndex::new(&some_blocks());
        let mut finder = NeighbourFinder::new(&index);
        for i in 0..22 * 22 * 22 {
            let centre = BlockCoord::from([i % 22 - 10, i / 22 % 22 - 12, i / 484 - 11]);
            let around = index.neighbourhood(centre);
            finder.turn_to(centre);
            assert_eq!(finder.neighbourhood(), around, "{centre:?}");
            assert_eq!(finder.octet(), index.octet(centre), "{centre:?}");
            assert_eq!(std::array::from_fn(|slot| finder.get(slot)), around, "{centre:?}");
            let offset = [i % 7 - 3, i % 5 - 2, i % 4 - 1];
            assert_eq!(finder.octet_at(offset), index.octet(centre.offset(offset)), "{centre:?} {offset:?}");
            for (slot, neighbour) in around.into_iter().enumerate() {
                let offset = [slot % 3, slot / 3 % 3, slot / 9].map(|s| s as i32 - 1);
                assert_eq!(neighbour, index.get(centre.offset(offset)), "{centre:?} {offset:?}");
            }
            for (slot, block) in index.octet(centre).into_iter().enumerate() {
                let offset = [slot & 1, slot >> 1 & 1, slot >> 2].map(|s| s as i32);
                assert_eq!(block, index.get(centre.offset(offset)), "{centre:?} {offset:?}");
            }
        }
    }
}
