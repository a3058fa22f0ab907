//! What a server reads of a live source and of requests. Its modules are compiled in by themselves: the server around them is no reader.

#[path = "../../../apps/isv-serve/src/source/packets.rs"]
mod packets;
#[path = "../../../apps/isv-serve/src/range.rs"]
mod range;

use crate::differential::Trickle;
use isv_format::{MOST_METADATA_BYTES, PacketHeader, PacketReader, StreamHeader};
use packets::{Packets, Piece};
use range::Selected;
use std::io::Read;

/// Largest payload that is taken.
const LARGEST_PAYLOAD: u32 = 1 << 16;

/// Reads streams that may be damaged, cut and followed by others, all at once and a byte at a time.
pub(crate) fn read_packets(bytes: &[u8]) {
    let found = pieces(bytes);
    assert!(found == pieces(Trickle(bytes)), "a byte at a time against all");
    // As they are, and with checksums that let more through.
    let sealed = crate::sealing::with_checksums(bytes);
    pieces(&sealed[..]);
}

/// All pieces in words. Each is whole in itself.
fn pieces(source: impl Read) -> Vec<String> {
    let mut packets = Packets::new(source, 0, LARGEST_PAYLOAD);
    let (mut found, mut stream) = (Vec::new(), None);
    while let Some(piece) = packets.next().expect("memory can be read") {
        match &piece {
            Piece::Header(header) => {
                let read = StreamHeader::parse(&header.to_bytes()).expect("a stream header");
                assert_eq!(read, *header);
                stream = Some(read);
            }
            Piece::Frame { packet, entry } => {
                let stream = stream.as_ref().expect("packets come after a stream header");
                let read = PacketReader::at_packet(&packet[..], 0, stream).next_packet();
                let read = read.expect("a packet").expect("a packet");
                assert_eq!((read.total_bytes(), read.is_entry(&stream.profile)), (packet.len(), *entry));
                assert!(read.payload.len() <= LARGEST_PAYLOAD as usize);
            }
            Piece::Metadata(packet) => {
                assert!(stream.is_some(), "metadata comes after a stream header");
                assert!(packet.len() <= PacketHeader::BYTES + MOST_METADATA_BYTES);
            }
            Piece::End | Piece::Damage(_) => {}
        }
        found.push(format!("{piece:?}"));
    }
    found
}

/// Reads a `Range` header for files of several lengths.
pub(crate) fn read_range(bytes: &[u8]) {
    let Ok(header) = std::str::from_utf8(bytes) else { return };
    for length in [0, 1, 10, 1 << 40, u64::MAX] {
        match range::select(Some(header), length) {
            Selected::Part(part) => {
                assert!(part.start < part.end && part.end <= length, "{part:?} of {length} bytes");
            }
            Selected::Whole | Selected::Unsatisfiable => {}
        }
    }
}
