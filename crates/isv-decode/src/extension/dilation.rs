//! The 26-neighbourhood of a set of blocks.
//!
//! Blocks are kept as bits of cells of 4x4x4 blocks: bit `code % 64` of cell `code / 64`, for the Morton code of a block. A
//! step along an axis moves bits by a few places within the cell or into the next one, and a step along each axis in turn
//! reaches all 26 neighbours. Cells in order with their bits in order are blocks in Morton order.

use isv_volume::{BlockCoord, MortonCode};

/// Blocks along the edge of a cell.
const CELL_EDGE: i32 = 4;
/// Bits of a Morton code that tell the block within its cell.
const CELL_BITS: u32 = 6;

/// Some blocks of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    /// Morton code of its blocks without the lowest bits.
    code: u64,
    /// One bit a block.
    blocks: u64,
}

/// The blocks of a set and of its 26-neighbourhood within the range of coordinates. Takes memory for the blocks that are there,
/// not for those that are added.
#[derive(Clone, Debug)]
pub struct Dilation {
    /// Cells in order.
    cells: Vec<Cell>,
}

impl Dilation {
    /// Of a set in Morton order.
    #[must_use]
    pub fn of(coords: &[BlockCoord]) -> Self {
        Self { cells: dilated_cells(coords) }
    }

    /// How many blocks there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.iter().map(|cell| cell.blocks.count_ones() as usize).sum()
    }

    /// The blocks in Morton order.
    #[must_use]
    pub fn coords(&self) -> Vec<BlockCoord> {
        let mut coords = Vec::with_capacity(self.count());
        for Cell { code, mut blocks } in self.cells.iter().copied() {
            while blocks != 0 {
                coords.push(MortonCode(code << CELL_BITS | u64::from(blocks.trailing_zeros())).coord());
                blocks &= blocks - 1;
            }
        }
        coords
    }
}

/// The neighbourhood, cell by cell in order.
fn dilated_cells(coords: &[BlockCoord]) -> Vec<Cell> {
    let blocks = coords.iter().map(|coord| coord.morton().0);
    let cells = blocks.map(|block| Cell { code: block >> CELL_BITS, blocks: 1 << (block & 63) });
    let cells = merge(cells.collect());
    (0..3).fold(cells, |cells, axis| dilate_along(axis, &cells))
}

/// Joins what is there more than once of cells in order.
fn merge(mut cells: Vec<Cell>) -> Vec<Cell> {
    cells.dedup_by(|next, cell| {
        let same = next.code == cell.code;
        cell.blocks |= if same { next.blocks } else { 0 };
        same
    });
    cells
}

/// Adds the blocks one step up and down an axis.
fn dilate_along(axis: usize, cells: &[Cell]) -> Vec<Cell> {
    let (near, far) = (1 << axis, 8 << axis);
    let (even, low) = (without_bit(axis), without_bit(axis + 3));
    let mut dilated = Vec::with_capacity(3 * cells.len());
    for Cell { code, blocks } in cells.iter().copied() {
        let up = (blocks & even) << near | (blocks & !even & low) << (far - near);
        let down = (blocks & !even) >> near | (blocks & even & !low) >> (far - near);
        dilated.push(Cell { code, blocks: blocks | up | down });
        let above = (blocks & !even & !low) >> (far + near);
        let below = (blocks & even & low) << (far + near);
        for (step, carried) in [(CELL_EDGE, above), (-CELL_EDGE, below)] {
            if let Some(code) = neighbour(code, axis, step).filter(|_| carried != 0) {
                dilated.push(Cell { code, blocks: carried });
            }
        }
    }
    dilated.sort_unstable();
    merge(dilated)
}

/// The places of a word whose number does not have a bit.
fn without_bit(bit: usize) -> u64 {
    [
        0x5555_5555_5555_5555,
        0x3333_3333_3333_3333,
        0x0f0f_0f0f_0f0f_0f0f,
        0x00ff_00ff_00ff_00ff,
        0x0000_ffff_0000_ffff,
        0x0000_0000_ffff_ffff,
    ][bit]
}

/// The cell that many blocks along an axis, if coordinates reach that far.
fn neighbour(code: u64, axis: usize, step: i32) -> Option<u64> {
    let mut offset = [0; 3];
    offset[axis] = step;
    let corner = MortonCode(code << CELL_BITS).coord().offset(offset);
    corner.in_range().then(|| corner.morton().0 >> CELL_BITS)
}
