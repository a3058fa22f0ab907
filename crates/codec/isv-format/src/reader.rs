//! Packets off a byte source, one after the other.

use crate::packet::checksum;
use crate::{FormatError, MAX_PAYLOAD, Packet, PacketHeader, PacketKind, StreamHeader, StreamIndex};
use std::io::Read;

/// Reads packets from anything that gives bytes, a pipe or a socket included. Never seeks.
#[derive(Debug)]
pub struct PacketReader<R> {
    source: R,
    header: Option<StreamHeader>,
    at: u64,
    largest_payload: u32,
    saw_index: bool,
    /// The index, once it and the trailer have been read.
    index: Option<StreamIndex>,
}

impl<R: Read> PacketReader<R> {
    /// Reads the stream header.
    ///
    /// # Errors
    /// Bytes that are not a stream header of this version.
    pub fn new(mut source: R) -> Result<Self, FormatError> {
        let header = StreamHeader::read(&mut source)?;
        Ok(Self {
            source,
            header: Some(header),
            at: StreamHeader::BYTES as u64,
            largest_payload: MAX_PAYLOAD,
            saw_index: false,
            index: None,
        })
    }

    /// Continues at a packet that begins at byte `at`, to which `source` has been brought.
    pub fn at_packet(source: R, at: u64) -> Self {
        let largest_payload = MAX_PAYLOAD;
        Self { source, header: None, at, largest_payload, saw_index: false, index: None }
    }

    /// Refuses packets whose payload is larger than this, before a byte of it is read.
    #[must_use]
    pub fn with_largest_payload(self, bytes: u32) -> Self {
        Self { largest_payload: bytes, ..self }
    }

    /// The stream header, if this reader began at it.
    pub fn header(&self) -> Option<&StreamHeader> {
        self.header.as_ref()
    }

    /// Whether index and trailer have been read: the stream ended as its writer meant it to.
    pub fn complete(&self) -> bool {
        self.index.is_some()
    }

    /// What the stream says where its frames are, once it is [complete](Self::complete). Nobody compared that with the frames.
    pub fn index(&self) -> Option<&StreamIndex> {
        self.index.as_ref()
    }

    /// Where the next packet begins, or the stream ends once it is [complete](Self::complete).
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Whether bytes follow what was read: behind the end of a stream there should be none. Waits for a byte of a source that has not
    /// ended.
    ///
    /// # Errors
    /// Those of the source.
    pub fn has_more(&mut self) -> Result<bool, FormatError> {
        Ok(read_up_to(&mut self.source, &mut [0])? > 0)
    }

    /// The next packet, its checksum verified; `None` at the end of the bytes or after the index. The trailer is not looked at.
    ///
    /// # Errors
    /// Bytes that end inside a packet, or are none.
    pub fn next_packet(&mut self) -> Result<Option<Packet>, FormatError> {
        if self.saw_index {
            return Ok(None);
        }
        let mut bytes = [0; PacketHeader::BYTES];
        let length = read_up_to(&mut self.source, &mut bytes)?;
        if length == 0 {
            return Ok(None);
        }
        if length < bytes.len() {
            return Err(FormatError::Truncated { at: self.at + length as u64, inside: "a packet header" });
        }
        let payload_bytes = PacketHeader::length(&bytes, self.at)?;
        if payload_bytes > self.largest_payload {
            let (asked, allowed) = (u64::from(payload_bytes), u64::from(self.largest_payload));
            let what = "packet payload bytes";
            return Err(FormatError::LimitExceeded { at: self.at, what, asked, allowed });
        }
        let payload = self.read_payload(payload_bytes)?;
        let (fields, stated) = bytes.split_at(PacketHeader::BYTES - 4);
        if checksum(fields, &payload).to_le_bytes() != stated {
            return Err(FormatError::Checksum { at: self.at, what: "the packet" });
        }
        let header = PacketHeader::parse(&bytes, self.at)?;
        let packet = Packet { header, at: self.at, payload };
        self.at += packet.total_bytes() as u64;
        self.saw_index = header.kind == PacketKind::Index;
        Ok(Some(packet))
    }

    /// The next frame packet; `None` at the end of the stream. Index and trailer, when they come, are checked and passed over.
    ///
    /// # Errors
    /// As [`Self::next_packet`]; and an index or a trailer that is wrong.
    pub fn next_frame(&mut self) -> Result<Option<Packet>, FormatError> {
        match self.next_packet()? {
            Some(packet) if packet.header.kind == PacketKind::Index => {
                let index = StreamIndex::parse(&packet.payload, packet.at)?;
                self.check_trailer(packet.at)?;
                self.index = Some(index);
                Ok(None)
            }
            other => Ok(other),
        }
    }

    /// Reads as many bytes as there are, so that a false length takes no memory.
    fn read_payload(&mut self, length: u32) -> Result<Vec<u8>, FormatError> {
        let mut payload = Vec::new();
        self.source.by_ref().take(u64::from(length)).read_to_end(&mut payload)?;
        if payload.len() < length as usize {
            let at = self.at + (PacketHeader::BYTES + payload.len()) as u64;
            return Err(FormatError::Truncated { at, inside: "a packet" });
        }
        Ok(payload)
    }

    fn check_trailer(&mut self, index_at: u64) -> Result<(), FormatError> {
        let mut bytes = [0; StreamIndex::TRAILER_BYTES];
        let length = read_up_to(&mut self.source, &mut bytes)?;
        if length < bytes.len() {
            return Err(FormatError::Truncated { at: self.at + length as u64, inside: "the trailer" });
        }
        if !StreamIndex::is_trailer(&bytes) {
            return Err(FormatError::malformed(self.at, "no trailer follows the index"));
        }
        match StreamIndex::parse_trailer(&bytes) {
            Some(at) if at == index_at => {
                self.at += bytes.len() as u64;
                Ok(())
            }
            Some(_) => Err(FormatError::malformed(self.at, "the trailer does not match the index")),
            None => Err(FormatError::Checksum { at: self.at, what: "the trailer" }),
        }
    }
}

/// Fills as much of `buffer` as the source has.
pub(crate) fn read_up_to(source: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
