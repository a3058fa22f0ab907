//! Streams and files whose checksums are made to fit: nothing that a fuzzer changes would get past them.

use isv::raw::format::{PacketHeader, StreamHeader, StreamIndex};
use std::ops::Range;

/// Bytes of a checksum of a stream, which are the last of whatever has one.
const CHECKSUM: usize = 4;
/// Place at which a packet header states the bytes of its payload.
const LENGTH: Range<usize> = 8..12;
/// Bytes of a block of a tar archive, of which a header is one. Below are the places of a header's size, its
/// checksum, and its mark.
const TAR_BLOCK: usize = 512;
const TAR_SIZE: Range<usize> = 124..136;
const TAR_CHECKSUM: Range<usize> = 148..156;
const TAR_MARK: Range<usize> = 257..262;

/// The payloads of the whole packets of a stream, by place.
pub(crate) fn payloads(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut at = StreamHeader::BYTES + PacketHeader::BYTES;
    while at <= bytes.len() {
        let length = &bytes[at - PacketHeader::BYTES..][LENGTH];
        let length = u32::from_le_bytes(length.try_into().expect("four bytes")) as usize;
        if length > bytes.len() - at {
            break;
        }
        found.push(at..at + length);
        at += length + PacketHeader::BYTES;
    }
    found
}

/// The stream with another payload in the place of one of its own, and the length in its packet's header made to fit.
pub(crate) fn replace_payload(bytes: &[u8], place: &Range<usize>, payload: &[u8]) -> Vec<u8> {
    let mut out = [&bytes[..place.start], payload, &bytes[place.end..]].concat();
    let header = &mut out[place.start - PacketHeader::BYTES..place.start];
    header[LENGTH].copy_from_slice(&(payload.len() as u32).to_le_bytes());
    out
}

/// The stream with the checksums of its header, of its whole packets and of its trailer made anew.
pub(crate) fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if bytes.len() < StreamHeader::BYTES {
        return bytes;
    }
    seal(&mut bytes[..StreamHeader::BYTES], &[]);
    let payloads = payloads(&bytes);
    for place in &payloads {
        let (before, payload) = bytes.split_at_mut(place.start);
        let header = before.len() - PacketHeader::BYTES;
        seal(&mut before[header..], &payload[..place.len()]);
    }
    let end = payloads.last().map_or(StreamHeader::BYTES, |last| last.end);
    if let Some(trailer) = bytes[end..].get_mut(..StreamIndex::TRAILER_BYTES) {
        // What begins as a packet is a cut one.
        if !trailer.starts_with(&PacketHeader::MAGIC) {
            seal(trailer, &[]);
        }
    }
    bytes
}

/// Writes the checksum at the end of a structure: that of the bytes before it and of the payload after it.
fn seal(structure: &mut [u8], payload: &[u8]) {
    let (fields, checksum) = structure.split_at_mut(structure.len() - CHECKSUM);
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(fields);
    hasher.update(payload);
    checksum.copy_from_slice(&hasher.finalize().to_le_bytes());
}

/// A file of E57 with the checksums of its whole pages made anew.
pub(crate) fn with_page_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    isv_testfiles::e57::seal(&mut bytes);
    bytes
}

/// A tar archive with the checksums of its headers made anew. What does not begin as one stays as it is.
pub(crate) fn with_header_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if bytes.get(TAR_MARK) != Some(b"ustar") {
        return bytes;
    }
    let mut rest = &mut bytes[..];
    while let Some((header, data)) = rest.split_at_mut_checked(TAR_BLOCK) {
        if header.iter().all(|byte| *byte == 0) {
            break;
        }
        // Its own field counts as blanks.
        header[TAR_CHECKSUM].fill(b' ');
        let sum: u32 = header.iter().map(|byte| u32::from(*byte)).sum();
        header[TAR_CHECKSUM].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        let blocks = tar_size(&header[TAR_SIZE]).div_ceil(TAR_BLOCK);
        rest = data.get_mut(blocks.saturating_mul(TAR_BLOCK)..).unwrap_or_default();
    }
    bytes
}

/// A size as a tar header has it: octal digits, or binary if the first bit says so.
fn tar_size(field: &[u8]) -> usize {
    let (binary, rest) = (field[0] & 0x80 != 0, &field[1..]);
    if binary {
        return rest
            .iter()
            .fold(0, |size: usize, byte| size.saturating_mul(256).saturating_add((*byte).into()));
    }
    let digits = field.iter().filter(|byte| (b'0'..b'8').contains(*byte));
    digits.fold(0, |size: usize, digit| size.saturating_mul(8).saturating_add((digit - b'0').into()))
}
