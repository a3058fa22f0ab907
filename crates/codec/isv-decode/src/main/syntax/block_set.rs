//! The set of coded blocks. A keyframe's is an octree. After it, each block of the reference's volume has a flag, in the context
//! of the surface that is expected there. The few blocks beyond that volume are an octree again. Of cells that stay as they are,
//! no block is coded.

use super::skip_cells::SkipCellModels;
use crate::main::MainBlocks;
use crate::main::activity::Activity;
use crate::main::extension::FrameBlocks;
use crate::shared::syntax::SyntaxError;
use crate::shared::syntax::block_set::BlockSetModels as OctreeModels;
use foldhash::HashMap;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{BlockCell, BlockCoord, BlockSet};
use std::iter::Peekable;
use std::slice::Iter;
use std::sync::LazyLock;

/// Models of the set of blocks.
#[derive(Clone, Debug)]
pub struct BlockSetModels {
    /// Cells that stay as they are.
    pub skip_cells: SkipCellModels,
    /// Blocks that the reference's volume does not have.
    pub octree: OctreeModels,
    /// By class, coded faces before the block (0 to 3), expected faces after it (0 to 3), and whether it was coded.
    by_class: [BitModel; Activity::CLASSES * 4 * 4 * 2],
    /// By fine class and coded faces before the block.
    by_distance: [BitModel; Activity::FINE_CLASSES * 4],
    /// By class, surprise (-3 to 3), coded edges (0 to 9), and whether the block was coded. The surprise is how many more faces
    /// before the block are coded than were expected.
    by_surprise: [BitModel; Activity::CLASSES * 7 * 10 * 2],
}

impl Default for BlockSetModels {
    fn default() -> Self {
        Self {
            skip_cells: SkipCellModels::default(),
            octree: OctreeModels::default(),
            by_class: [BitModel::default(); Activity::CLASSES * 4 * 4 * 2],
            by_distance: [BitModel::default(); Activity::FINE_CLASSES * 4],
            by_surprise: [BitModel::default(); Activity::CLASSES * 7 * 10 * 2],
        }
    }
}

impl BlockSetModels {
    /// The models of a flag in a context.
    pub fn flag(&mut self, context: FlagContext) -> [&mut BitModel; 3] {
        [
            &mut self.by_class[context.by_class],
            &mut self.by_distance[context.by_distance],
            &mut self.by_surprise[context.by_surprise],
        ]
    }

    /// Reads a set of `count` blocks, in Morton order, and the blocks of the reference that stay as they are. Without
    /// `skip_cells` none stay. `activity`: of every block of the reference, in order, once it is known which of them stay; not
    /// asked for without a reference.
    ///
    /// # Errors
    /// Any error of `activity`. A set that does not hold as many blocks as the frame header says. A set that holds a block twice,
    /// or one in a cell that stays as it is. Bytes that end too early.
    pub fn read<E: From<SyntaxError>>(
        &mut self,
        bytes: &[u8],
        count: usize,
        reference: Option<MainBlocks>,
        skip_cells: bool,
        activity: impl FnOnce(&BlockSet) -> Result<Vec<Activity>, E>,
    ) -> Result<(BlockSet, Vec<BlockCoord>), E> {
        let mut decoder = RangeDecoder::new(bytes);
        let Some(reference) = reference else {
            return Ok((BlockSet::default(), self.octree.decode(&mut decoder, count, None)?));
        };
        let skipped = match skip_cells {
            true => self.skip_cells.read(&mut decoder, reference),
            false => BlockSet::default(),
        };
        let mut flags = ExpectedBlocks::new(reference, &skipped, activity(&skipped)?);
        let mut coords = Vec::new();
        for candidate in flags.candidates(&skipped) {
            if decoder.decode_mixed(self.flag(flags.context(candidate))) {
                flags.set_coded(candidate);
                coords.push(reference.blocks.coords[candidate.block as usize]);
            }
            if decoder.overran() {
                return Err(SyntaxError("the block set ends too early").into());
            }
        }
        let Some(rest) = count.checked_sub(coords.len()) else {
            return Err(SyntaxError("the block set holds more blocks than announced").into());
        };
        if rest > 0 {
            let others = self.octree.decode(&mut decoder, rest, None)?;
            let outside = BlockSet::from_coords(&others).outside_cells_of(&skipped);
            if outside.count() < others.len() {
                return Err(SyntaxError("the block set holds a block in a cell that stays as it is").into());
            }
            coords.extend(others);
            coords.sort_unstable_by_key(|coord| coord.morton());
            if coords.windows(2).any(|pair| pair[0] == pair[1]) {
                return Err(SyntaxError("the block set holds a block twice").into());
            }
        }
        if decoder.overran() {
            return Err(SyntaxError("the block set ends too early").into());
        }
        Ok((skipped, coords))
    }
}

/// Contexts of one flag, as indices of its models.
#[derive(Clone, Copy, Debug)]
pub struct FlagContext {
    by_class: usize,
    by_distance: usize,
    by_surprise: usize,
}

/// The blocks of the reference's volume, which may be coded again, and what is known of them: bits of cells of 4x4x4 blocks.
#[derive(Debug)]
pub struct ExpectedBlocks {
    cells: Vec<ExpectedCell>,
    /// Which of the cells has a code.
    numbers: HashMap<u64, u32>,
    activity: Vec<Activity>,
    /// The cell of the last context asked for, and the 3x3x3 cells around it, where they are.
    around: (u32, [Option<u32>; 27]),
}

/// What is known of the blocks in a cell: a bit a block, in Morton order.
#[derive(Clone, Copy, Debug)]
struct ExpectedCell {
    cell: BlockCell,
    /// Blocks that were coded.
    was: u64,
    /// Blocks that surface is expected in.
    expected: u64,
    /// Blocks that are coded, or were and stay, as far as is known.
    coded: u64,
}

/// A block that may be coded.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Index of the block in the reference's volume.
    pub block: u32,
    /// Which of the cells it is in, and where.
    cell: u32,
    bit: u32,
}

impl ExpectedBlocks {
    /// All blocks of a reference's volume. Of some it is known that they stay as they are, of the others nothing but their
    /// `activity`: that of all blocks, in order.
    #[must_use]
    pub fn new(reference: MainBlocks, skipped: &BlockSet, activity: Vec<Activity>) -> Self {
        let FrameBlocks { all, coded, .. } = reference.sets;
        let (mut was, mut kept) = (coded.cells().iter().peekable(), skipped.cells().iter().peekable());
        let mut next = activity.iter();
        let cells = all.cells().iter().map(|cell| {
            let bits = |cells: &mut Peekable<Iter<BlockCell>>| {
                cells.next_if(|other| other.code == cell.code).map_or(0, |cell| cell.blocks)
            };
            let (was, kept) = (bits(&mut was), bits(&mut kept));
            let expected = set_bits(cell.blocks).filter(|_| next.next().is_some_and(|a| a.is_expected()));
            let expected = expected.fold(0, |bits, bit| bits | 1 << bit);
            ExpectedCell { cell: *cell, was, expected, coded: was & kept }
        });
        let cells: Vec<_> = cells.collect();
        let numbers = cells.iter().zip(0..).map(|(cell, number)| (cell.cell.code, number)).collect();
        Self { cells, numbers, activity, around: (u32::MAX, [None; 27]) }
    }

    /// The blocks that may be coded, in order: those of no cell that stays as it is, which `skipped` has the blocks of.
    #[must_use]
    pub fn candidates(&self, skipped: &BlockSet) -> Vec<Candidate> {
        let mut skipped = skipped.cells().iter().peekable();
        let (mut candidates, mut first) = (Vec::with_capacity(self.activity.len()), 0);
        for (number, ExpectedCell { cell, .. }) in (0..).zip(&self.cells) {
            if skipped.next_if(|other| other.code == cell.code).is_none() {
                let blocks = (first..).zip(set_bits(cell.blocks));
                candidates.extend(blocks.map(|(block, bit)| Candidate { block, cell: number, bit }));
            }
            first += cell.blocks.count_ones();
        }
        candidates
    }

    /// Notes that a candidate is coded.
    pub fn set_coded(&mut self, candidate: Candidate) {
        self.cells[candidate.cell as usize].coded |= 1 << candidate.bit;
    }

    /// Context of a candidate's flag, once the flags before it are known.
    #[must_use]
    pub fn context(&mut self, Candidate { block, cell, bit }: Candidate) -> FlagContext {
        if self.around.0 != cell {
            self.around = (cell, self.cells_around(cell));
        }
        let [behind, ahead, edges] = &NEIGHBOURS[bit as usize];
        let coded = |cell: &ExpectedCell| cell.coded;
        let expected = |cell: &ExpectedCell| cell.expected;
        let (behind, behind_expected) = (self.count(behind, coded), self.count(behind, expected));
        let (ahead, edges) = (self.count(ahead, expected), self.count(edges, coded));
        let was = (self.cells[cell as usize].was >> bit & 1) as usize;
        let activity = self.activity[block as usize];
        FlagContext {
            by_class: ((activity.class() * 4 + behind) * 4 + ahead) * 2 + was,
            by_distance: activity.fine_class() * 4 + behind,
            by_surprise: ((activity.class() * 7 + 3 + behind - behind_expected) * 10 + edges) * 2 + was,
        }
    }

    /// How many of some neighbours are in a set.
    #[inline(always)]
    fn count(&self, neighbours: &Neighbours, set: impl Fn(&ExpectedCell) -> u64) -> usize {
        let mut count = 0;
        for (slot, bits) in &neighbours.parts[..neighbours.cells] {
            if let Some(cell) = self.around.1[*slot] {
                count += (set(&self.cells[cell as usize]) & bits).count_ones();
            }
        }
        count as usize
    }

    fn cells_around(&self, cell: u32) -> [Option<u32>; 27] {
        let middle = self.cells[cell as usize].cell;
        std::array::from_fn(|slot| {
            let offset = [slot % 3, slot / 3 % 3, slot / 9].map(|step| step as i32 - 1);
            self.numbers.get(&middle.at_offset(offset)?).copied()
        })
    }
}

/// The bits of a word that are set, lowest first.
fn set_bits(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

/// Offsets of the faces before a block, of those after it, and of the edges that can come before.
const BEHIND: [[i32; 3]; 3] = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]];
const AHEAD: [[i32; 3]; 3] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const EDGES: [[i32; 3]; 9] = [
    [-1, -1, 0],
    [-1, 0, -1],
    [0, -1, -1],
    [1, -1, 0],
    [-1, 1, 0],
    [1, 0, -1],
    [0, 1, -1],
    [0, -1, 1],
    [-1, 0, 1],
];

/// Some neighbours of a block, as bits of the cells around its own.
#[derive(Clone, Copy, Debug)]
struct Neighbours {
    /// How many cells they are in.
    cells: usize,
    /// Slots of those cells among 3x3x3, and the bits there.
    parts: [(usize, u64); 9],
}

impl Neighbours {
    /// Neighbours at these offsets of the block at a bit of its cell.
    fn new(bit: u32, offsets: &[[i32; 3]]) -> Self {
        let mut neighbours = Self { cells: 0, parts: [(0, 0); 9] };
        let at = [0, 1, 2].map(|axis| (bit >> axis & 1 | bit >> (axis + 2) & 2) as i32);
        for offset in offsets {
            let place: [i32; 3] = std::array::from_fn(|axis| at[axis] + offset[axis]);
            let slot = place.iter().rev().fold(0, |slot, c| slot * 3 + (c >> 2) + 1) as usize;
            let within = place.map(|c| SPREAD[(c & 3) as usize]);
            let bits = 1 << (within[0] | within[1] << 1 | within[2] << 2);
            match neighbours.parts[..neighbours.cells].iter_mut().find(|(other, _)| *other == slot) {
                Some((_, others)) => *others |= bits,
                None => {
                    neighbours.parts[neighbours.cells] = (slot, bits);
                    neighbours.cells += 1;
                }
            }
        }
        neighbours
    }
}

/// Two bits, each followed by two empty places.
const SPREAD: [u32; 4] = [0, 1, 8, 9];

/// Builds the table of this module, which is else built by whoever needs it first. A process that is forked meanwhile would wait for it
/// for ever.
pub fn build_table() {
    LazyLock::force(&NEIGHBOURS);
}

/// For each bit of a cell, the neighbours [`BEHIND`], [`AHEAD`] and at [`EDGES`].
static NEIGHBOURS: LazyLock<[[Neighbours; 3]; 64]> = LazyLock::new(|| {
    std::array::from_fn(|bit| {
        [&BEHIND[..], &AHEAD, &EDGES].map(|offsets| Neighbours::new(bit as u32, offsets))
    })
});
