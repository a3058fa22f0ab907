//! The progress bar: on a terminal's stderr, nowhere else.

use crate::output::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, stderr};

/// Steps done out of a number that may be unknown. The bar goes when the value is dropped.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: ProgressBar,
    silent: bool,
}

impl Progress {
    /// A bar for `total` steps, labelled with what is being done.
    pub(crate) fn new(total: Option<usize>, label: &'static str) -> Self {
        let target =
            if stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(total.map(|n| n as u64), target).with_message(label);
        let template = match total {
            Some(_) => "{msg} {wide_bar} {pos}/{len} {eta}",
            None => "{msg} {pos} {elapsed}",
        };
        bar.set_style(ProgressStyle::with_template(template).expect("the templates above are well-formed"));
        Self { bar, silent: false }
    }

    /// The same with nothing to say: for a pass over frames that are looked at again.
    pub(crate) fn silent(total: Option<usize>, label: &'static str) -> Self {
        let mut progress = Self::new(total, label);
        progress.silent = true;
        progress
    }

    /// One step is done.
    pub(crate) fn step(&self) {
        self.bar.inc(1);
    }

    /// Says something on stderr, above the bar.
    pub(crate) fn note(&self, sentence: &str) {
        if self.silent {
            return;
        }
        self.bar.suspend(|| say(sentence));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
