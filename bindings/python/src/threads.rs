//! Threads that do the work, also in a process that was forked.
//!
//! The threads of a pool are not there in a child that was forked: work that is handed to them would never be done. So the process that
//! used the pool first owns it, and each other process makes one of its own.

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::process;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, TryLockError};

/// The process that owns rayon's global pool; 0 before it is used.
static OWNER: AtomicU32 = AtomicU32::new(0);
/// Threads that were asked for; 0 for one a processor.
static THREADS: AtomicUsize = AtomicUsize::new(0);
/// The pool of a process, where the global one is not used.
static POOL: Mutex<Option<OwnPool>> = Mutex::new(None);

struct OwnPool {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// Chooses the number of threads of this process; `None` for one a processor.
#[pyfunction]
pub(crate) fn set_threads(threads: Option<usize>) {
    THREADS.store(threads.unwrap_or(0), Ordering::Relaxed);
}

/// Runs work on the threads of this process.
pub(crate) fn run<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let (process, threads) = (process::id(), THREADS.load(Ordering::Relaxed));
    let owner = match OWNER.compare_exchange(0, process, Ordering::Relaxed, Ordering::Relaxed) {
        Ok(_) => process,
        Err(owner) => owner,
    };
    if owner == process && threads == 0 { work() } else { own_pool(process, threads).install(work) }
}

/// The pool of this process.
fn own_pool(process: u32, threads: usize) -> Arc<ThreadPool> {
    let make = || {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        Arc::new(pool.expect("a process can start threads"))
    };
    let mut kept = match POOL.try_lock() {
        Ok(kept) => kept,
        Err(TryLockError::Poisoned(kept)) => kept.into_inner(),
        // Another thread is at it, or was in the process that this one was forked from and never ends.
        Err(TryLockError::WouldBlock) => return make(),
    };
    if let Some(own) = kept.as_ref().filter(|own| own.process == process && own.threads == threads) {
        return Arc::clone(&own.pool);
    }
    let pool = make();
    if let Some(former) = kept.replace(OwnPool { process, threads, pool: Arc::clone(&pool) })
        && former.process != process
    {
        // To end it would wait for threads that are not there.
        std::mem::forget(former);
    }
    pool
}
