//! `--max-memory`: how much a frame of a stream may ask for.

use isv::raw::take::{MemoryLimit, MemorySize};
use std::sync::OnceLock;

static CHOSEN: OnceLock<MemorySize> = OnceLock::new();

/// Decides for the whole program; once.
pub(crate) fn choose(size: MemorySize) {
    // Nobody chooses twice.
    let _ = CHOSEN.set(size);
}

/// What was decided, if anything.
pub(crate) fn chosen() -> Option<MemorySize> {
    CHOSEN.get().copied()
}

/// Memory for the frames of streams.
pub(crate) fn limit() -> MemoryLimit {
    MemoryLimit { bytes: chosen().map(MemorySize::bytes) }
}
