//! Streams as the command line reads and writes them.

use crate::output::{Output, frames_in_words, is_pipe, print, say};
use crate::{memory, words};
use anyhow::{Result, anyhow};
use isv::raw::take::decode::DecodeTakeError;
use isv::raw::take::stream::{self, Container, EditError, Tracks};
use isv::raw::take::{Input, StreamError};
use std::path::Path;

/// The name of an input in messages.
pub(crate) fn name(path: &Path) -> String {
    Input::from_argument(path).name()
}

/// Refuses what is no stream.
pub(crate) fn check(path: &Path) -> Result<(), StreamError> {
    stream::open(&Input::from_argument(path), memory::limit()).map(drop)
}

/// A sink for a stream, in a file that has its name once it is whole.
pub(crate) type StreamOutput = stream::StreamOutput<Output>;

/// Tracks to keep of a stream that is copied into a file: those beside it. If the file can have none, that is
/// said.
pub(crate) fn kept_tracks(tracks: Tracks, input: &str, output: &Path) -> Tracks {
    if Container::of(output) == Container::Isv && !tracks.is_empty() {
        say(format_args!("{input}: sound and picture are not kept: an MP4 file would have them"));
        return Tracks::new();
    }
    tracks
}

/// Gives a copied stream its name, and says what is in it.
pub(crate) fn commit(output: StreamOutput, path: &Path, frames: usize) -> Result<()> {
    commit_file(finish(output, path)?, path, frames)
}

/// Completes the file of a stream, and says which tracks beside it are longer or shorter.
pub(crate) fn finish(output: StreamOutput, path: &Path) -> Result<Output> {
    let finished = output.finish_with_ends();
    let (output, ends) = finished.map_err(|error| edit_error(stream::write_error(error)))?;
    let name = if is_pipe(path) { "standard output".to_owned() } else { path.display().to_string() };
    stream::tell_of_ends(&name, &ends, &*words::observer());
    Ok(output)
}

/// Gives a file its name, and says what is in it.
pub(crate) fn commit_file(output: Output, path: &Path, frames: usize) -> Result<()> {
    let bytes = output.commit()?;
    if is_pipe(path) {
        return Ok(());
    }
    print(&format!("{}: {}, {bytes} bytes", path.display(), frames_in_words(frames)))
}

/// The error behind that of a copy.
pub(crate) fn edit_error(error: EditError) -> anyhow::Error {
    match error {
        EditError::Stream(error) => error.into(),
        EditError::Write(error) => error.into(),
        EditError::Create(error) => error.into(),
        other => other.into(),
    }
}

/// The error of a stream behind an error, if there is one.
pub(crate) fn fault(error: &anyhow::Error) -> Option<&StreamError> {
    error.chain().find_map(|cause| match cause.downcast_ref() {
        Some(DecodeTakeError::Stream(error)) => Some(error),
        _ => cause.downcast_ref(),
    })
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
