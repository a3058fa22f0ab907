//! `isv join`: streams one after the other, as one.

use crate::failure::usage;
use crate::output::{Output, check_stream_output, frames_in_words, is_pipe, print, say};
use crate::stream;
use anyhow::{Result, bail};
use isv::raw::format::{PacketWriter, StreamHeader};
use isv::raw::take::StreamFault;
use isv::raw::take::stream::Continuity;
use isv::raw::take::timeline::frame_at;
use std::fs;
use std::path::PathBuf;

/// Put streams one after the other, without coding anything anew. They have the same profile, grid and frame rate
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The streams, in order
    #[arg(value_name = "IN.isv", required = true)]
    inputs: Vec<PathBuf>,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    check_stream_output(&args.inputs.iter().map(PathBuf::as_path).collect::<Vec<_>>(), &args.output)?;
    // Each is opened twice, so that nothing is written if two do not go together.
    let is_file = |input: &PathBuf| fs::metadata(input).map_or(!is_pipe(input), |found| found.is_file());
    if let Some(pipe) = args.inputs.iter().find(|input| !is_file(input)) {
        return Err(usage(format!("{}: streams are joined from files", pipe.display())));
    }
    let headers = args.inputs.iter().map(|input| Ok(stream::open(input)?.1)).collect::<Result<Vec<_>>>()?;
    let header = headers[0];
    for (other, input) in headers.iter().zip(&args.inputs) {
        if let Some(what) = difference(&header, other) {
            let [first, other] = [&args.inputs[0], input].map(|path| stream::name(path));
            bail!("{other}: has another {what} than {first}: code one of them anew with isv encode");
        }
    }
    let mut writer = PacketWriter::new(Output::create(&args.output)?, &header)?;
    let (mut frames, mut next_ns) = (0, 0);
    for input in &args.inputs {
        let name = stream::name(input);
        let (mut packets, now) = stream::open(input)?;
        if difference(&header, &now).is_some() {
            bail!("{name}: has changed while streams were joined");
        }
        let (mut first_ns, begin_ns, mut continuity) = (None, next_ns, Continuity::default());
        while let Some(packet) =
            packets.next_frame().map_err(|error| StreamFault::from(error).in_stream(&name))?
        {
            if first_ns.is_none() && !packet.is_keyframe() {
                bail!("{name}: does not begin with a keyframe: isv repair makes a stream that does");
            }
            if let Some(why) = continuity.check(&packet) {
                say(format_args!("{name}: {why} at byte {}", packet.at));
            }
            let first_ns = *first_ns.get_or_insert(packet.header.timestamp_ns);
            let time_ns = packet.header.timestamp_ns.saturating_sub(first_ns).saturating_add(begin_ns);
            let frame = frame_at(header.frame_rate, time_ns);
            writer
                .copy_frame(&packet, frame.map_or(time_ns, |frame| header.frame_rate.timestamp_ns(frame)))?;
            next_ns = match frame {
                Some(frame) => header.frame_rate.timestamp_ns(frame + 1),
                None => time_ns.saturating_add(header.frame_rate.timestamp_ns(1)),
            };
            frames += 1;
        }
        stream::say_if_cut(&name, &packets);
    }
    let bytes = writer.finish()?.commit()?;
    if !is_pipe(&args.output) {
        print(&format!("{}: {}, {bytes} bytes", args.output.display(), frames_in_words(frames)))?;
    }
    Ok(())
}

/// What keeps packets of two streams from being in one.
fn difference(a: &StreamHeader, b: &StreamHeader) -> Option<&'static str> {
    [
        (a.profile.name() != b.profile.name(), "profile"),
        (a.profile != b.profile, "quantizer"),
        (a.grid.voxel_size != b.grid.voxel_size, "voxel size"),
        (a.grid != b.grid, "grid"),
        (a.frame_rate != b.frame_rate, "frame rate"),
    ]
    .into_iter()
    .find_map(|(differs, what)| differs.then_some(what))
}
