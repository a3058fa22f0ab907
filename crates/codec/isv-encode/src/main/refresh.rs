//! Intra refresh: how a stream that goes through lossy channels is made whole again without keyframes.
//!
//! Every frame but the first is resilient (`docs/spec/format.md`, sections 7.10 and 7.13): it can be read whatever was lost before.
//! Over a cycle of frames the volume is made exact, whatever it was. In the `n`-th of `N` frames, the first `n / N` of the blocks,
//! in Morton order, must be exact. A block among these is predicted from the frame before only where that is exact already, else
//! from nothing.

use isv_decode::main::{ExactBlocks, MainBlocks, Vector};
use isv_volume::BlockCoord;

/// How decoders that lost something come to have all again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refresh {
    /// At keyframes, one a GOP.
    #[default]
    Keyframes,
    /// Bit by bit, over as many frames as a GOP would have, again and again; only the first frame is a keyframe. Frames take
    /// more bytes, as what is known of one does not help to code the next, but none takes many more than others.
    Gradual,
}

/// Which blocks of a frame must be exact after it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refreshed<'a> {
    /// The first this many in Morton order.
    blocks: usize,
    /// The frame before, as a decoder has it that had nothing exact when the cycle began.
    before: MainBlocks<'a>,
    exact: &'a ExactBlocks,
}

impl<'a> Refreshed<'a> {
    /// Finds the blocks that must be exact after a frame. The frame has `blocks` blocks and is frame `position` of a cycle of
    /// `cycle`, counted from 0.
    pub(crate) fn new(
        (position, cycle): (u32, u32),
        blocks: usize,
        before: MainBlocks<'a>,
        exact: &'a ExactBlocks,
    ) -> Self {
        let share = (u64::from(position) + 1) * blocks as u64;
        Self { blocks: share.div_ceil(u64::from(cycle)) as usize, before, exact }
    }

    /// Whether a block can be predicted from the frame before under a vector.
    pub(crate) fn allows(&self, block: usize, coord: BlockCoord, vector: Vector) -> bool {
        block >= self.blocks || self.exact.predicts(self.before, coord, vector)
    }
}
