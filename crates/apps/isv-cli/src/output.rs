//! Messages on standard output and standard error, and the places where streams may be written.

use anyhow::Context;
use isv::raw::format::MAGIC;
use isv::raw::io::{OutputError, check_not_input, check_overwriting, check_stream_name};
use isv::raw::mp4::is_mp4;
use isv::raw::take::stream::Container;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use isv::raw::io::{Output, is_pipe, is_same_file};

/// A slip must not cost a capture: a stream is written over a stream and nothing else, and not over one of those that are read.
pub(crate) fn check_stream_output(inputs: &[&Path], output: &Path) -> Result<(), OutputError> {
    check_not_input(inputs, output)?;
    check_overwriting(output, "is no .isv stream and no MP4 file", |start| {
        if Container::of(output) == Container::Mp4 { is_mp4(start) } else { start.starts_with(&MAGIC) }
    })?;
    check_stream_name(output)
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
