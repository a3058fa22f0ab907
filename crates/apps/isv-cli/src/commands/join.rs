//! `isv join`: streams one after the other, as one.

use crate::output::{check_stream_output, say};
use crate::{memory, stream, words};
use anyhow::Result;
use isv::raw::take::Input;
use isv::raw::take::stream::{Tracks, join, tracks_beside_all};
use std::path::PathBuf;

/// Put streams one after the other, without coding anything anew. They have the same profile, grid and frame rate
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The streams, .isv or MP4 files, in order
    #[arg(value_name = "IN.isv", required = true)]
    inputs: Vec<PathBuf>,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_stream_output(&args.inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &args.output)?;
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::from_argument(input)).collect();
    let tracks = tracks_beside_all(&inputs)?.unwrap_or_else(|| {
        say(format_args!(
            "{}: sound and picture are not kept, as the files differ in them",
            args.output.display()
        ));
        Tracks::new()
    });
    let tracks = stream::kept_tracks(tracks, &inputs[0].name(), &args.output);
    let create = || stream::create(&args.output, tracks);
    let joined = join(&inputs, memory::limit(), &*words::observer(), create);
    let (output, frames) = joined.map_err(stream::edit_error)?;
    stream::commit(output, &args.output, frames)
}
