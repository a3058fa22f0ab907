//! The set of coded blocks. A keyframe's is an octree; after it, each block of the reference's volume has a flag, in the
//! context of the surface that is expected there, and the few blocks beyond it are an octree again. Of cells that stay as they
//! are, no block is coded.

use super::still_cells::StillCellModels;
use crate::main_profile::MainReference;
use crate::main_profile::activity::{Activity, expected_activity};
use crate::syntax::SyntaxError;
use crate::syntax::block_set::BlockSetModels as OctreeModels;
use isv_entropy::{BitModel, RangeDecoder};
use isv_volume::{BlockCoord, BlockSet, NeighbourFinder};

/// Models of the set of blocks.
#[derive(Clone, Debug)]
pub struct BlockSetModels {
    /// Cells that stay as they are.
    pub still_cells: StillCellModels,
    /// Blocks that the reference's volume does not have.
    pub octree: OctreeModels,
    by_class: [BitModel; Activity::CLASSES * 32],
    by_distance: [BitModel; Activity::FINE_CLASSES * 4],
    by_surprise: [BitModel; Activity::CLASSES * 7 * 10 * 2],
}

impl Default for BlockSetModels {
    fn default() -> Self {
        Self {
            still_cells: StillCellModels::default(),
            octree: OctreeModels::default(),
            by_class: [BitModel::default(); Activity::CLASSES * 32],
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

    /// Reads a set of `count` blocks, in Morton order, and the blocks of the reference that stay as they are: those of no cell
    /// without `still_cells`.
    ///
    /// # Errors
    /// A set that does not hold as many blocks as the frame header says, holds one twice or one in a cell that stays as it is, or
    /// bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        count: usize,
        reference: Option<&MainReference>,
        still_cells: bool,
    ) -> Result<(BlockSet, Vec<BlockCoord>), SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        let Some(reference) = reference else {
            return Ok((BlockSet::default(), self.octree.decode(&mut decoder, count, None)?));
        };
        let still = match still_cells {
            true => self.still_cells.read(&mut decoder, reference),
            false => BlockSet::default(),
        };
        let mut flags = ExpectedBlocks::new(reference, &still);
        let mut coords = Vec::new();
        for candidate in flags.candidates() {
            let coded = decoder.decode_mixed(self.flag(flags.context(candidate)));
            flags.set(candidate, coded);
            if coded {
                coords.push(reference.volume().coords()[candidate]);
            }
        }
        let Some(rest) = count.checked_sub(coords.len()) else {
            return Err(SyntaxError("the block set holds more blocks than announced"));
        };
        if rest > 0 {
            let others = self.octree.decode(&mut decoder, rest, None)?;
            let outside = BlockSet::of(&others).outside_cells_of(&still);
            if outside.count() < others.len() {
                return Err(SyntaxError("the block set holds a block in a cell that stays as it is"));
            }
            coords.extend(others);
            coords.sort_unstable_by_key(|coord| coord.morton());
            if coords.windows(2).any(|pair| pair[0] == pair[1]) {
                return Err(SyntaxError("the block set holds a block twice"));
            }
        }
        if decoder.overran() {
            return Err(SyntaxError("the block set ends too early"));
        }
        Ok((still, coords))
    }
}

/// Contexts of one flag, as indices of its models.
#[derive(Clone, Copy, Debug)]
pub struct FlagContext {
    by_class: usize,
    by_distance: usize,
    by_surprise: usize,
}

/// The blocks of the reference's volume, which may be coded again, and what is known of them.
#[derive(Debug)]
pub struct ExpectedBlocks<'a> {
    reference: &'a MainReference,
    finder: NeighbourFinder<'a>,
    /// Whether each is in a cell that stays as it is.
    still: Vec<bool>,
    activity: Vec<Activity>,
    /// Whether each is coded, or was and stays, as far as is known.
    coded: Vec<bool>,
}

/// Slots of the faces before a block, of those after it, and of the edges that can come before.
const BEHIND: [usize; 3] = [12, 10, 4];
const AHEAD: [usize; 3] = [14, 16, 22];
const EDGES: [usize; 9] = [9, 3, 1, 11, 15, 5, 7, 21, 19];

impl<'a> ExpectedBlocks<'a> {
    /// All blocks of a reference's volume. Of some it is known that they stay as they are, of the others nothing.
    #[must_use]
    pub fn new(reference: &'a MainReference, still: &BlockSet) -> Self {
        let still = still.marks_in(&reference.extended().blocks.all);
        let activity = expected_activity(reference, &still);
        let was_coded = |block: usize| reference.coded_at(block).is_some();
        let coded = still.iter().enumerate().map(|(block, still)| *still && was_coded(block)).collect();
        Self { reference, finder: reference.finder(), still, activity, coded }
    }

    /// The blocks that may be coded, by index in the volume.
    #[must_use]
    pub fn candidates(&self) -> Vec<usize> {
        (0..self.still.len()).filter(|block| !self.still[*block]).collect()
    }

    /// Notes whether a candidate is coded.
    pub fn set(&mut self, candidate: usize, coded: bool) {
        self.coded[candidate] = coded;
    }

    /// Context of a candidate's flag, once the flags before it are known.
    #[must_use]
    pub fn context(&mut self, candidate: usize) -> FlagContext {
        self.finder.turn_to(self.reference.volume().coords()[candidate]);
        let behind_blocks = BEHIND.map(|slot| self.finder.get(slot));
        let coded = |block: &u32| self.coded[*block as usize];
        let expected = |block: &u32| self.activity[*block as usize].is_expected();
        let behind = behind_blocks.iter().flatten().filter(|block| coded(block)).count();
        let behind_expected = behind_blocks.iter().flatten().filter(|block| expected(block)).count();
        let ahead = AHEAD.map(|slot| self.finder.get(slot)).iter().flatten().filter(|b| expected(b)).count();
        let edges = EDGES.map(|slot| self.finder.get(slot)).iter().flatten().filter(|b| coded(b)).count();
        let was = usize::from(self.reference.coded_at(candidate).is_some());
        let activity = self.activity[candidate];
        FlagContext {
            by_class: ((activity.class() * 4 + behind) * 4 + ahead) * 2 + was,
            by_distance: activity.fine_class() * 4 + behind,
            by_surprise: ((activity.class() * 7 + 3 + behind - behind_expected) * 10 + edges) * 2 + was,
        }
    }
}
