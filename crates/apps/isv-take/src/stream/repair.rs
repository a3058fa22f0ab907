//! A sound stream out of a damaged one.

use super::{EditError, StreamFault, open, source};
use crate::{Input, MemoryLimit};
use isv_decode::{Decoder, Limits};
use isv_format::{
    Link, Packet, PacketChain, PacketWriter, RefusalClass, SalvageReader, Salvaged, StreamHeader,
};
use std::io::{self, Write};

/// Result of the repair of a stream.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Repaired {
    /// Frames kept.
    pub kept: usize,
    /// Sound frames left out, as they cannot be decoded without a lost one.
    pub orphaned: usize,
    /// Kept frames between a loss and the next keyframe: decoders that recover from losses show them.
    pub behind_loss: usize,
    /// Packets left out, as they were there twice in a row.
    pub doubled: usize,
    /// Packets left out, as this build does not know their types.
    pub unknown: usize,
    /// Places that are damaged: the first byte and the number of bytes of each.
    pub damage: Vec<(u64, u64)>,
    /// Place (bytes) of the header of another stream, at which this one ends.
    pub other_stream_at: Option<u64>,
    /// Whether index and trailer were there and sound.
    pub had_end: bool,
}

/// Copies what is sound of a damaged, cut or unfinished stream, byte for byte. Frames that need a lost one go
/// with it, and so do packets of unknown types. `header_from`: a stream of the same take whose header stands
/// for the damaged one of this. `create` is called once there is a frame to write.
///
/// # Errors
/// [`EditError`]: a header that is damaged, a stream of which no frame can be decoded, and what reading and writing may fail by.
pub fn repair<W: Write>(
    input: &Input,
    header_from: Option<&Input>,
    memory: MemoryLimit,
    create: impl FnOnce() -> io::Result<W>,
) -> Result<(W, Repaired), EditError> {
    let name = input.name();
    let fault = |fault: StreamFault| fault.in_stream(&name);
    let mut packets = match header_from {
        Some(other) => SalvageReader::with_header(source(input)?, open(other, memory)?.1),
        None => SalvageReader::new(source(input)?).map_err(|error| match error.class() {
            // Nothing is behind a header that is cut.
            None | Some(RefusalClass::Cut) => fault(error.into()),
            Some(_) => fault(StreamFault::Header(error)),
        })?,
    };
    let (mut create, mut writer) = (Some(create), None);
    let mut chain = RepairChain::new(packets.header(), memory.decoder_limits());
    let (mut report, mut damaged) = (Repaired::default(), 0);
    while let Some(found) = packets.next_frame().map_err(|error| fault(error.into()))? {
        let packet = match found {
            Salvaged::Damage { at, bytes } => {
                report.damage.push((at, bytes));
                damaged += bytes;
                continue;
            }
            Salvaged::OtherStream { at: 0 } => return Err(fault(StreamFault::OtherHeader).into()),
            Salvaged::OtherStream { at } => {
                report.other_stream_at = Some(at);
                continue;
            }
            Salvaged::Frame(packet) => packet,
        };
        match chain.push(&packet, &mut damaged) {
            Use::Doubled => report.doubled += 1,
            Use::Orphaned => report.orphaned += 1,
            usage => {
                let writer = match (&mut writer, create.take()) {
                    (Some(writer), _) => writer,
                    (none, Some(create)) => {
                        let writer = none.insert(PacketWriter::new(create()?, packets.header())?);
                        if let Some(text) = packets.metadata() {
                            writer.write_metadata(text)?;
                        }
                        writer
                    }
                    (None, None) => unreachable!("it is taken when the writer is made"),
                };
                writer.copy_frame(&packet, packet.header.timestamp_ns)?;
                report.kept += 1;
                report.behind_loss += usize::from(usage == Use::BehindLoss);
            }
        }
    }
    report.had_end = packets.complete();
    report.unknown = packets.skipped();
    let Some(writer) = writer else {
        return Err(fault(StreamFault::NothingDecodes { damage: report.damage }).into());
    };
    Ok((writer.finish()?, report))
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
    /// Nothing, as the packet came before.
    Doubled,
}

/// What can be made of one packet after the other.
struct RepairChain {
    packets: PacketChain,
    /// Use of the next frame if it follows; `None` while something is missing.
    usage: Option<Use>,
    /// Decodes resilient frames behind a loss, as that alone tells when all is exact again. Elsewhere packets are passed over.
    decoder: Decoder,
}

impl RepairChain {
    fn new(header: &StreamHeader, limits: Limits) -> Self {
        let mut decoder = Decoder::new(header, limits);
        decoder.recover(true);
        Self { packets: PacketChain::default(), usage: None, decoder }
    }

    /// Finds the use of the next packet. `damaged` is the number of damaged bytes before it, set to 0 once they count.
    fn push(&mut self, packet: &Packet, damaged: &mut u64) -> Use {
        let link = self.packets.push(packet);
        if link == Link::Doubled {
            return Use::Doubled;
        }
        let damaged = std::mem::take(damaged);
        let lost = damaged > 0 && packet.may_lack_keyframe(damaged);
        self.usage = match link {
            Link::Keyframe => Some(Use::Whole),
            Link::Next if !lost => self.usage,
            _ => None,
        };
        if let Some(usage) = self.usage {
            self.decoder.pass_over(packet);
            return usage;
        }
        if lost {
            self.decoder.lose_packet();
        }
        match self.decoder.decode(packet) {
            Ok(frame) => {
                if frame.inexact_blocks == 0 {
                    self.usage = Some(Use::BehindLoss);
                }
                Use::BehindLoss
            }
            // It needs no lost one, and its bytes count towards what is allowed to those behind it.
            Err(error) if error.class() == Some(RefusalClass::Limit) => Use::BehindLoss,
            Err(_) => Use::Orphaned,
        }
    }
}

#[cfg(all(test, feature = "encode"))]
mod tests {
    use super::*;
    use crate::encode::default_grid;
    use isv_encode::{Encoder, EncoderSettings, MainSettings, Refresh};
    use isv_format::{FrameRate, PacketReader, Profile};
    use isv_volume::{Grid, VolumeBuilder, VoxelSize};

    /// A floor, whose keyframe has most of the bytes; what decoders allow a frame depends on those.
    #[test]
    fn bytes_before_a_loss_count_and_what_has_too_few_is_kept() {
        let grid = Grid { voxel_size: VoxelSize::from_metres(0.01).unwrap(), ..default_grid() };
        let header = StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT);
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
            let mut chain = RepairChain::new(&header, limits);
            let left = packets.iter().enumerate().filter(|(frame, _)| *frame != lost);
            left.map(|(_, packet)| chain.push(packet, &mut 0)).collect::<Vec<_>>()
        };
        let behind_loss = [Use::BehindLoss; 7];
        assert_eq!(usages(0), behind_loss);
        assert_eq!(usages(2), [&[Use::Whole; 2], &behind_loss[..5]].concat());
        // The decoder of frame 3 has the bytes of all before it.
        let mut chain = RepairChain::new(&header, limits);
        for packet in &packets[..2] {
            chain.push(packet, &mut 0);
        }
        assert!(chain.decoder.decode(&packets[3]).is_ok());
    }
}
