//! `isv join`: streams one after the other, as one.

use crate::output::{check_stream_output, say};
use crate::stream::{self, StreamOutput};
use crate::{memory, words};
use anyhow::Result;
use isv::raw::take::Input;
use isv::raw::take::stream::{JoinedTimes, Tracks, join, tracks_beside_all};
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
    /// Keep the times of all packets, as `isv encode --time-origin` has them
    ///
    /// Without it, each stream follows the one before at the frame rate.
    #[arg(long)]
    keep_times: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_stream_output(&args.inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &args.output)?;
    let inputs: Vec<Input> = args.inputs.iter().map(|input| Input::from_argument(input)).collect();
    let times = if args.keep_times { JoinedTimes::Keep } else { JoinedTimes::Follow };
    let tracks = tracks_beside_all(&inputs, times)?.unwrap_or_else(|| {
        say(format_args!(
            "{}: sound and picture are not kept, as the files differ in them",
            args.output.display()
        ));
        Tracks::new()
    });
    let tracks = stream::kept_tracks(tracks, &inputs[0].name(), &args.output);
    let create = || StreamOutput::create(&args.output, tracks);
    let joined = join(&inputs, times, memory::limit(), &*words::observer(), create);
    let (output, frames) = joined.map_err(stream::edit_error)?;
    stream::commit(output, &args.output, frames)
}
