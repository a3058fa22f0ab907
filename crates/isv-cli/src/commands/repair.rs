//! `isv repair`: what is sound of a damaged stream, as a stream.

use crate::output::{Output, frames_in_words, is_pipe, print, say};
use crate::{memory, stream};
use anyhow::{Context, Result, bail};
use isv::decode::Decoder;
use isv::format::{Packet, PacketWriter, SalvageReader, Salvaged, StreamHeader};
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
    /// Kept frames between a loss and the next keyframe.
    behind_loss: usize,
    /// Where damage begins, and how many bytes it has.
    damage: Vec<(u64, u64)>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let name = stream::name(&args.input);
    let mut packets = SalvageReader::new(stream::source(&args.input)?).with_context(|| name.clone())?;
    // Nothing is written before there is something to write.
    let mut writer = None;
    let (mut chain, mut report) = (Chain::new(*packets.header()), Report::default());
    let mut damaged = 0;
    while let Some(found) = packets.next_frame().with_context(|| name.clone())? {
        let packet = match found {
            Salvaged::Damage { at, bytes } => {
                report.damage.push((at, bytes));
                damaged += bytes;
                continue;
            }
            Salvaged::Frame(packet) => packet,
        };
        match chain.next(&packet, std::mem::take(&mut damaged)) {
            Use::Orphaned => report.orphaned += 1,
            usage => {
                let writer = match &mut writer {
                    Some(writer) => writer,
                    none => none.insert(PacketWriter::new(Output::create(&args.output)?, packets.header())?),
                };
                writer.copy_frame(&packet, packet.header.timestamp_ns)?;
                report.kept += 1;
                report.behind_loss += usize::from(usage == Use::BehindLoss);
            }
        }
    }
    let Some(writer) = writer else {
        bail!("{name}: no frame in it can be decoded{}", report.damage_in_words());
    };
    writer.finish()?.commit()?;
    let sentence = format!("{name}: {}", report.in_words(packets.complete()));
    if is_pipe(&args.output) {
        say(sentence);
        return Ok(());
    }
    print(&sentence)
}

/// What a decoder can make of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    /// A frame.
    Whole,
    /// A frame, if it goes on at resilient frames: this is one behind a loss, or it needs one.
    BehindLoss,
    /// Nothing.
    Orphaned,
}

/// What can be made of one packet after the other.
#[derive(Debug)]
struct Chain {
    header: StreamHeader,
    state: ChainState,
}

#[derive(Debug)]
enum ChainState {
    /// All is exact.
    Whole {
        /// Frames between the last keyframe and the last frame.
        since_keyframe: u16,
        /// What the next frame is.
        usage: Use,
    },
    /// Something is missing. Resilient frames are decoded, as that alone tells when all is exact again.
    Lost(Box<Decoder>),
}

impl Chain {
    fn new(header: StreamHeader) -> Self {
        Self { header, state: ChainState::lost(&header) }
    }

    /// What the next packet is, before which so many bytes are damaged.
    fn next(&mut self, packet: &Packet, damaged: u64) -> Use {
        let found = packet.header.since_keyframe;
        let lost = damaged > 0 && packet.may_lack_keyframe(damaged);
        match &mut self.state {
            _ if packet.is_keyframe() => {
                self.state = ChainState::Whole { since_keyframe: 0, usage: Use::Whole }
            }
            ChainState::Whole { since_keyframe, .. } if !lost && since_keyframe.wrapping_add(1) == found => {
                *since_keyframe = found;
            }
            ChainState::Whole { .. } => self.state = ChainState::lost(&self.header),
            ChainState::Lost(decoder) if lost => decoder.lose_packet(),
            ChainState::Lost(_) => {}
        }
        let decoder = match &mut self.state {
            ChainState::Whole { usage, .. } => return *usage,
            ChainState::Lost(decoder) => decoder,
        };
        let Ok(frame) = decoder.decode(packet) else { return Use::Orphaned };
        if frame.inexact_blocks == 0 {
            self.state = ChainState::Whole { since_keyframe: found, usage: Use::BehindLoss };
        }
        Use::BehindLoss
    }
}

impl ChainState {
    fn lost(header: &StreamHeader) -> Self {
        let mut decoder = Decoder::new(header, memory::limits());
        decoder.recover(true);
        Self::Lost(Box::new(decoder))
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
        if self.behind_loss > 0 {
            words += &format!(
                ", {} of them behind a loss without a keyframe: decode with --after-loss hold",
                frames_in_words(self.behind_loss)
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
        Report { kept: 7, orphaned: 0, behind_loss: 0, damage }
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
