//! Two steps of a job at once, and how many threads share the work.

use anyhow::{Context, Result};
use std::num::NonZero;
use std::sync::mpsc::sync_channel;
use std::thread;

/// Sets the number of threads that the codec works with; without a number, all cores.
pub(crate) fn use_threads(threads: Option<NonZero<usize>>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .with_context(|| format!("cannot start {threads} threads"))
}

/// Passes items to `consume` in order while the next one is made on another thread. Two items exist at a time.
///
/// The first error of either side ends both.
pub(crate) fn overlap<T: Send>(
    items: impl Iterator<Item = Result<T>> + Send,
    mut consume: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    thread::scope(|scope| {
        let (sender, receiver) = sync_channel(0);
        scope.spawn(move || {
            for item in items {
                let last = item.is_err();
                // A receiver that has gone has failed, and says why.
                if sender.send(item).is_err() || last {
                    return;
                }
            }
        });
        // Leaving the loop drops the receiver, which stops the sender.
        for item in receiver {
            consume(item?)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{anyhow, bail};

    #[test]
    fn items_arrive_in_order_up_to_the_first_error_of_either_side() {
        let mut seen = Vec::new();
        overlap((0..4).map(Ok), |i| {
            seen.push(i);
            Ok(())
        })
        .unwrap();
        assert_eq!(seen, [0, 1, 2, 3]);

        let made = (0..9).map(|i| if i < 2 { Ok(i) } else { Err(anyhow!("made {i}")) });
        assert_eq!(overlap(made, |_| Ok(())).unwrap_err().to_string(), "made 2");

        let endless = (0..).map(Ok);
        let error = overlap(endless, |i| if i < 3 { Ok(()) } else { bail!("used {i}") }).unwrap_err();
        assert_eq!(error.to_string(), "used 3");
    }
}
