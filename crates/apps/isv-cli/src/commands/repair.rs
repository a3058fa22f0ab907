//! `isv repair`: what is sound of a damaged stream, as a stream.

use crate::output::{Output, check_stream_output, frames_in_words, is_pipe, print, say};
use crate::{memory, stream};
use anyhow::{Context, Result, anyhow, bail};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::format::{Packet, PacketWriter, RefusalClass, SalvageReader, Salvaged, StreamHeader};
use isv::raw::take::stream::ByteSource;
use isv::raw::take::stream::is_doubled;
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

impl Args {
    fn packets(&self) -> Result<SalvageReader<ByteSource>> {
        let source = stream::source(&self.input)?;
        if let Some(other) = &self.header_from {
            let (_, header) = stream::open(other)?;
            return Ok(SalvageReader::with_header(source, header));
        }
        let packets = SalvageReader::new(source).map_err(|error| match error.class() {
            // Nothing is behind a header that is cut.
            None | Some(RefusalClass::Cut) => anyhow!(error),
            Some(_) => anyhow!("{error}: if a damaged header is all that is wrong, --header-from takes that of another stream"),
        });
        packets.with_context(|| stream::name(&self.input))
    }
}

/// What became of the stream.
#[derive(Debug, Default)]
struct Report {
    kept: usize,
    /// Sound frames that cannot be decoded without a lost one.
    orphaned: usize,
    /// Kept frames between a loss and the next keyframe.
    behind_loss: usize,
    /// Packets that were there twice in a row.
    doubled: usize,
    /// Where damage begins, and how many bytes it has.
    damage: Vec<(u64, u64)>,
    /// Where the header of another stream is, at which this one ends.
    other_stream_at: Option<u64>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let name = stream::name(&args.input);
    let inputs: Vec<&Path> = iter::once(&args.input).chain(&args.header_from).map(PathBuf::as_path).collect();
    check_stream_output(&inputs, &args.output)?;
    let mut packets = args.packets()?;
    // Nothing is written before there is something to write.
    let mut writer = None;
    let (mut chain, mut report) =
        (Chain::new(packets.header(), memory::limit().decoder_limits()), Report::default());
    let (mut damaged, mut last) = (0, None);
    while let Some(found) = packets.next_frame().with_context(|| name.clone())? {
        let packet = match found {
            Salvaged::Damage { at, bytes } => {
                report.damage.push((at, bytes));
                damaged += bytes;
                continue;
            }
            Salvaged::OtherStream { at: 0 } => {
                bail!("{name}: its own header is sound, and not that of --header-from")
            }
            Salvaged::OtherStream { at } => {
                report.other_stream_at = Some(at);
                continue;
            }
            Salvaged::Frame(packet) => packet,
        };
        if last.replace(packet.header).is_some_and(|last| is_doubled(&packet, &last)) {
            report.doubled += 1;
            continue;
        }
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
struct Chain {
    state: ChainState,
    /// Decodes resilient frames behind a loss, as that alone tells when all is exact again. Elsewhere packets are passed over.
    decoder: Decoder,
}

#[derive(Clone, Copy, Debug)]
enum ChainState {
    /// All is exact.
    Whole {
        /// Frames between the last keyframe and the last frame.
        since_keyframe: u16,
        /// What the next frame is.
        usage: Use,
    },
    /// Something is missing.
    Lost,
}

impl Chain {
    fn new(header: &StreamHeader, limits: Limits) -> Self {
        let mut decoder = Decoder::new(header, limits);
        decoder.recover(true);
        Self { state: ChainState::Lost, decoder }
    }

    /// What the next packet is, before which so many bytes are damaged.
    fn next(&mut self, packet: &Packet, damaged: u64) -> Use {
        let found = packet.header.since_keyframe;
        let lost = damaged > 0 && packet.may_lack_keyframe(damaged);
        self.state = match self.state {
            _ if packet.is_keyframe() => ChainState::Whole { since_keyframe: 0, usage: Use::Whole },
            ChainState::Whole { since_keyframe, usage }
                if !lost && since_keyframe.wrapping_add(1) == found =>
            {
                ChainState::Whole { since_keyframe: found, usage }
            }
            _ => ChainState::Lost,
        };
        if let ChainState::Whole { usage, .. } = self.state {
            self.decoder.pass_over(packet);
            return usage;
        }
        if lost {
            self.decoder.lose_packet();
        }
        match self.decoder.decode(packet) {
            Ok(frame) => {
                if frame.inexact_blocks == 0 {
                    self.state = ChainState::Whole { since_keyframe: found, usage: Use::BehindLoss };
                }
                Use::BehindLoss
            }
            // It needs no lost one, and its bytes count towards what is allowed to those behind it.
            Err(error) if error.class() == Some(RefusalClass::Limit) => Use::BehindLoss,
            Err(_) => Use::Orphaned,
        }
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
        if self.doubled > 0 {
            let are = if self.doubled == 1 { "is" } else { "are" };
            words += &format!(", {} left out that {are} there twice", frames_in_words(self.doubled));
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
        if let Some(at) = self.other_stream_at {
            words += &format!(", another stream begins at byte {at} and is left out");
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv::raw::encode::{Encoder, EncoderSettings, MainSettings, Refresh};
    use isv::raw::format::{FrameRate, PacketReader, Profile};
    use isv::raw::volume::{BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};

    /// A floor, whose keyframe has most of the bytes; what decoders allow a frame depends on those.
    #[test]
    fn bytes_before_a_loss_count_and_what_has_too_few_is_kept() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.01).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(8).unwrap(),
        };
        let header = StreamHeader {
            profile: Profile::Main,
            grid,
            frame_rate: FrameRate { numerator: 30, denominator: 1 },
        };
        let mut floor = VolumeBuilder::new(grid);
        for place in 0..64 * 64 {
            let samples = (0..512).map(|voxel| 256 * (voxel / 64) - 1000).collect();
            floor.push([place % 64, place / 64, 0].into(), samples, None);
        }
        let floor = floor.finish();
        let main = MainSettings { refresh: Refresh::Gradual, ..Default::default() };
        let mut encoder = Encoder::new(&header, EncoderSettings { gop: 5, main, ..Default::default() });
        let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
        for frame in 0..8 {
            let coded = encoder.encode(&floor);
            writer.write_frame(coded.keyframe, frame, &coded.payload()).unwrap();
        }
        let bytes = writer.finish().unwrap();
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let packets: Vec<Packet> = std::iter::from_fn(|| reader.next_frame().unwrap()).collect();
        let size = |frame: usize| packets[frame].total_bytes();
        // With the blocks around the floor: as many as the bytes of two frames allow, and those of frame 3 alone do not.
        let needed = 66 * 66 * 3 * 512 - Limits::FREE_VOXELS;
        assert!(size(3) < size(1) + size(2) && size(1) + size(2) < size(0) + size(1) + size(3));
        let voxels_per_byte = needed.div_ceil(size(1) + size(2));
        let limits = Limits { voxels_per_byte, ..Limits::default() };
        let usages = |lost: usize| {
            let mut chain = Chain::new(&header, limits);
            let left = packets.iter().enumerate().filter(|(frame, _)| *frame != lost);
            left.map(|(_, packet)| chain.next(packet, 0)).collect::<Vec<_>>()
        };
        let behind_loss = [Use::BehindLoss; 7];
        assert_eq!(usages(0), behind_loss);
        assert_eq!(usages(2), [&[Use::Whole; 2], &behind_loss[..5]].concat());
        // The decoder of frame 3 has the bytes of all before it.
        let mut chain = Chain::new(&header, limits);
        for packet in &packets[..2] {
            chain.next(packet, 0);
        }
        assert!(chain.decoder.decode(&packets[3]).is_ok());
    }

    fn report(damage: Vec<(u64, u64)>) -> Report {
        Report { kept: 7, damage, ..Report::default() }
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
