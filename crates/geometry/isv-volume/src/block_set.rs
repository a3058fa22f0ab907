//! Sets of blocks, and what is done with them as a whole: union, difference, the blocks around them.
//!
//! Blocks are kept as bits of cells of 4x4x4 blocks: bit `code % 64` of cell `code / 64`, for the Morton code
//! of a block. A step along an axis moves bits by a few places within the cell or into the next one. A step
//! along each axis in turn reaches all 26 neighbours. Cells in order with their bits in order are blocks in
//! Morton order.

use crate::{BlockCoord, MortonCode};
use std::cmp::Ordering;

/// Base-2 logarithm of the blocks along the edge of a cell.
pub(crate) const CELL_LOG2: u32 = 2;
/// Bits of a Morton code that tell a block within its cell.
const CELL_BITS: u32 = 3 * CELL_LOG2;
/// The bits of a cell's code that count cells along x.
const CELL_COUNT_BITS: u64 = 0x1249_2492_4924_9249 >> CELL_BITS;

/// The blocks of a set in one cell of 4x4x4 blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BlockCell {
    /// Morton code of its blocks without the lowest 6 bits.
    pub code: u64,
    /// One bit a block, in Morton order.
    pub blocks: u64,
}

impl BlockCell {
    /// The cell of a block, with that block alone.
    #[must_use]
    pub fn containing(block: BlockCoord) -> Self {
        let code = block.morton().0;
        Self { code: code >> CELL_BITS, blocks: 1 << (code & ((1 << CELL_BITS) - 1)) }
    }

    /// The block with the lowest coordinates that is in the cell, in the set or not.
    #[must_use]
    pub fn corner(self) -> BlockCoord {
        MortonCode(self.code << CELL_BITS).coord()
    }

    /// The code of the cell at an offset in cells, if coordinates reach that far.
    #[must_use]
    pub fn at_offset(self, offset: [i32; 3]) -> Option<u64> {
        let corner = self.corner().offset(offset.map(|cells| cells << CELL_LOG2));
        corner.in_range().then(|| corner.morton().0 >> CELL_BITS)
    }

    /// The code of the next cell along an axis, ahead or behind, if coordinates reach that far.
    #[must_use]
    pub fn beside(self, axis: usize, ahead: bool) -> Option<u64> {
        // Every third bit of the code counts along the axis: a carry passes over the others if they are set, a borrow if not.
        let along = CELL_COUNT_BITS << axis;
        let others = self.code & !along;
        match ahead {
            true if self.code & along == along => None,
            true => Some(((self.code | !along) + 1) & along | others),
            false if self.code & along == 0 => None,
            false => Some(((self.code & along) - (1 << axis)) & along | others),
        }
    }

    /// The blocks in Morton order.
    pub fn coords(self) -> impl Iterator<Item = BlockCoord> {
        let (corner, mut blocks) = (self.corner(), self.blocks);
        std::iter::from_fn(move || {
            let bit = blocks.trailing_zeros();
            blocks &= blocks.wrapping_sub(1);
            let along = |axis: u32| (bit >> axis & 1 | bit >> (axis + 2) & 2) as i32;
            (bit < 64).then(|| corner.offset([along(0), along(1), along(2)]))
        })
    }
}

/// A set of blocks. Takes memory for the cells of 4x4x4 blocks that it has some in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockSet {
    /// Cells in order, none empty.
    cells: Vec<BlockCell>,
}

impl BlockSet {
    /// Set of blocks in Morton order.
    ///
    /// # Panics
    /// In debug builds, if they are not.
    #[must_use]
    pub fn from_coords(coords: &[BlockCoord]) -> Self {
        debug_assert!(coords.is_sorted_by_key(|coord| coord.morton()), "blocks in Morton order");
        let mut cells: Vec<BlockCell> = Vec::new();
        for cell in coords.iter().map(|coord| BlockCell::containing(*coord)) {
            match cells.last_mut().filter(|last| last.code == cell.code) {
                Some(last) => last.blocks |= cell.blocks,
                None => cells.push(cell),
            }
        }
        Self { cells }
    }

    /// Cells that have blocks, in order.
    #[must_use]
    pub fn cells(&self) -> &[BlockCell] {
        &self.cells
    }

    /// How many blocks there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.iter().map(|cell| cell.blocks.count_ones() as usize).sum()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The blocks in Morton order.
    #[must_use]
    pub fn coords(&self) -> Vec<BlockCoord> {
        let mut coords = Vec::with_capacity(self.count());
        self.cells.iter().for_each(|cell| coords.extend(cell.coords()));
        coords
    }

    /// For each block of another set, in its order, whether it is in this one too.
    #[must_use]
    pub fn marks_in(&self, other: &Self) -> Vec<bool> {
        let mut marks = Vec::with_capacity(other.count());
        let mut ours = self.cells.iter().peekable();
        for BlockCell { code, mut blocks } in other.cells.iter().copied() {
            while ours.next_if(|cell| cell.code < code).is_some() {}
            let own = ours.next_if(|cell| cell.code == code).map_or(0, |cell| cell.blocks);
            while blocks != 0 {
                marks.push(own >> blocks.trailing_zeros() & 1 != 0);
                blocks &= blocks - 1;
            }
        }
        marks
    }

    /// The blocks that are wanted, by their place in the order.
    #[must_use]
    pub fn filtered(&self, mut is_wanted: impl FnMut(usize) -> bool) -> Self {
        let mut places = 0..;
        let wanted = self.cells.iter().map(|cell| {
            let (mut rest, mut blocks) = (cell.blocks, 0);
            while rest != 0 {
                let bit = rest & rest.wrapping_neg();
                blocks |= if places.next().is_some_and(&mut is_wanted) { bit } else { 0 };
                rest ^= bit;
            }
            BlockCell { blocks, ..*cell }
        });
        wanted.collect()
    }

    /// The blocks that are in one of two sets or in both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        self.combined(other, |a, b| a | b)
    }

    /// The blocks that are in both sets.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        self.combined(other, |a, b| a & b)
    }

    /// The blocks that are in this set and not in the other one.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Self {
        self.combined(other, |a, b| a & !b)
    }

    /// The blocks in cells of 4x4x4 blocks where another set has none.
    #[must_use]
    pub fn outside_cells_of(&self, other: &Self) -> Self {
        self.combined(other, |a, b| if b == 0 { a } else { 0 })
    }

    /// The set with the 26 neighbours of each block, within the range of coordinates: up to 27 times as many.
    #[must_use]
    pub fn dilated(&self) -> Self {
        let cells = (0..3).fold(self.cells.clone(), |cells, axis| dilate_along(axis, &cells));
        Self { cells }
    }

    /// Cell by cell, what becomes of the bits of both sets.
    fn combined(&self, other: &Self, combine: impl Fn(u64, u64) -> u64) -> Self {
        let (mut ours, mut theirs) = (self.cells.iter().peekable(), other.cells.iter().peekable());
        let mut cells = Vec::with_capacity(self.cells.len());
        loop {
            let order = match (ours.peek(), theirs.peek()) {
                (Some(a), Some(b)) => a.code.cmp(&b.code),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => return Self { cells },
            };
            let a = if order.is_le() { ours.next() } else { None };
            let b = if order.is_ge() { theirs.next() } else { None };
            let code = a.or(b).map_or(0, |cell| cell.code);
            let [a, b] = [a, b].map(|cell| cell.map_or(0, |cell| cell.blocks));
            let blocks = combine(a, b);
            if blocks != 0 {
                cells.push(BlockCell { code, blocks });
            }
        }
    }
}

impl FromIterator<BlockCell> for BlockSet {
    /// Set of cells in order, each there once.
    fn from_iter<T: IntoIterator<Item = BlockCell>>(cells: T) -> Self {
        let cells: Vec<BlockCell> = cells.into_iter().filter(|cell| cell.blocks != 0).collect();
        debug_assert!(cells.is_sorted_by(|a, b| a.code < b.code), "cells in order");
        Self { cells }
    }
}

/// Joins what is there more than once of cells in order.
fn merge(mut cells: Vec<BlockCell>) -> Vec<BlockCell> {
    cells.dedup_by(|next, cell| {
        let same = next.code == cell.code;
        cell.blocks |= if same { next.blocks } else { 0 };
        same
    });
    cells
}

/// Adds the blocks one step up and down an axis.
fn dilate_along(axis: usize, cells: &[BlockCell]) -> Vec<BlockCell> {
    let (near, far) = (1 << axis, 8 << axis);
    let (even, low) = (without_bit(axis), without_bit(axis + 3));
    let mut dilated = Vec::with_capacity(3 * cells.len());
    for cell in cells.iter().copied() {
        let BlockCell { code, blocks } = cell;
        let up = (blocks & even) << near | (blocks & !even & low) << (far - near);
        let down = (blocks & !even) >> near | (blocks & even & !low) >> (far - near);
        dilated.push(BlockCell { code, blocks: blocks | up | down });
        let above = (blocks & !even & !low) >> (far + near);
        let below = (blocks & even & low) << (far + near);
        for (ahead, carried) in
            [(true, above), (false, below)].into_iter().filter(|(_, carried)| *carried != 0)
        {
            if let Some(code) = cell.beside(axis, ahead) {
                dilated.push(BlockCell { code, blocks: carried });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::COORD_LIMIT;
    use std::collections::BTreeSet;

    /// Scattered blocks on both sides of zero and at the end of the range.
    fn scattered(seed: i32) -> Vec<BlockCoord> {
        let all = (0..18 * 18 * 18).map(|i| BlockCoord::from([i % 18 - 9, i / 18 % 18 - 7, i / 324 - 10]));
        let some = all.filter(|c| (c.x * 7 + c.y * 11 * seed + c.z * 5 + seed).rem_euclid(13) == 1);
        let end = BlockCoord::from([COORD_LIMIT - 1 - seed, -COORD_LIMIT, 3]);
        sorted(some.chain([end]))
    }

    fn sorted(coords: impl Iterator<Item = BlockCoord>) -> Vec<BlockCoord> {
        let codes: BTreeSet<_> = coords.map(BlockCoord::morton).collect();
        codes.into_iter().map(MortonCode::coord).collect()
    }

    #[test]
    fn a_set_has_its_blocks_in_order() {
        let coords = scattered(1);
        let set = BlockSet::from_coords(&coords);
        assert_eq!(set.coords(), coords);
        assert_eq!(set.count(), coords.len());
        assert!(BlockSet::from_coords(&[]).is_empty() && !set.is_empty());
    }

    #[test]
    fn sets_combine_block_by_block() {
        let (a, b) = (scattered(1), scattered(2));
        let (in_a, in_b) = (|c: &BlockCoord| a.contains(c), |c: &BlockCoord| b.contains(c));
        let (x, y) = (BlockSet::from_coords(&a), BlockSet::from_coords(&b));
        assert_eq!(x.union(&y).coords(), sorted(a.iter().chain(&b).copied()));
        assert_eq!(x.intersection(&y).coords(), sorted(a.iter().copied().filter(in_b)));
        assert_eq!(x.difference(&y).coords(), sorted(a.iter().copied().filter(|c| !in_b(c))));
        assert_eq!(y.difference(&x).coords(), sorted(b.iter().copied().filter(|c| !in_a(c))));
        assert!(x.difference(&x).is_empty());
        assert_eq!(y.marks_in(&x), a.iter().map(in_b).collect::<Vec<_>>());
        assert_eq!(x.filtered(|place| in_b(&a[place])), x.intersection(&y));
        let cell = |c: &BlockCoord| c.to_array().map(|c| c >> 2);
        let part: Vec<_> = b.iter().copied().filter(|c| c.x < 0).collect();
        let elsewhere = |c: &BlockCoord| part.iter().all(|other| cell(other) != cell(c));
        let expected = sorted(a.iter().copied().filter(elsewhere));
        assert!(expected.len() > 10 && expected.len() < a.len());
        assert_eq!(x.outside_cells_of(&BlockSet::from_coords(&part)).coords(), expected);
    }

    #[test]
    fn the_next_cell_is_the_one_at_an_offset_of_one() {
        for coord in scattered(0).into_iter().chain(scattered(3)) {
            let cell = BlockCell::containing(coord);
            for axis in 0..3 {
                let offset = |step| std::array::from_fn(|other| if other == axis { step } else { 0 });
                assert_eq!(cell.beside(axis, true), cell.at_offset(offset(1)), "{coord:?} {axis}");
                assert_eq!(cell.beside(axis, false), cell.at_offset(offset(-1)), "{coord:?} {axis}");
            }
        }
    }

    #[test]
    fn dilation_adds_all_neighbours_in_range() {
        let coords = scattered(3);
        let around = |coord: &BlockCoord| {
            let coord = *coord;
            (0..27).map(move |slot| coord.offset([slot % 3 - 1, slot / 3 % 3 - 1, slot / 9 - 1]))
        };
        let expected = sorted(coords.iter().flat_map(around).filter(|coord| coord.in_range()));
        assert_eq!(BlockSet::from_coords(&coords).dilated().coords(), expected);
    }
}
