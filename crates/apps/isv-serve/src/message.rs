//! The live protocol: binary WebSocket messages, the first byte of which is the kind.
//!
//! | kind | what follows | when |
//! |---|---|---|
//! | [`HEADER`] | the 48 bytes of a stream header | first, and whenever the source starts anew |
//! | [`ENTRY`] | unix time in ms when the server had it (`f64`), the packet as in a file | decoding can begin or recover here |
//! | [`PACKET`] | the same | any other packet |
//! | [`END`] | nothing | the source ended; a header may follow |
//! | [`END`] | a byte, [`FOR_GOOD`] | the source has ended for good; the connection closes |
//! | [`METADATA`] | the metadata packet as in a file | after a header, if the stream says what it is |
//! | [`CLOCK`] | unix time in ms of the server (`f64`), the 8 bytes that the viewer sent | answer to a message of 8 bytes |
//!
//! Numbers are little-endian. A viewer sends nothing but those 8 bytes, its own time, to find how far the clocks differ.

use axum::body::Bytes;
use isv_format::StreamHeader;
use std::time::{SystemTime, UNIX_EPOCH};

/// A stream begins.
pub const HEADER: u8 = 0;
/// A frame that needs the ones before it.
pub const PACKET: u8 = 1;
/// The source ended.
pub const END: u8 = 2;
/// The byte after [`END`] where no header follows any more.
pub const FOR_GOOD: u8 = 1;
/// The server's time.
pub const CLOCK: u8 = 3;

/// What the stream is: the packet of section 6.8 of the specification.
pub const METADATA: u8 = 5;

/// A frame at which decoding can begin, or begin to recover.
pub const ENTRY: u8 = 4;

/// Whether a message is a frame's packet, of either kind.
#[must_use]
pub fn is_packet(message: &[u8]) -> bool {
    matches!(message.first(), Some(&(PACKET | ENTRY)))
}

/// Bytes of a viewer's question for the time.
pub const CLOCK_QUESTION_BYTES: usize = 8;

pub(crate) fn header(header: &[u8; StreamHeader::BYTES]) -> Bytes {
    joined(HEADER, &[header])
}

/// `packet` is header and payload; `entry` whether decoding can begin or recover there; `arrived_ms` in milliseconds since 1970.
pub(crate) fn packet(packet: &[u8], entry: bool, arrived_ms: f64) -> Bytes {
    joined(if entry { ENTRY } else { PACKET }, &[&arrived_ms.to_le_bytes(), packet])
}

pub(crate) fn metadata(packet: &[u8]) -> Bytes {
    joined(METADATA, &[packet])
}

pub(crate) fn end() -> Bytes {
    Bytes::from_static(&[END])
}

pub(crate) fn end_for_good() -> Bytes {
    Bytes::from_static(&[END, FOR_GOOD])
}

pub(crate) fn clock(now_ms: f64, question: &[u8; CLOCK_QUESTION_BYTES]) -> Bytes {
    joined(CLOCK, &[&now_ms.to_le_bytes(), question])
}

fn joined(kind: u8, parts: &[&[u8]]) -> Bytes {
    let mut message = Vec::with_capacity(1 + parts.iter().map(|part| part.len()).sum::<usize>());
    message.push(kind);
    for part in parts {
        message.extend_from_slice(part);
    }
    message.into()
}

/// Milliseconds since 1970, by this machine's clock.
pub(crate) fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64() * 1e3
}
