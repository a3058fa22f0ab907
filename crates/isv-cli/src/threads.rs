//! How many threads share the work.

use anyhow::{Context, Result};
use std::num::NonZero;

/// Sets the number of threads that the codec works with; without a number, all cores.
pub(crate) fn use_threads(threads: Option<NonZero<usize>>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .with_context(|| format!("cannot start {threads} threads"))
}
