//! The container alone: stream header, packets, frame payloads, index and trailer. They come as bytes from a
//! pipe, as a file, and as what is left of a damaged one.

use crate::sealing::with_checksums;
use isv::raw::format::{
    FormatError, FormatVersion, FramePayload, MAGIC, Packet, PacketHeader, PacketKind, PacketReader,
    PayloadParts, SalvageReader, Salvaged, StreamHeader, StreamIndex,
};
use std::io::Cursor;

/// Reads the bytes as they are, and with the checksums that they should have.
pub(crate) fn read(bytes: &[u8]) {
    read_as_it_is(bytes);
    read_as_it_is(&with_checksums(bytes));
}

fn read_as_it_is(bytes: &[u8]) {
    if let Some(first) = bytes.first_chunk::<{ StreamHeader::BYTES }>()
        && let Ok(header) = StreamHeader::parse(first)
    {
        assert_eq!(header.to_bytes(), *first, "a header has one form");
    }
    let Ok(mut reader) = PacketReader::new(bytes) else {
        let _ = StreamIndex::load(&mut Cursor::new(bytes));
        return;
    };
    let header = *reader.header();
    let mut packets = Vec::new();
    let end = loop {
        match reader.next_packet() {
            Ok(Some(packet)) => packets.push(packet),
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    let (mut at, mut gaps) = (StreamHeader::BYTES as u64, 0);
    for packet in &packets {
        assert!(packet.at >= at, "packets are in order");
        gaps += usize::from(packet.at > at);
        at = packet.at + packet.total_bytes() as u64;
        read_packet(packet, &header, bytes);
    }
    assert!(at <= bytes.len() as u64);
    let may_skip = header.version > FormatVersion::V1;
    assert!(gaps == 0 || may_skip, "packets follow each other without gaps, but for those skipped");
    assert!(
        reader.skipped() == 0 && reader.metadata().is_none() || may_skip,
        "version 1 has nothing to skip"
    );
    salvage(bytes, &packets, &header);
    load_index(bytes, &packets, end, &header);
}

/// A packet that was read: it stands where it says, and its contents are read as what they are.
fn read_packet(packet: &Packet, header: &StreamHeader, bytes: &[u8]) {
    let again = PacketReader::at_packet(&bytes[packet.at as usize..], packet.at, header).next_packet();
    assert_eq!(again.ok().flatten().as_ref(), Some(packet), "a packet is whole in itself");
    let PacketHeader { kind, since_keyframe, timestamp_ns, .. } = packet.header;
    let sealed = PacketHeader::seal(kind, since_keyframe, timestamp_ns, &packet.payload);
    assert!(bytes[packet.at as usize..].starts_with(&sealed), "a packet header has one form");
    match kind {
        PacketKind::Frame { hashed, colour, .. } => {
            let (at, profile) = (packet.payload_at(), &header.profile);
            let Ok(PayloadParts { geometry, colour: part }) = packet.parts() else {
                assert!(colour, "a payload without colour has one part");
                return;
            };
            assert_eq!(part.is_some(), colour);
            let length = part.map_or(0, |part| part.len() + PayloadParts::LENGTH_BYTES);
            assert_eq!(geometry.len() + length, packet.payload.len(), "the parts fill the payload");
            if let Ok(payload) = FramePayload::parse(geometry, at, hashed, profile) {
                let written = payload.to_bytes();
                // Numbers may have been written with more bytes than they need.
                assert!(written.len() <= geometry.len());
                let again =
                    FramePayload::parse(&written, at, hashed, profile).expect("what was written is read");
                assert_eq!(again, payload);
            }
        }
        PacketKind::Metadata | PacketKind::Skippable { .. } => {
            panic!("a packet is given that is none of the stream's")
        }
        PacketKind::Index => {
            if let Ok(index) = StreamIndex::parse(&packet.payload, packet.at) {
                assert_eq!(index.to_payload(), packet.payload, "an index has one form");
            }
        }
    }
}

/// Looks for packets past damage. `packets`: those before it, which are found all the same.
fn salvage(bytes: &[u8], packets: &[Packet], header: &StreamHeader) {
    let mut reader = SalvageReader::new(bytes).expect("the header was read");
    let (mut found, mut at) = (Vec::new(), StreamHeader::BYTES as u64);
    let passed_over = |from: u64, to: u64| {
        assert!(from <= to, "what is found is in order");
        let rest = &bytes[from as usize..to as usize];
        // An index, and the trailer behind it; what may be skipped; the stream's header again.
        assert!(
            rest.is_empty() || rest.starts_with(&PacketHeader::MAGIC) || rest.starts_with(&MAGIC),
            "bytes {from} to {to} are neither"
        );
    };
    let mut newer = false;
    while !newer {
        let salvaged = match reader.next_frame() {
            Ok(Some(salvaged)) => salvaged,
            Ok(None) => break,
            Err(error) => {
                assert!(matches!(error, FormatError::PacketType { .. }), "memory can be read: {error}");
                newer = true;
                continue;
            }
        };
        let (begin, length) = match &salvaged {
            Salvaged::Frame(packet) => (packet.at, packet.total_bytes() as u64),
            Salvaged::Damage { at, bytes } => (*at, *bytes),
            Salvaged::OtherStream { at } => (*at, bytes.len() as u64 - at),
        };
        passed_over(at, begin);
        at = begin + length;
        if let Salvaged::Frame(packet) = salvaged {
            let again = PacketReader::at_packet(&bytes[begin as usize..], begin, header).next_packet();
            assert_eq!(again.ok().flatten().as_ref(), Some(&packet), "a packet is whole in itself");
            found.push(packet);
        } else {
            assert!(length > 0, "damage has bytes");
        }
    }
    if !newer {
        passed_over(at, bytes.len() as u64);
    }
    let frames: Vec<_> = packets.iter().filter(|packet| packet.header.kind != PacketKind::Index).collect();
    assert!(found.len() >= frames.len() && frames.iter().zip(&found).all(|(a, b)| *a == b));
}

/// Loads the index as from a file, and goes to each of its frames. `end`: of `packets`, which were read one after the other.
fn load_index(bytes: &[u8], packets: &[Packet], end: Result<(), FormatError>, header: &StreamHeader) {
    let loaded = StreamIndex::load(&mut Cursor::new(bytes));
    if !has_trailer(bytes) {
        let frames = packets.iter().filter(|packet| packet.header.kind != PacketKind::Index);
        match &loaded {
            Ok(index) => assert!(
                index
                    .frames
                    .iter()
                    .map(|frame| (frame.at, frame.keyframe))
                    .eq(frames.map(|packet| (packet.at, packet.is_keyframe()))),
                "an index that is made has all whole frames"
            ),
            Err(_) => assert!(
                !matches!(end, Err(FormatError::Truncated { .. }))
                    || packets.last().is_some_and(|last| last.header.kind == PacketKind::Index),
                "a cut stream has an index of its whole frames"
            ),
        }
    }
    let Ok(index) = loaded else { return };
    for (number, frame) in index.frames.iter().enumerate() {
        let keyframe = index.keyframe_before(number);
        assert!(keyframe.is_none_or(|keyframe| keyframe <= number && index.frames[keyframe].keyframe));
        let rest = bytes.get(frame.at as usize..).unwrap_or_default();
        let _ = PacketReader::at_packet(rest, frame.at, header).next_packet();
    }
    assert_eq!(index.keyframe_before(index.frames.len()), None);
}

/// Whether the last bytes are those of a trailer.
fn has_trailer(bytes: &[u8]) -> bool {
    bytes.last_chunk().is_some_and(|last| StreamIndex::parse_trailer(last).is_some())
}
