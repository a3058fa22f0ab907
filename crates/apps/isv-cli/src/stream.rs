//! `.isv` streams as the command line opens them.

use crate::{memory, words};
use anyhow::anyhow;
use isv::raw::format::{PacketReader, StreamHeader, StreamIndex};
use isv::raw::take::stream::{self, ByteSource};
use isv::raw::take::{Input, StreamError};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// The name of an input in messages.
pub(crate) fn name(path: &Path) -> String {
    Input::from_argument(path).name()
}

/// Opens a file.
pub(crate) fn open_file(path: &Path) -> Result<BufReader<File>, StreamError> {
    stream::open_file(&Input::from_argument(path))
}

/// Opens the bytes of a stream, `-` being standard input.
pub(crate) fn source(path: &Path) -> Result<ByteSource, StreamError> {
    stream::source(&Input::from_argument(path))
}

/// Opens a stream, `-` being standard input, and reads its header.
pub(crate) fn open(path: &Path) -> Result<(PacketReader<ByteSource>, StreamHeader), StreamError> {
    stream::open(&Input::from_argument(path), memory::limit())
}

/// Finds the frames of a stream in a file; what follows a cut is not there.
pub(crate) fn load_index(path: &Path) -> Result<StreamIndex, StreamError> {
    stream::load_index(&Input::from_argument(path))
}

/// Says that a stream that was read to its end ends without one.
pub(crate) fn say_if_cut(name: &str, packets: &PacketReader<impl Read>) {
    stream::tell_if_cut(name, packets, &*words::observer());
}

/// The error of a stream behind an error, if there is one.
pub(crate) fn fault(error: &anyhow::Error) -> Option<&StreamError> {
    error.chain().find_map(|cause| cause.downcast_ref())
}

/// An error, with what helps against it where bytes were damaged or lost. A repaired stream can still miss frames, where others make whole again
/// what followed them.
pub(crate) fn advise_repair(error: anyhow::Error) -> anyhow::Error {
    let advice = match fault(&error) {
        Some(fault) if fault.is_missing_frame() => "isv decode --after-loss hold goes on behind it",
        Some(fault) if fault.is_loss() => "isv repair keeps what is sound",
        _ => return error,
    };
    anyhow!("{}: {advice}", words::error(&error).0)
}
