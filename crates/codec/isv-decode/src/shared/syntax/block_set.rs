//! The set of blocks: an octree over block coordinates, coded level by level. The context of a cell is its neighbours and the
//! same cell in the frame before. Newly active and removed blocks (Sec. 3.4) need nothing more.

use super::{SyntaxError, check_overrun};
use crate::ReferenceBlocks;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{BlockCoord, MortonCode};

/// Levels above single blocks that the whole coordinate range needs.
pub const MAX_DEPTH: u32 = 21;
/// Bits that state the depth of the root.
pub const DEPTH_BITS: u32 = 5;

/// Models of the octree's cells.
#[derive(Clone, Debug)]
pub struct BlockSetModels {
    /// Whether a cell holds blocks, by [`CellContext::model`].
    pub cell: [BitModel; CellContext::MODELS],
}

impl Default for BlockSetModels {
    fn default() -> Self {
        Self { cell: [BitModel::default(); CellContext::MODELS] }
    }
}

impl BlockSetModels {
    /// Reads a set of `count` blocks, in Morton order.
    ///
    /// # Errors
    /// A tree that does not hold as many blocks as the frame header says, or bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        count: usize,
        reference: Option<ReferenceBlocks>,
    ) -> Result<Vec<BlockCoord>, SyntaxError> {
        self.decode(&mut RangeDecoder::new(bytes), count, reference)
    }

    /// [`Self::read`] from a segment that may hold more than the set.
    pub(crate) fn decode(
        &mut self,
        decoder: &mut RangeDecoder,
        count: usize,
        reference: Option<ReferenceBlocks>,
    ) -> Result<Vec<BlockCoord>, SyntaxError> {
        if count == 0 {
            return Ok(Vec::new());
        }
        let depth = decoder.decode_raw(DEPTH_BITS);
        if depth > MAX_DEPTH {
            return Err(SyntaxError("the block set's root is larger than the coordinate range"));
        }
        let root =
            (0..3 * (MAX_DEPTH - depth)).fold(0, |code, _| code << 1 | u64::from(decoder.decode_raw(1)));
        let mut cells = vec![root];
        for level in (0..depth).rev() {
            let mut context = CellContext::new(level, &cells, reference);
            let mut children = Vec::new();
            for parent in cells {
                let first = children.len();
                for octant in 0..8 {
                    let cell = parent << 3 | octant;
                    // A cell is only there because it holds a block, so the last of its children is sometimes certain.
                    let certain = octant == 7 && children.len() == first;
                    if certain || decoder.decode(&mut self.cell[context.model(cell)]) {
                        context.occupy(cell);
                        children.push(cell);
                    }
                }
                // What is read beyond the end are cells without end.
                check_overrun(decoder, "the block set ends too early")?;
                // Every cell holds at least one block: stop before the memory for more than were announced is taken.
                if children.len() > count {
                    return Err(SyntaxError("the block set holds more blocks than announced"));
                }
            }
            cells = children;
        }
        check_overrun(decoder, "the block set ends too early")?;
        if cells.len() != count {
            return Err(SyntaxError("the block set holds fewer blocks than announced"));
        }
        Ok(cells.into_iter().map(|code| MortonCode(code).coord()).collect())
    }
}

/// Hashed with a random key, as streams choose the cells: with a known hash all of them could be made to collide.
type CellSet = foldhash::HashSet<u64>;

/// What is known around a cell of one level of the octree. Cells are Morton codes without their lowest `3 * level` bits.
#[derive(Debug)]
pub struct CellContext {
    level: u32,
    /// Cells of this level found so far.
    current: CellSet,
    /// Cells of the level above.
    parents: CellSet,
    /// Cells of this level in the frame before.
    before: Option<CellSet>,
}

impl CellContext {
    /// Three kinds of level, whether the cell was there, 0 to 3 neighbours before it and 0 to 3 after it.
    const MODELS: usize = 3 * 2 * 4 * 4;

    /// Context for the children of `parents`, which lie on `level`.
    #[must_use]
    pub fn new(level: u32, parents: &[u64], reference: Option<ReferenceBlocks>) -> Self {
        let before = reference.map(|r| r.coords.iter().map(|c| c.morton().0 >> (3 * level)).collect());
        Self { level, current: CellSet::default(), parents: parents.iter().copied().collect(), before }
    }

    /// Notes that a cell holds blocks.
    pub fn occupy(&mut self, cell: u64) {
        self.current.insert(cell);
    }

    /// Model of a cell, by:
    ///
    /// - its level (blocks, cells of 2^3 blocks, larger);
    /// - whether the frame before has it;
    /// - how many of its three neighbours before it are there;
    /// - how many of the three after it are to be expected: those of the frame before, or, in a keyframe, those whose parents are
    ///   there.
    #[must_use]
    pub fn model(&self, cell: u64) -> usize {
        let was_there = self.before.as_ref().is_some_and(|b| b.contains(&cell));
        let mut behind = 0;
        let mut ahead = 0;
        for axis in 0..3 {
            behind += usize::from(step_down(cell, axis).is_some_and(|c| self.current.contains(&c)));
            ahead += usize::from(step_up(cell, axis).is_some_and(|c| match &self.before {
                Some(before) => before.contains(&c),
                None => self.parents.contains(&(c >> 3)),
            }));
        }
        ((self.level.min(2) as usize * 2 + usize::from(was_there)) * 4 + behind) * 4 + ahead
    }
}

/// Bits of one axis in a Morton code.
fn axis_mask(axis: u32) -> u64 {
    0x1249_2492_4924_9249 << axis
}

/// The cell one further down an axis.
fn step_down(cell: u64, axis: u32) -> Option<u64> {
    let mask = axis_mask(axis);
    (cell & mask != 0).then(|| (cell & mask).wrapping_sub(1) & mask | cell & !mask)
}

/// The cell one further up an axis. Past the end of the coordinate range there is a code too, but never a block.
fn step_up(cell: u64, axis: u32) -> Option<u64> {
    let mask = axis_mask(axis);
    (cell & mask != mask).then(|| (cell | !mask).wrapping_add(1) & mask | cell & !mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_agree_with_coordinates() {
        for c in [[0, 0, 0], [-1, 7, 255], [1023, -512, 3]] {
            let coord = BlockCoord::from(c);
            let cell = coord.morton().0;
            for (axis, up) in [[1, 0, 0], [0, 1, 0], [0, 0, 1]].into_iter().enumerate() {
                assert_eq!(step_up(cell, axis as u32), Some(coord.offset(up).morton().0));
                assert_eq!(step_down(cell, axis as u32), Some(coord.offset(up.map(|v: i32| -v)).morton().0));
            }
        }
        assert_eq!(step_down(0, 0), None);
    }
}
