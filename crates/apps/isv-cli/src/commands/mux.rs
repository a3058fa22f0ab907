//! `isv mux`: a stream in an MP4 file, with sound and picture beside it.

use crate::failure::usage;
use crate::output::{Output, check_stream_output, has_ending};
use crate::stream::{self, StreamOutput};
use crate::tracks::TrackArgs;
use crate::{memory, words};
use anyhow::Result;
use isv::raw::take::Input;
use isv::raw::take::stream::{Container, mux, tracks_beside};
use std::path::PathBuf;
use std::{io, iter};

/// Put a stream into an MP4 file, with sound and picture beside it. Nothing is coded anew but WAV sound
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream, an .isv or MP4 file; - for standard input
    ///
    /// Tracks that an MP4 file has beside its stream are kept.
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// The file to write; - for standard output
    #[arg(short, long, value_name = "OUT.mp4")]
    output: PathBuf,
    #[command(flatten)]
    tracks: TrackArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let inputs: Vec<_> = iter::once(args.input.as_path()).chain(args.tracks.files()).collect();
    check_stream_output(&inputs, &args.output)?;
    if has_ending(&args.output, "isv") {
        let output = args.output.display();
        return Err(usage(format!("{output}: this makes an MP4 file: use a name such as take.mp4")));
    }
    let input = Input::from_argument(&args.input);
    let mut tracks = tracks_beside(&input, None)?;
    tracks.extend(args.tracks.open(None)?);
    let observer = words::observer();
    // An MP4 file, whatever its name: that is what the command is for.
    let create = || {
        let file = Output::create(&args.output)?;
        StreamOutput::new(file, Container::Mp4, tracks).map_err(io::Error::other)
    };
    let muxed = mux(&input, memory::limit(), &*observer, create);
    let (output, frames) = muxed.map_err(stream::edit_error)?;
    stream::commit_file(output, &args.output, frames)
}
