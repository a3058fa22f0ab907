//! `isv cut`: some frames of a stream, as they are.

use crate::output::check_stream_output;
use crate::stream::{self, StreamOutput};
use crate::{memory, words};
use anyhow::Result;
use isv::raw::take::stream::{cut, tracks_beside};
use isv::raw::take::{FrameRange, Input};
use std::path::PathBuf;

/// Copy frames of a stream into one of its own, from a keyframe on, without coding anything anew
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream: an .isv or MP4 file
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// Frames A to B-1, counted from 0; either end may be left out
    ///
    /// Frame A is a keyframe.
    #[arg(value_name = "A..B")]
    frames: FrameRange,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_stream_output(&[&args.input], &args.output)?;
    let input = Input::from_argument(&args.input);
    let tracks = stream::kept_tracks(tracks_beside(&input, Some(args.frames))?, &input.name(), &args.output);
    let create = || StreamOutput::create(&args.output, tracks);
    let copied = cut(&input, args.frames, memory::limit(), &*words::observer(), create);
    let (output, frames) = copied.map_err(stream::edit_error)?;
    stream::commit(output, &args.output, frames)
}
