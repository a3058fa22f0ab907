//! Work ahead of its use: the stages of a pipeline.

use crate::Cancellation;
use std::fmt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often a stage that waits looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// What an iterator yields, fetched on a thread of its own while what it yielded before is used.
///
/// One item waits and one is being made, so memory does not grow with the number of items. A panic of the thread goes
/// on here. When the work is cancelled, this ends, even while the thread waits for input.
///
/// On a thread of a rayon pool, items are fetched in turn, without a thread: it would leave the pool that the caller chose.
pub struct Prefetch<T> {
    items: Items<T>,
    cancellation: Cancellation,
}

enum Items<T> {
    /// Fetched on a thread.
    Ahead { items: Receiver<T>, thread: Option<JoinHandle<()>> },
    /// Fetched when they are asked for.
    InTurn(Box<dyn Iterator<Item = T> + Send>),
}

impl<T: Send + 'static> Prefetch<T> {
    /// Starts fetching.
    #[must_use]
    pub fn new(items: impl Iterator<Item = T> + Send + 'static, cancellation: &Cancellation) -> Self {
        let cancellation = cancellation.clone();
        if rayon::current_thread_index().is_some() {
            return Self { items: Items::InTurn(Box::new(items)), cancellation };
        }
        let (sender, receiver) = sync_channel(0);
        let thread = std::thread::spawn(move || {
            for item in items {
                // The receiver is gone when the rest is not wanted.
                if sender.send(item).is_err() {
                    return;
                }
            }
        });
        Self { items: Items::Ahead { items: receiver, thread: Some(thread) }, cancellation }
    }
}

impl<T> Iterator for Prefetch<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        let Self { items, cancellation } = self;
        let (items, thread) = match items {
            Items::InTurn(_) if cancellation.is_cancelled() => return None,
            Items::InTurn(items) => return items.next(),
            Items::Ahead { items, thread } => (items, thread),
        };
        loop {
            match items.recv_timeout(PATIENCE) {
                _ if cancellation.is_cancelled() => return None,
                Ok(item) => return Some(item),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    if let Some(Err(panic)) = thread.take().map(JoinHandle::join) {
                        std::panic::resume_unwind(panic);
                    }
                    return None;
                }
            }
        }
    }
}

impl<T> fmt::Debug for Prefetch<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Prefetch").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn items_come_in_order_and_only_one_is_made_too_early() {
        let made = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&made);
        let counted = (0..100).inspect(move |_| _ = counter.fetch_add(1, Ordering::SeqCst));
        let items = Prefetch::new(counted, &Cancellation::new());
        for (used, item) in items.enumerate() {
            assert_eq!(item, used);
            assert!(made.load(Ordering::SeqCst) <= used + 2);
        }
    }

    #[test]
    #[should_panic(expected = "the third item")]
    fn a_panic_is_not_taken_for_the_end() {
        let items = (0..9).inspect(|i| assert!(*i < 2, "the third item"));
        Prefetch::new(items, &Cancellation::new()).for_each(drop);
    }

    #[test]
    fn cancelled_work_ends_while_it_waits() {
        let (cancellation, (_sender, receiver)) = (Cancellation::new(), sync_channel::<()>(0));
        let mut items = Prefetch::new(receiver.into_iter(), &cancellation);
        cancellation.cancel();
        assert!(items.next().is_none());
    }

    #[test]
    fn on_a_thread_of_a_pool_items_are_made_on_that_thread() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        pool.install(|| {
            let here = std::thread::current().id();
            let items = (0..3).map(|_| std::thread::current().id());
            let makers: Vec<_> = Prefetch::new(items, &Cancellation::new()).collect();
            assert_eq!(makers, [here; 3]);
            let cancelled = Cancellation::new();
            cancelled.cancel();
            assert!(Prefetch::new(0..3, &cancelled).next().is_none());
        });
    }
}
