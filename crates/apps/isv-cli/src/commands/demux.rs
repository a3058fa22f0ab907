//! `isv demux`: the stream of an MP4 file, and the tracks beside it.

use crate::failure::usage;
use crate::output::{Output, check_stream_output, has_ending};
use crate::{stream, words};
use anyhow::{Context, Result, bail};
use isv::raw::mp4::write_tracks;
use isv::raw::take::Input;
use isv::raw::take::stream::{Tracks, demux, load_index, tracks_beside};
use std::path::PathBuf;

/// Take the stream out of an MP4 file, byte for byte
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The MP4 file
    #[arg(value_name = "IN.mp4")]
    input: PathBuf,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv", required_unless_present = "tracks")]
    output: Option<PathBuf>,
    /// Write sound and picture to this MP4 file
    #[arg(long, value_name = "OUT.mp4")]
    tracks: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let input = Input::from_argument(&args.input);
    for output in args.output.iter().chain(&args.tracks) {
        check_stream_output(&[&args.input], output)?;
    }
    if let Some(output) = args.output.as_deref().filter(|output| has_ending(output, "mp4")) {
        let output = output.display();
        return Err(usage(format!(
            "{output}: a stream has a name such as take.isv; --tracks makes MP4 files"
        )));
    }
    let tracks = args.tracks.as_ref().map(|_| tracks_beside(&input, None)).transpose()?;
    if tracks.as_ref().is_some_and(Tracks::is_empty) {
        bail!("{}: no sound and no picture beside the stream", input.name());
    }
    if let Some(path) = &args.output {
        let frames = load_index(&input)?.frames.len();
        let observer = words::observer();
        let output = demux(&input, &*observer, || Ok(Output::create(path)?)).map_err(stream::edit_error)?;
        stream::commit_file(output, path, frames)?;
    }
    if let Some((path, tracks)) = args.tracks.as_ref().zip(tracks) {
        let output = Output::create(path)?;
        write_tracks(output, tracks).with_context(|| path.display().to_string())?.commit()?;
    }
    Ok(())
}
