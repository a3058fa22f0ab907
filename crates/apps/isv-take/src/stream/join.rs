//! Streams one after the other, as one.

use super::{EditError, StreamFault, metadata_text, open, tell_if_cut, tell_if_left_out};
use crate::timeline::frame_at;
use crate::{Event, Input, MemoryLimit, Observer};
use isv_format::{MetadataText, PacketChain, PacketWriter, StreamHeader};
use std::io::{self, Write};

/// Times of joined streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JoinedTimes {
    /// Each stream follows the one before at the frame rate.
    #[default]
    Follow,
    /// Packets keep their times, as pieces of one take have them that were encoded with a time origin. A time that does not ascend
    /// becomes one frame after the one before.
    Keep,
}

/// Copies streams one after the other, without coding anything anew. They have one version, profile, grid, frame rate and number of colour
/// layers. Packets of unknown types are left out, and the observer is told; metadata stay if all streams have the same. Returns the sink and the number of frames; `create` is called when it is sure that they go together, for which files are opened twice.
///
/// # Errors
/// [`EditError`]: a pipe, streams that do not go together, have no frame or begin with no keyframe, and what reading and writing may fail
/// by.
///
/// # Panics
/// Without any stream.
pub fn join<W: Write>(
    inputs: &[Input],
    times: JoinedTimes,
    memory: MemoryLimit,
    observer: &dyn Observer,
    create: impl FnOnce() -> io::Result<W>,
) -> Result<(W, usize), EditError> {
    for input in inputs {
        if input.path().is_none_or(|path| path.metadata().is_ok_and(|found| !found.is_file())) {
            return Err(StreamFault::NoFile.in_stream(&input.name()).into());
        }
    }
    let headers = inputs.iter().map(|input| Ok(open(input, memory)?.1));
    let headers = headers.collect::<Result<Vec<_>, EditError>>()?;
    let header = headers[0];
    for (other, input) in headers.iter().zip(inputs) {
        if let Some(what) = difference(&header, other) {
            return Err(StreamFault::Differs { what, from: inputs[0].name() }
                .in_stream(&input.name())
                .into());
        }
    }
    let mut writer = PacketWriter::new(create()?, &header)?;
    if let Some(text) = &common_metadata(inputs)? {
        writer.write_metadata(text)?;
    }
    let (mut frames, mut next_ns, mut last_ns) = (0, 0, None);
    for input in inputs {
        let name = input.name();
        let fault = |fault: StreamFault| fault.in_stream(&name);
        let (mut packets, now) = open(input, memory)?;
        if difference(&header, &now).is_some() {
            return Err(fault(StreamFault::Changed).into());
        }
        let (mut first_ns, begin_ns, mut chain) = (None, next_ns, PacketChain::default());
        while let Some(packet) = packets.next_frame().map_err(|error| fault(error.into()))? {
            if first_ns.is_none() && !packet.is_keyframe() {
                return Err(fault(StreamFault::NoFirstKeyframe).into());
            }
            if !chain.push(&packet).is_in_order() {
                observer.event(&Event::Gap { name: name.clone(), frame: None, at: packet.at });
            }
            let first_ns = *first_ns.get_or_insert(packet.header.timestamp_ns);
            let time_ns = packet.header.timestamp_ns.saturating_sub(first_ns).saturating_add(begin_ns);
            let frame = frame_at(header.frame_rate, time_ns);
            let at_ns = match times {
                JoinedTimes::Follow => frame.map_or(time_ns, |frame| header.frame_rate.timestamp_ns(frame)),
                JoinedTimes::Keep => {
                    let after_last_ns = |last: u64| last.saturating_add(header.frame_rate.timestamp_ns(1));
                    let stated_ns = packet.header.timestamp_ns;
                    last_ns.filter(|last| stated_ns <= *last).map_or(stated_ns, after_last_ns)
                }
            };
            last_ns = Some(at_ns);
            writer.copy_frame(&packet, at_ns)?;
            next_ns = match frame {
                Some(frame) => header.frame_rate.timestamp_ns(frame + 1),
                None => time_ns.saturating_add(header.frame_rate.timestamp_ns(1)),
            };
            frames += 1;
        }
        if first_ns.is_none() {
            return Err(fault(StreamFault::EndsBefore { frame: 0 }).into());
        }
        tell_if_left_out(&name, packets.skipped(), observer);
        tell_if_cut(&name, &packets, observer);
        if packets.complete() {
            super::tell_if_more(input, packets.at(), observer);
        }
    }
    Ok((writer.finish()?, frames))
}

/// What all streams say of themselves, if it is the same.
fn common_metadata(inputs: &[Input]) -> Result<Option<MetadataText>, EditError> {
    let texts = inputs.iter().map(metadata_text).collect::<Result<Vec<_>, _>>()?;
    let (first, others) = texts.split_first().expect("there is a stream");
    Ok(first.clone().filter(|_| others.iter().all(|other| other == first)))
}

/// What keeps packets of two streams from being in one.
fn difference(a: &StreamHeader, b: &StreamHeader) -> Option<&'static str> {
    [
        (a.profile.name() != b.profile.name(), "profile"),
        (a.profile != b.profile, "quantizer"),
        (a.grid.voxel_size != b.grid.voxel_size, "voxel size"),
        (a.grid != b.grid, "grid"),
        (a.frame_rate != b.frame_rate, "frame rate"),
        (a.colour_layers != b.colour_layers, "number of colour layers"),
        (a.mask_coding != b.mask_coding, "coding of masks"),
        (a.version != b.version, "format version"),
    ]
    .into_iter()
    .find_map(|(differs, what)| differs.then_some(what))
}
