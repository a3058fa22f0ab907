//! From block coordinate to block index.

use crate::{BlockCoord, MortonCode};
use rustc_hash::FxHashMap;

/// Block indices of a block's 3x3x3 neighbourhood; `None` where there is no block. Entry `(dz + 1) * 9 + (dy + 1) * 3 +
/// (dx + 1)` is the neighbour at offset `(dx, dy, dz)`; entry 13 is the block itself.
pub type Neighbourhood = [Option<u32>; 27];

/// Base-2 logarithm of the blocks along the edge of a cell.
const CELL_LOG2: u32 = 2;
/// Bits of a Morton code that tell a block within its cell.
const CELL_BITS: u32 = 3 * CELL_LOG2;
/// Two bits, each followed by two empty places.
const SPREAD: [u32; 4] = [0, 1, 8, 9];

/// Look-up from block coordinate to block index.
///
/// Blocks are kept as bits of cells of 4x4x4 blocks. As the list is in Morton order, the blocks of a cell follow one another,
/// and a block's index is that of the cell's first and the number of bits below its own.
#[derive(Clone, Debug, Default)]
pub struct BlockIndex {
    cells: FxHashMap<[i32; 3], Cell>,
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
        debug_assert!(coords.windows(2).all(|w| w[0].morton() < w[1].morton()), "blocks in Morton order");
        let mut cells = FxHashMap::default();
        let mut rest = (0..).zip(coords).map(|(index, coord)| (index, coord.morton().0)).peekable();
        while let Some((first, code)) = rest.next() {
            let bit = |code: u64| 1u64 << (code & ((1 << CELL_BITS) - 1));
            let mut blocks = bit(code);
            while let Some((_, next)) = rest.next_if(|(_, next)| next >> CELL_BITS == code >> CELL_BITS) {
                blocks |= bit(next);
            }
            let place = MortonCode(code).coord().to_array().map(|c| c >> CELL_LOG2);
            cells.insert(place, Cell { blocks, first });
        }
        Self { cells }
    }

    /// Index of the block at a coordinate.
    #[must_use]
    #[inline]
    pub fn get(&self, coord: BlockCoord) -> Option<u32> {
        let coord = coord.to_array();
        let [x, y, z] = coord.map(|c| SPREAD[(c & 3) as usize]);
        self.cells.get(&coord.map(|c| c >> CELL_LOG2))?.get(x | y << 1 | z << 2)
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

    /// A cell and those around it.
    fn cells_around(&self, [x, y, z]: [i32; 3]) -> [Cell; 27] {
        let mut cells = [Cell::default(); 27];
        for (slot, cell) in (0..).zip(&mut cells) {
            let place = [x + slot % 3 - 1, y + slot / 3 % 3 - 1, z + slot / 9 - 1];
            *cell = self.cells.get(&place).copied().unwrap_or_default();
        }
        cells
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
                *cell = self.cells.get(&place).copied().unwrap_or_default();
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

/// Looks for the blocks around one block after the other. Cells are looked up once for all blocks in them that follow each other,
/// as they do in Morton order.
#[derive(Clone, Debug)]
pub struct NeighbourWalk<'a> {
    index: &'a BlockIndex,
    /// The cell that the last block was in.
    cell: Option<[i32; 3]>,
    /// It and those around it, in the order of a [`Neighbourhood`].
    cells: [Cell; 27],
}

impl<'a> NeighbourWalk<'a> {
    /// A walk that begins anywhere.
    #[must_use]
    pub fn new(index: &'a BlockIndex) -> Self {
        Self { index, cell: None, cells: [Cell::default(); 27] }
    }

    /// As [`BlockIndex::neighbourhood`].
    #[inline(always)]
    pub fn neighbourhood(&mut self, centre: BlockCoord) -> Neighbourhood {
        self.cube::<3, 27>(centre, -1)
    }

    /// As [`BlockIndex::octet`].
    #[inline(always)]
    pub fn octet(&mut self, lowest: BlockCoord) -> [Option<u32>; 8] {
        self.cube::<2, 8>(lowest, 0)
    }

    /// Indices of `SIDE^3` blocks from `start` blocks beside a coordinate on.
    #[inline(always)]
    fn cube<const SIDE: usize, const BLOCKS: usize>(
        &mut self,
        coord: BlockCoord,
        start: i32,
    ) -> [Option<u32>; BLOCKS] {
        let coord = coord.to_array();
        self.enter(coord.map(|c| c >> CELL_LOG2));
        // Along each axis, which cells the blocks are in and their bits there.
        let mut along = [[(0, 0); SIDE]; 3];
        for axis in 0..3 {
            for step in 0..SIDE {
                let c = (coord[axis] & 3) + start + step as i32;
                let slot = ((c >> CELL_LOG2) + 1) as usize;
                along[axis][step] = (slot * 3usize.pow(axis as u32), SPREAD[(c & 3) as usize] << axis);
            }
        }
        let mut blocks = [None; BLOCKS];
        for z in 0..SIDE {
            for y in 0..SIDE {
                for x in 0..SIDE {
                    let [x_at, y_at, z_at] = [along[0][x], along[1][y], along[2][z]];
                    let cell = self.cells[x_at.0 + y_at.0 + z_at.0];
                    blocks[(z * SIDE + y) * SIDE + x] = cell.get(x_at.1 | y_at.1 | z_at.1);
                }
            }
        }
        blocks
    }

    #[inline(always)]
    fn enter(&mut self, cell: [i32; 3]) {
        if self.cell != Some(cell) {
            self.cell = Some(cell);
            self.cells = self.index.cells_around(cell);
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
        let mut walk = NeighbourWalk::new(&index);
        for i in 0..22 * 22 * 22 {
            let centre = BlockCoord::from([i % 22 - 10, i / 22 % 22 - 12, i / 484 - 11]);
            let around = index.neighbourhood(centre);
            assert_eq!(walk.neighbourhood(centre), around, "{centre:?}");
            assert_eq!(walk.octet(centre), index.octet(centre), "{centre:?}");
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
