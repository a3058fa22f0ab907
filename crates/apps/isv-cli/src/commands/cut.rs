//! `isv cut`: some frames of a stream, as they are.

use crate::output::{Output, check_stream_output, frames_in_words, is_pipe, print, say};
use crate::stream;
use anyhow::{Context, Result, bail};
use isv::raw::format::{PacketReader, PacketWriter, StreamIndex};
use isv::raw::take::stream::Continuity;
use isv::raw::take::{FrameRange, StreamFault};
use std::io::{Seek, SeekFrom};
use std::path::PathBuf;

/// Copy frames of a stream into one of its own, from a keyframe on, without coding anything anew
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream: a file
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
    let name = stream::name(&args.input);
    check_stream_output(&[&args.input], &args.output)?;
    let index = stream::load_index(&args.input)?;
    let range =
        args.frames.within(index.frames.len()).map_err(|error| StreamFault::from(error).in_stream(&name))?;
    if !index.frames[range.start].keyframe {
        bail!("{name}: frame {} is no keyframe: {}", range.start, advice(&index, range.start));
    }
    let (_, header) = stream::open(&args.input)?;
    let at = index.frames[range.start].at;
    let mut file = stream::open_file(&args.input)?;
    file.seek(SeekFrom::Start(at)).with_context(|| name.clone())?;
    let mut packets = PacketReader::at_packet(file, at);
    let mut writer = None;
    let (mut first_ns, mut continuity) = (0, Continuity::default());
    for frame in range.clone() {
        let Some(packet) = packets.next_frame().map_err(|error| StreamFault::from(error).in_stream(&name))?
        else {
            bail!("{name}: ends before frame {frame}");
        };
        if frame == range.start && !packet.is_keyframe() {
            bail!(
                "{name}: its index calls frame {frame} a keyframe, but it is none: isv repair makes an index that is right"
            );
        }
        if let Some(why) = continuity.check(&packet) {
            say(format_args!("{name}: {why} before frame {frame}"));
        }
        let time_ns = packet.header.timestamp_ns;
        let writer = match &mut writer {
            Some(writer) => writer,
            none => {
                first_ns = time_ns;
                none.insert(PacketWriter::new(Output::create(&args.output)?, &header)?)
            }
        };
        // The copy begins at time 0.
        writer.copy_frame(&packet, time_ns.saturating_sub(first_ns))?;
    }
    let writer = writer.expect("a range holds a frame");
    // Behind the last frame that was found there may be more, of which nothing can be copied.
    if range.end == index.frames.len() {
        match packets.next_frame() {
            Ok(_) => stream::say_if_cut(&name, &packets),
            Err(error) => say(format_args!("{name}: {error}: what is before that was copied")),
        }
    }
    let bytes = writer.finish()?.commit()?;
    if !is_pipe(&args.output) {
        print(&format!("{}: {}, {bytes} bytes", args.output.display(), frames_in_words(range.len())))?;
    }
    Ok(())
}

/// Where to cut in place of a frame that is no keyframe.
fn advice(index: &StreamIndex, frame: usize) -> String {
    let before = index.keyframe_before(frame);
    let after = (frame..index.frames.len()).find(|frame| index.frames[*frame].keyframe);
    let places = match (before, after) {
        (Some(before), Some(after)) => format!("cut from {before} or {after} on"),
        (Some(before), None) => format!("cut from {before} on"),
        (None, Some(after)) => format!("cut from {after} on"),
        (None, None) => "there is none".to_owned(),
    };
    format!("{places}, or code the frames anew with isv encode --frames")
}
