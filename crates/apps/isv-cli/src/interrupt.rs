//! Ctrl-C: work in progress is brought to a good end, not cut off.

use anyhow::{Context, Result};
use isv::raw::take::Cancellation;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// When it was asked for first.
static REQUESTED: OnceLock<Instant> = OnceLock::new();

/// Signals that come together are one request: GNU `timeout` sends one to its child, and then to all of its group.
const TOGETHER: Duration = Duration::from_millis(500);

/// From now on Ctrl-C (or a request to terminate) is noted, for [`requested`] to tell. Another one, half a
/// second later or more, ends the program at once.
pub(crate) fn listen() -> Result<()> {
    let note = || {
        cancellation().cancel();
        if REQUESTED.get_or_init(Instant::now).elapsed() > TOGETHER {
            // The status that shells give to what Ctrl-C ended.
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(note).context("cannot listen for Ctrl-C")
}

/// The request that Ctrl-C makes.
pub(crate) fn cancellation() -> &'static Cancellation {
    static CANCELLATION: OnceLock<Cancellation> = OnceLock::new();
    CANCELLATION.get_or_init(Cancellation::new)
}

/// Whether the user wants the work to end.
pub(crate) fn requested() -> bool {
    cancellation().is_cancelled()
}
