//! Frames of a stream, as they are, in a stream of their own.

use super::{EditError, StreamFault, load_index, metadata_text, open, open_file};
use super::{tell_if_cut, tell_if_left_out};
use crate::{Event, FrameRange, Input, MemoryLimit, Observer};
use isv_format::{PacketChain, PacketReader, PacketWriter, StreamIndex};
use std::io::{self, Seek, SeekFrom, Write};

/// Copies frames of a stream in a file, from a keyframe on, without coding anything anew. The copy begins at time 0 and keeps the metadata. Packets of unknown
/// types between the frames are left out, and the observer is told. Returns the sink and the number of frames; `create` is called once there is a frame to write.
///
/// # Errors
/// [`EditError`]: frames that are not there, a first frame that is no keyframe, and what reading and writing may fail by.
pub fn cut<W: Write>(
    input: &Input,
    frames: FrameRange,
    memory: MemoryLimit,
    observer: &dyn Observer,
    create: impl FnOnce() -> io::Result<W>,
) -> Result<(W, usize), EditError> {
    let name = input.name();
    let fault = |fault: StreamFault| fault.in_stream(&name);
    let index = load_index(input)?;
    let range = frames.within(index.frames.len()).map_err(|error| fault(error.into()))?;
    if !index.frames[range.start].keyframe {
        return Err(fault(no_keyframe(&index, range.start)).into());
    }
    let (_, header) = open(input, memory)?;
    let at = index.frames[range.start].at;
    let mut file = open_file(input)?;
    file.seek(SeekFrom::Start(at)).map_err(|error| fault(error.into()))?;
    let mut packets =
        PacketReader::at_packet(file, at, &header).with_largest_payload(memory.largest_payload());
    let next = |packets: &mut PacketReader<_>, frame| match packets.next_frame() {
        Ok(packet) => packet.ok_or_else(|| fault(StreamFault::EndsBefore { frame })),
        Err(error) => Err(fault(error.into())),
    };
    let mut packet = next(&mut packets, range.start)?;
    if !packet.is_keyframe() {
        return Err(fault(StreamFault::FalseKeyframe { frame: range.start }).into());
    }
    let mut writer = PacketWriter::new(create()?, &header)?;
    if let Some(text) = &metadata_text(input)? {
        writer.write_metadata(text)?;
    }
    let first_ns = packet.header.timestamp_ns;
    let mut chain = PacketChain::default();
    for frame in range.clone() {
        if frame > range.start {
            packet = next(&mut packets, frame)?;
        }
        if !chain.push(&packet).is_in_order() {
            observer.event(&Event::Gap { name: name.clone(), frame: Some(frame), at: packet.at });
        }
        writer.copy_frame(&packet, packet.header.timestamp_ns.saturating_sub(first_ns))?;
    }
    // Behind the last frame that was found there may be more, of which nothing can be copied.
    if range.end == index.frames.len() {
        match packets.next_frame() {
            Ok(_) if packets.complete() => super::tell_if_more(input, packets.at(), observer),
            Ok(_) => tell_if_cut(&name, &packets, observer),
            Err(why) => observer.event(&Event::EndsInDamage { name: name.clone(), why: why.to_string() }),
        }
    }
    tell_if_left_out(&name, packets.skipped(), observer);
    Ok((writer.finish()?, range.len()))
}

/// A frame that is no keyframe, with the keyframes around it.
fn no_keyframe(index: &StreamIndex, frame: usize) -> StreamFault {
    let before = index.keyframe_before(frame);
    let after = (frame..index.frames.len()).find(|frame| index.frames[*frame].keyframe);
    StreamFault::NotAKeyframe { frame, before, after }
}
