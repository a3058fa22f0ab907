//! `isv repair`: what is sound of a damaged stream, as a stream.

use crate::output::{Output, frames_in_words, is_pipe, print};
use crate::stream;
use anyhow::{Context, Result, bail};
use isv::format::{Packet, PacketWriter, Profile, SalvageReader, Salvaged};
use std::path::PathBuf;

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
}

/// What became of the stream.
#[derive(Debug, Default)]
struct Report {
    kept: usize,
    /// Sound frames that cannot be decoded without a lost one.
    orphaned: usize,
    /// Kept frames that are decoded from a volume that is not exact.
    inexact: usize,
    /// Where damage begins, and how many bytes it has.
    damage: Vec<(u64, u64)>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let name = stream::name(&args.input);
    let mut packets = SalvageReader::new(stream::source(&args.input)?).with_context(|| name.clone())?;
    let profile = packets.header().profile;
    // Nothing is written before there is something to write.
    let mut writer = None;
    let (mut chain, mut report) = (Chain::default(), Report::default());
    while let Some(found) = packets.next_frame().with_context(|| name.clone())? {
        let packet = match found {
            Salvaged::Damage { at, bytes } => {
                report.damage.push((at, bytes));
                continue;
            }
            Salvaged::Frame(packet) => packet,
        };
        match chain.next(&packet, &profile) {
            Use::Orphaned => report.orphaned += 1,
            usage => {
                let writer = match &mut writer {
                    Some(writer) => writer,
                    none => none.insert(PacketWriter::new(Output::create(&args.output)?, packets.header())?),
                };
                writer.copy_frame(&packet, packet.header.timestamp_ns)?;
                report.kept += 1;
                report.inexact += usize::from(usage == Use::Inexact);
            }
        }
    }
    let Some(writer) = writer else {
        bail!("{name}: no frame in it can be decoded{}", report.damage_in_words());
    };
    writer.finish()?.commit()?;
    let sentence = format!("{name}: {}", report.in_words(packets.complete()));
    if is_pipe(&args.output) {
        eprintln!("{sentence}");
        return Ok(());
    }
    print(&sentence)
}

/// What a decoder can make of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    /// A frame like the encoder's.
    Exact,
    /// One that is like it in parts: a resilient frame after a loss.
    Inexact,
    /// Nothing.
    Orphaned,
}

/// Which frame can come next.
#[derive(Debug, Default)]
struct Chain {
    /// Frames since the keyframe of the last frame that was kept, and whether it is exact.
    last: Option<(u16, bool)>,
}

impl Chain {
    fn next(&mut self, packet: &Packet, profile: &Profile) -> Use {
        let since = packet.header.since_keyframe;
        let follows = self.last.is_some_and(|(last, _)| last.wrapping_add(1) == since);
        let exact = packet.is_keyframe() || (follows && self.last.is_some_and(|(_, exact)| exact));
        let can_use = exact || (self.last.is_some() && packet.is_entry(profile));
        if !can_use {
            return Use::Orphaned;
        }
        self.last = Some((since, exact));
        if exact { Use::Exact } else { Use::Inexact }
    }
}

impl Report {
    fn damage_in_words(&self) -> String {
        let bytes: u64 = self.damage.iter().map(|(_, bytes)| bytes).sum();
        match self.damage[..] {
            [] => String::new(),
            [(at, _)] => format!(", {bytes} bytes are damaged from byte {at} on"),
            [(at, _), ..] => {
                format!(", {bytes} bytes are damaged in {} places from byte {at} on", self.damage.len())
            }
        }
    }

    fn in_words(&self, complete: bool) -> String {
        let mut words = format!("{} kept", frames_in_words(self.kept));
        words += &self.damage_in_words();
        if self.orphaned > 0 {
            let need = if self.orphaned == 1 { "needs" } else { "need" };
            words += &format!(", {} left out that {need} a lost one", frames_in_words(self.orphaned));
        }
        if self.inexact > 0 {
            words += &format!(
                ", {} behind a loss that decode nearly until all is refreshed: decode with --after-loss hold",
                frames_in_words(self.inexact)
            );
        }
        if !complete {
            words += ", the end was missing and is new";
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(damage: Vec<(u64, u64)>) -> Report {
        Report { kept: 7, orphaned: 0, inexact: 0, damage }
    }

    #[test]
    fn reports_are_one_sentence() {
        assert_eq!(report(Vec::new()).in_words(true), "7 frames kept");
        assert_eq!(
            Report { orphaned: 1, ..report(vec![(100, 20)]) }.in_words(true),
            "7 frames kept, 20 bytes are damaged from byte 100 on, 1 frame left out that needs a lost one"
        );
        assert_eq!(
            report(vec![(100, 20), (300, 5)]).in_words(false),
            "7 frames kept, 25 bytes are damaged in 2 places from byte 100 on, the end was missing and is new"
        );
    }
}
