//! Packets off a byte source, one after the other.

use crate::{
    FormatError, MAX_PAYLOAD, MetadataText, Packet, PacketHeader, PacketKind, StreamHeader, StreamIndex,
};
use std::io::Read;

/// Most bytes held of a packet that is passed over.
const PIECE: usize = 1 << 12;

/// Reads packets from anything that gives bytes, a pipe or a socket included. Never seeks.
#[derive(Debug)]
pub struct PacketReader<R> {
    source: R,
    header: StreamHeader,
    at: u64,
    largest_payload: u32,
    saw_index: bool,
    /// Number of packets passed over, as their types are not known.
    skipped: usize,
    /// The first metadata before the first frame.
    metadata: Option<MetadataText>,
    saw_frame: bool,
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
        Ok(Self::at_packet(source, StreamHeader::BYTES as u64, &header))
    }

    /// Continues at a packet that begins at byte `at` of a stream with this header, to which `source` has been brought.
    pub fn at_packet(source: R, at: u64, header: &StreamHeader) -> Self {
        let (header, largest_payload) = (*header, MAX_PAYLOAD);
        Self {
            source,
            header,
            at,
            largest_payload,
            saw_index: false,
            skipped: 0,
            metadata: None,
            saw_frame: false,
            index: None,
        }
    }

    /// Refuses packets whose payload is larger than this, before a byte of it is read.
    #[must_use]
    pub fn with_largest_payload(self, bytes: u32) -> Self {
        Self { largest_payload: bytes, ..self }
    }

    /// The stream header.
    pub fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// Whether index and trailer have been read: the stream ended as its writer meant it to.
    pub fn complete(&self) -> bool {
        self.index.is_some()
    }

    /// What the stream says where its frames are, once it is [complete](Self::complete). Nobody compared that with the frames.
    pub fn index(&self) -> Option<&StreamIndex> {
        self.index.as_ref()
    }

    /// The source, behind what was read of it.
    pub fn into_source(self) -> R {
        self.source
    }

    /// Offset (bytes) at which the next packet begins, or the stream ends once it is [complete](Self::complete).
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Number of packets passed over so far, as this build does not know their types and may skip them.
    pub fn skipped(&self) -> usize {
        self.skipped
    }

    /// What the take is, once the first frame has been read; `None` if the stream does not say it.
    pub fn metadata(&self) -> Option<&MetadataText> {
        self.metadata.as_ref()
    }

    /// Whether bytes follow what was read: behind the end of a stream there should be none. Waits for a byte of a source that has not
    /// ended.
    ///
    /// # Errors
    /// Those of the source.
    pub fn has_more(&mut self) -> Result<bool, FormatError> {
        Ok(read_up_to(&mut self.source, &mut [0])? > 0)
    }

    /// The next packet of a known type, its checksum verified; `None` at the end of the bytes or after the index. The trailer is not
    /// looked at. Metadata before the first frame
    /// are kept; other packets that may be skipped are checked and passed over, and their payloads are not held.
    ///
    /// # Errors
    /// Bytes that end inside a packet, or are none. A packet of another version's type that must not be skipped.
    pub fn next_packet(&mut self) -> Result<Option<Packet>, FormatError> {
        while !self.saw_index {
            let Some(bytes) = self.read_header()? else { return Ok(None) };
            let payload_bytes = PacketHeader::length(&bytes, self.at)?;
            if payload_bytes > self.largest_payload {
                return Err(FormatError::payload_above(payload_bytes.into(), self.largest_payload, self.at));
            }
            // The type counts once the checksum was compared. Until then it decides what is held, and nothing else.
            let is_kept = PacketHeader::is_of_known_type(&bytes)
                || self.takes_metadata() && PacketHeader::is_of_metadata(&bytes, payload_bytes);
            let mut payload = is_kept.then(Vec::new);
            let (fields, stated) = bytes.split_at(PacketHeader::BYTES - 4);
            if self.read_payload(fields, payload_bytes, payload.as_mut())?.to_le_bytes() != stated {
                return Err(FormatError::Checksum { at: self.at, what: "the packet" });
            }
            let header = PacketHeader::parse(&bytes, self.at, &self.header)?;
            let at = self.at;
            self.at += PacketHeader::BYTES as u64 + u64::from(payload_bytes);
            match payload {
                Some(payload) if header.kind == PacketKind::Metadata => {
                    self.metadata = MetadataText::from_payload(payload);
                }
                None if header.kind == PacketKind::Metadata => {}
                Some(payload) => {
                    self.saw_frame |= header.kind.is_frame();
                    self.saw_index = header.kind == PacketKind::Index;
                    return Ok(Some(Packet { header, at, payload }));
                }
                None => self.skipped += 1,
            }
        }
        Ok(None)
    }

    /// Whether metadata would be kept that comes now.
    fn takes_metadata(&self) -> bool {
        self.metadata.is_none() && !self.saw_frame
    }

    /// The bytes of a packet's header; `None` at the end of the bytes.
    fn read_header(&mut self) -> Result<Option<[u8; PacketHeader::BYTES]>, FormatError> {
        let mut bytes = [0; PacketHeader::BYTES];
        match read_up_to(&mut self.source, &mut bytes)? {
            0 => Ok(None),
            length if length < bytes.len() => {
                Err(FormatError::Truncated { at: self.at + length as u64, inside: "a packet header" })
            }
            _ => Ok(Some(bytes)),
        }
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

    /// Reads a payload, and returns its checksum with the `fields` before it. Only as many bytes are held as there are, so that a false
    /// length takes no memory; without `payload` a piece at a time.
    fn read_payload(
        &mut self,
        fields: &[u8],
        length: u32,
        payload: Option<&mut Vec<u8>>,
    ) -> Result<u32, FormatError> {
        let mut source = self.source.by_ref().take(u64::from(length));
        let mut checksum = crc32fast::Hasher::new();
        checksum.update(fields);
        let read = match payload {
            Some(payload) => {
                source.read_to_end(payload)?;
                checksum.update(payload);
                payload.len()
            }
            None => pass(&mut source, &mut checksum)?,
        };
        if read < length as usize {
            let at = self.at + (PacketHeader::BYTES + read) as u64;
            return Err(FormatError::Truncated { at, inside: "a packet" });
        }
        Ok(checksum.finalize())
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

/// Reads a source to its end, adds its bytes to a checksum, and returns how many they were.
fn pass(source: &mut impl Read, checksum: &mut crc32fast::Hasher) -> std::io::Result<usize> {
    let mut piece = [0; PIECE];
    let mut passed = 0;
    loop {
        let length = read_up_to(source, &mut piece)?;
        checksum.update(&piece[..length]);
        passed += length;
        if length < piece.len() {
            return Ok(passed);
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
