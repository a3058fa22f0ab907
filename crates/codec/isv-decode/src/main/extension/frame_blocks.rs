//! The blocks of an extended frame, by what becomes of them.

use isv_volume::{BlockCoord, BlockSet};

/// What a frame keeps of the frame before.
#[derive(Clone, Copy, Debug)]
pub struct Kept<'a> {
    /// The blocks of the frame before.
    pub before: &'a FrameBlocks,
    /// Blocks of the frame before in the cells of 4x4x4 blocks that stay as they are.
    pub skipped: &'a BlockSet,
}

/// The sets of a frame's blocks: all that can be said of it once its coded blocks are known. Takes memory for the cells of
/// 4x4x4 blocks that it has blocks in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameBlocks {
    /// All of them, coded or not.
    pub all: BlockSet,
    /// Blocks that were coded, in this frame or in an earlier one that they are kept of.
    pub coded: BlockSet,
    /// Blocks whose samples are of this frame: coded in it, or extrapolated anew.
    pub fresh: BlockSet,
    /// Blocks whose masks are of this frame. The others lie where nothing has changed.
    pub unsettled: BlockSet,
}

impl FrameBlocks {
    /// Sets of a frame with these coded blocks, in Morton order and none of them in a cell that is kept.
    #[must_use]
    pub fn new(coded: &[BlockCoord], kept: Option<Kept>) -> Self {
        let now = BlockSet::from_coords(coded);
        let Some(Kept { before, skipped }) = kept else {
            let all = now.dilated();
            return Self { fresh: all.clone(), unsettled: all.clone(), coded: now, all };
        };
        let changed = now.union(&before.coded.difference(skipped));
        // A block is extrapolated from those around it, and its masks depend on the samples around it.
        let reached = changed.dilated();
        let unsettled = reached.dilated();
        let kept_coded = before.coded.intersection(skipped);
        let coded = now.union(&kept_coded);
        let beside_coded = coded.intersection(&unsettled).dilated();
        let fresh = now.union(&reached.intersection(&beside_coded).difference(&coded));
        let all = before.all.difference(&reached).union(&kept_coded).union(&fresh);
        Self { unsettled: unsettled.intersection(&all), coded, fresh, all }
    }
}
