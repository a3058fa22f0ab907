//! How many threads share the work.

use crate::failure::usage;
use anyhow::{Context, Result};
use std::num::NonZero;

/// More threads than this only get in each other's way.
const MOST_THREADS: usize = 256;

/// Sets the number of threads that the codec works with; without a number, all cores.
pub(crate) fn use_threads(threads: Option<NonZero<usize>>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    if threads.get() > MOST_THREADS {
        return Err(usage(format!("--threads {threads}: at most {MOST_THREADS}")));
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .with_context(|| format!("cannot start {threads} threads"))
}
