//! What a decoder knows after a loss (`docs/spec/format.md`, section 7.13).

use crate::decoder::sequence::Sequence;
use crate::main::{ExactBlocks, MainBlocks};
use isv_format::Packet;

/// Whether a decoder goes on at resilient frames after a loss, and how right what it has is.
#[derive(Debug, Default)]
pub(crate) struct Recovery {
    wanted: bool,
    /// Which blocks of the last frame are exact, unless all are.
    exact: Option<ExactBlocks>,
}

/// How the frame that is there differs from the one before a packet.
#[derive(Debug)]
pub(crate) struct Gap {
    /// Which of its blocks are exact.
    pub exact: ExactBlocks,
    /// How many frames are missing in between.
    pub missing: u16,
}

impl Recovery {
    /// Whether to go on at resilient frames.
    pub(crate) fn want(&mut self, wanted: bool) {
        self.wanted = wanted;
    }

    /// Whether it goes on at resilient frames.
    pub(crate) fn is_wanted(&self) -> bool {
        self.wanted
    }

    /// Whether the last frame is exact.
    pub(crate) fn is_whole(&self) -> bool {
        self.exact.is_none()
    }

    /// Which blocks of the last frame are exact, unless all are.
    pub(crate) fn exact(&self) -> Option<&ExactBlocks> {
        self.exact.as_ref()
    }

    /// Takes note of the frame decoded last: which of its blocks are exact, unless all are.
    pub(crate) fn set(&mut self, exact: Option<ExactBlocks>) {
        self.exact = exact;
    }

    /// A frame was lost. The one before it stays, as something to go on from, if that is wanted. `blocks`: how many it has.
    pub(crate) fn lose<F>(&mut self, last: Option<F>, blocks: impl FnOnce(&F) -> usize) -> Option<F> {
        let last = last.filter(|_| self.wanted);
        self.exact = last.as_ref().map(|last| ExactBlocks::none(blocks(last)));
        last
    }

    /// The gap between the frame that is there and a packet: none of its blocks are known to be exact unless the packet follows it.
    /// `blocks`: its blocks.
    pub(crate) fn gap(&self, sequence: &Sequence, packet: &Packet, blocks: MainBlocks) -> Gap {
        let follows = sequence.check(packet, true).is_ok();
        let known = self.exact.clone().filter(|_| follows);
        Gap {
            exact: known.unwrap_or_else(|| ExactBlocks::none(blocks.coded.len())),
            missing: sequence.missing_before(packet),
        }
    }
}
