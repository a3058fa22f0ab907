//! What one thread at a time uses.

use crate::threads;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

/// A value that one thread at a time uses, without the GIL. Others wait for it.
///
/// The value may call methods of Python objects. Such a method that wants the value again would wait for itself.
pub(crate) struct Exclusive<T> {
    value: Mutex<T>,
    /// The thread that works with the value now.
    user: Mutex<Option<ThreadId>>,
}

impl<T: Send> Exclusive<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { value: Mutex::new(value), user: Mutex::new(None) }
    }

    /// Uses the value, on the pool of threads.
    ///
    /// # Errors
    /// `RuntimeError` in a method that the value has called.
    pub(crate) fn with<R: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut T) -> R + Send) -> PyResult<R> {
        let worked = py.detach(|| {
            if *held(&self.user) == Some(thread::current().id()) {
                return None;
            }
            let mut value = held(&self.value);
            let value = &mut *value;
            Some(threads::run(|| {
                *held(&self.user) = Some(thread::current().id());
                let _leaving = Leaving(&self.user);
                work(value)
            }))
        });
        worked.ok_or_else(|| {
            PyRuntimeError::new_err("a file's read or write cannot use the take or the writer that calls it")
        })
    }
}

/// Notes at its end that nobody works with the value any more.
struct Leaving<'a>(&'a Mutex<Option<ThreadId>>);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        *held(self.0) = None;
    }
}

fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
