//! What a decoder knows after a loss (`docs/spec/format.md`, section 7.13).

use super::sequence::Sequence;
use crate::main_profile::{ExactBlocks, MainBlocks};
use isv_format::Packet;

/// Whether a decoder goes on at resilient frames after a loss, and how right what it has is.
#[derive(Debug, Default)]
pub(super) struct Recovery {
    wanted: bool,
    /// Which blocks of the last frame are exact, unless all are.
    exact: Option<ExactBlocks>,
}

impl Recovery {
    /// Whether to go on at resilient frames.
    pub(super) fn want(&mut self, wanted: bool) {
        self.wanted = wanted;
    }

    /// Whether it goes on at resilient frames.
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// Whether the last frame is exact.
    pub(super) fn is_whole(&self) -> bool {
        self.exact.is_none()
    }

    /// Which blocks of the last frame are exact, unless all are.
    pub(super) fn exact(&self) -> Option<&ExactBlocks> {
        self.exact.as_ref()
    }

    /// Takes note of the frame decoded last: which of its blocks are exact, unless all are.
    pub(super) fn set(&mut self, exact: Option<ExactBlocks>) {
        self.exact = exact;
    }

    /// A frame was lost. The one before it stays, as something to go on from, if that is wanted. `blocks`: how many it has.
    pub(super) fn lose<F>(&mut self, last: Option<F>, blocks: impl FnOnce(&F) -> usize) -> Option<F> {
        let last = last.filter(|_| self.wanted);
        self.exact = last.as_ref().map(|last| ExactBlocks::none(blocks(last)));
        last
    }

    /// Which blocks of the frame that is there are exact for a packet: those known to be if it follows that frame, else none.
    pub(super) fn exact_after(
        &self,
        sequence: &Sequence,
        packet: &Packet,
        blocks: MainBlocks,
    ) -> ExactBlocks {
        let follows = sequence.check(packet, true).is_ok();
        let known = self.exact.clone().filter(|_| follows);
        known.unwrap_or_else(|| ExactBlocks::none(blocks.coded.len()))
    }
}
