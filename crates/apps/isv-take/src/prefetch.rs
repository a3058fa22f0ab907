//! Work ahead of its use: the stages of a pipeline.

use crate::Cancellation;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often a stage that waits looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// What an iterator yields, fetched on a thread of its own while what it yielded before is used.
///
/// One item waits and one is being made, so memory does not grow with the number of items. A panic of the thread goes
/// on here. When the work is cancelled, this ends, even while the thread waits for input.
#[derive(Debug)]
pub struct Prefetch<T> {
    items: Receiver<T>,
    thread: Option<JoinHandle<()>>,
    cancellation: Cancellation,
}

impl<T: Send + 'static> Prefetch<T> {
    /// Starts fetching.
    #[must_use]
    pub fn new(items: impl Iterator<Item = T> + Send + 'static, cancellation: &Cancellation) -> Self {
        let (sender, receiver) = sync_channel(0);
        let thread = std::thread::spawn(move || {
            for item in items {
                // The receiver is gone when the rest is not wanted.
                if sender.send(item).is_err() {
                    return;
                }
            }
        });
        Self { items: receiver, thread: Some(thread), cancellation: cancellation.clone() }
    }
}

impl<T> Iterator for Prefetch<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        loop {
            match self.items.recv_timeout(PATIENCE) {
                _ if self.cancellation.is_cancelled() => return None,
                Ok(item) => return Some(item),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                        std::panic::resume_unwind(panic);
                    }
                    return None;
                }
            }
        }
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
}
