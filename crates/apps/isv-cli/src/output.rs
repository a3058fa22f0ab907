//! Where results go: a file that appears whole or not at all, or standard output.

use crate::failure::usage;
use crate::output_name;
use anyhow::Context;
use isv::raw::format::MAGIC;
use isv::raw::io::{AtomicFile, WriteError, is_volume_folder, was_made_by_isv};
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufWriter, Read, Stdout, Write};
use std::path::{Path, PathBuf};

/// Bytes of a file that are looked at before it is overwritten.
const CHECKED_BYTES: u64 = 256;

/// What is wrong with files that isv may not write over.
const FOREIGN: &str = "was not made by isv";

/// Whether a path stands for standard input or output.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path == Path::new("-")
}

/// A slip must not cost a capture: a stream is written over a stream and nothing else, and not over one of those that are read.
pub(crate) fn check_stream_output(inputs: &[&Path], output: &Path) -> anyhow::Result<()> {
    if inputs.iter().any(|input| is_same_file(input, output)) && output.is_file() {
        return Err(usage(format!("{}: is what is read; name another file to write", output.display())));
    }
    check_output(output, "is no .isv stream", |start| start.starts_with(&MAGIC))?;
    output_name::check_stream(output)
}

/// What `decode` writes is written over what isv wrote, by the first bytes of files that can say so: a capture may have the same names.
pub(crate) fn check_frame_output(output: &Path) -> anyhow::Result<()> {
    check_output(output, FOREIGN, was_made_by_isv)
}

/// The same of a volume's folder, whose arrays cannot say it: `grid.json` beside them does.
pub(crate) fn check_volume_output(folder: &Path) -> anyhow::Result<()> {
    let description = folder.join("grid.json");
    if is_volume_folder(folder) && !description.exists() {
        return Err(not_overwritten(folder, FOREIGN));
    }
    check_frame_output(&description)
}

/// Refuses to overwrite a file that has something in it, unless its first bytes are as they are to be.
pub(crate) fn check_output(
    output: &Path,
    otherwise: &str,
    may_go: impl Fn(&[u8]) -> bool,
) -> anyhow::Result<()> {
    if is_pipe(output) || !output.is_file() {
        return Ok(());
    }
    let name = output.display();
    let mut start = Vec::new();
    let file = File::open(output).with_context(|| name.to_string())?;
    file.take(CHECKED_BYTES).read_to_end(&mut start).with_context(|| name.to_string())?;
    if start.is_empty() || may_go(&start) {
        return Ok(());
    }
    Err(not_overwritten(output, otherwise))
}

fn not_overwritten(output: &Path, why: &str) -> anyhow::Error {
    usage(format!("{}: is there and {why}, so it is not overwritten", output.display()))
}

/// Whether two paths lead to the same file, which need not be there yet.
pub(crate) fn is_same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        path.canonicalize().ok().or_else(|| Some(folder.canonicalize().ok()?.join(path.file_name()?)))
    };
    a == b || place(a).is_some_and(|a| place(b) == Some(a))
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

    /// Of a file, [`AtomicFile::keep`].
    pub(crate) fn keep(&mut self) -> Option<PathBuf> {
        match &mut self.sink {
            Sink::File(file) => file.keep(),
            Sink::Pipe(_) => None,
        }
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
