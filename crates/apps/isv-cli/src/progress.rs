//! The progress bar: on a terminal's stderr, nowhere else.

use crate::output::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::borrow::Cow;
use std::io::{IsTerminal, stderr};

/// Steps done out of a number that may be unknown. The bar goes when the value is dropped.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar for `total` steps, labelled with what is being done.
    pub(crate) fn new(total: Option<usize>, label: impl Into<Cow<'static, str>>) -> Self {
        let target =
            if stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(total.map(|n| n as u64), target).with_message(label);
        let progress = Self { bar };
        progress.show_share(total.is_some());
        progress
    }

    /// The number of steps becomes known.
    pub(crate) fn expect(&self, total: usize) {
        self.bar.set_length(total as u64);
        self.show_share(true);
    }

    fn show_share(&self, is_known: bool) {
        let template = match is_known {
            true => "{msg} {wide_bar} {pos}/{len} {eta}",
            false => "{msg} {pos} {elapsed}",
        };
        self.bar
            .set_style(ProgressStyle::with_template(template).expect("the templates above are well-formed"));
    }

    /// One step is done.
    pub(crate) fn step(&self) {
        self.bar.inc(1);
    }

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Says something on stderr, above the bar.
    pub(crate) fn note(&self, sentence: &str) {
        self.bar.suspend(|| say(sentence));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}
