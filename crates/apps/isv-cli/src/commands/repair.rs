//! `isv repair`: what is sound of a damaged stream, as a stream.

use crate::memory;
use crate::output::{check_stream_output, frames_in_words, is_pipe, print, say};
use crate::stream::{self, StreamOutput};
use anyhow::Result;
use isv::raw::take::stream::{Repaired, damage_in_words, repair, tracks_beside};
use isv::raw::take::{Input, left_out_in_words};
use std::iter;
use std::path::{Path, PathBuf};

/// Make a stream of what is sound in a damaged, cut or unfinished one. Packets are kept byte for byte; frames that need a lost
/// one go with it
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The stream; - for standard input
    #[arg(value_name = "IN.isv")]
    input: PathBuf,
    /// The stream to write; - for standard output
    #[arg(short, long, value_name = "OUT.isv")]
    output: PathBuf,
    /// Take the header of this stream where that of IN.isv is damaged
    ///
    /// It is another stream of the take, or one that was encoded with the same settings.
    #[arg(long, value_name = "OTHER.isv")]
    header_from: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let inputs: Vec<&Path> = iter::once(&args.input).chain(&args.header_from).map(PathBuf::as_path).collect();
    check_stream_output(&inputs, &args.output)?;
    let input = Input::from_argument(&args.input);
    let other = args.header_from.as_deref().map(Input::from_argument);
    // Of an MP4 file that is damaged in its tables nothing else can be had either.
    let tracks = stream::kept_tracks(tracks_beside(&input, None)?, &input.name(), &args.output);
    let create = || StreamOutput::create(&args.output, tracks);
    let (output, report) =
        repair(&input, other.as_ref(), memory::limit(), create).map_err(stream::edit_error)?;
    stream::finish(output, &args.output)?.commit()?;
    let sentence = format!("{}: {}", input.name(), in_words(&report));
    if is_pipe(&args.output) {
        say(sentence);
        return Ok(());
    }
    print(&sentence)
}

/// What became of the stream.
fn in_words(report: &Repaired) -> String {
    let mut words = format!("{} kept", frames_in_words(report.kept));
    words += &damage_in_words(&report.damage);
    if report.orphaned > 0 {
        let need = if report.orphaned == 1 { "needs" } else { "need" };
        words += &format!(", {} left out that {need} a lost one", frames_in_words(report.orphaned));
    }
    if report.doubled > 0 {
        let are = if report.doubled == 1 { "is" } else { "are" };
        words += &format!(", {} left out that {are} there twice", frames_in_words(report.doubled));
    }
    if report.unknown > 0 {
        words += &format!(", {}", left_out_in_words(report.unknown));
    }
    if report.behind_loss > 0 {
        words += &format!(
            ", {} of them behind a loss without a keyframe: decode with --after-loss hold",
            frames_in_words(report.behind_loss)
        );
    }
    if !report.had_end {
        words += ", the end was missing and is new";
    }
    if let Some(at) = report.other_stream_at {
        words += &format!(", another stream begins at byte {at} and is left out");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(damage: Vec<(u64, u64)>, had_end: bool, orphaned: usize) -> String {
        let mut report = Repaired::default();
        (report.kept, report.damage, report.had_end, report.orphaned) = (7, damage, had_end, orphaned);
        in_words(&report)
    }

    #[test]
    fn reports_are_one_sentence() {
        assert_eq!(report(Vec::new(), true, 0), "7 frames kept");
        assert_eq!(
            report(vec![(100, 20)], true, 1),
            "7 frames kept, 20 bytes are damaged from byte 100 on, 1 frame left out that needs a lost one"
        );
        assert_eq!(
            report(vec![(100, 20), (300, 5)], false, 0),
            "7 frames kept, 25 bytes are damaged in 2 places from byte 100 on, the end was missing and is new"
        );
    }
}
