//! Ctrl-C: work in progress is brought to a good end, not cut off.

use anyhow::{Context, Result};
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C (or a request to terminate) is noted, for [`requested`] to tell; the second one ends the program
/// at once.
pub(crate) fn listen() -> Result<()> {
    let note = || {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            // The status that shells give to what Ctrl-C ended.
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(note).context("cannot listen for Ctrl-C")
}

/// Whether the user wants the work to end.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
