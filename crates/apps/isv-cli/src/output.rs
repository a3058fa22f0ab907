//! Messages on standard output and standard error, and the places where streams may be written.

use anyhow::Context;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use isv::raw::io::{Output, is_pipe, is_same_file};
pub(crate) use isv::raw::take::stream::check_output as check_stream_output;

/// Whether a path ends so, in any case. `ending`: without the dot.
pub(crate) fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

/// A path as a shell takes it.
pub(crate) fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    match text.chars().all(|c| c.is_alphanumeric() || "/._-+=:@%,~\\".contains(c)) {
        true => text,
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

/// Prints text for people or scripts on standard output.
pub(crate) fn print(text: &str) -> anyhow::Result<()> {
    writeln!(io::stdout(), "{text}").context("standard output: cannot write")
}

/// Says something to people, on standard error. No work is given up because nobody can hear it.
pub(crate) fn say(sentence: impl Display) {
    let _ = writeln!(io::stderr(), "{sentence}");
}

/// A number of frames in words.
pub(crate) fn frames_in_words(count: usize) -> String {
    format!("{count} {}", if count == 1 { "frame" } else { "frames" })
}
