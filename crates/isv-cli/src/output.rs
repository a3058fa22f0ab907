//! Where results go: a file that appears whole or not at all, or standard output.

use anyhow::Context;
use isv::io::{AtomicFile, WriteError};
use std::fmt::Display;
use std::io::{self, BufWriter, Stdout, Write};
use std::path::Path;

/// Whether a path stands for standard input or output.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path == Path::new("-")
}

/// A sink of bytes, to be [committed](Self::commit) once all are written. Its errors name it.
#[derive(Debug)]
pub(crate) struct Output {
    sink: Sink,
    bytes: u64,
}

#[derive(Debug)]
enum Sink {
    /// A file that takes its name when committed.
    File(AtomicFile),
    /// Standard output.
    Pipe(BufWriter<Stdout>),
}

impl Output {
    /// Opens a file, or standard output for `-`.
    pub(crate) fn create(path: &Path) -> Result<Self, WriteError> {
        let sink = if is_pipe(path) {
            Sink::Pipe(BufWriter::new(io::stdout()))
        } else {
            Sink::File(AtomicFile::create(path)?)
        };
        Ok(Self { sink, bytes: 0 })
    }

    /// Writes out what is buffered and gives a file its name; returns how many bytes were written in all.
    pub(crate) fn commit(mut self) -> anyhow::Result<u64> {
        self.flush()?;
        if let Sink::File(file) = self.sink {
            file.commit()?;
        }
        Ok(self.bytes)
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.sink {
            Sink::File(file) => file.write(bytes),
            Sink::Pipe(pipe) => named(pipe.write(bytes)),
        }?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::File(file) => file.flush(),
            Sink::Pipe(pipe) => named(pipe.flush()),
        }
    }
}

fn named<T>(result: io::Result<T>) -> io::Result<T> {
    result.map_err(|error| io::Error::new(error.kind(), format!("standard output: cannot write: {error}")))
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
