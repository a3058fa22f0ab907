//! The index: byte offset and keyframe flag of every frame.

use crate::bytes::ByteReader;
use crate::packet::{PacketHeader, PacketKind};
use crate::{FormatError, PacketReader, StreamHeader};
use std::io::{Read, Seek, SeekFrom};

const TRAILER_MAGIC: [u8; 4] = *b"ISVX";

/// Place of one frame in a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexEntry {
    /// Offset of the frame's packet header in the stream (bytes).
    pub at: u64,
    /// Whether decoding can begin here.
    pub keyframe: bool,
}

/// Places of all frames of a stream.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StreamIndex {
    /// One entry a frame, in order.
    pub frames: Vec<IndexEntry>,
}

impl StreamIndex {
    /// Size in bytes of the trailer that follows the index packet. Its fields are the offset of that packet (8), magic (4), and
    /// the CRC-32 of the 12 bytes before it (4).
    pub const TRAILER_BYTES: usize = 16;

    /// Bytes of a frame in the payload.
    pub const ENTRY_BYTES: usize = 8;

    /// Payload of the index packet: 8 bytes a frame, twice the offset plus the keyframe flag.
    #[must_use]
    pub fn to_payload(&self) -> Vec<u8> {
        self.frames.iter().flat_map(|f| (f.at << 1 | u64::from(f.keyframe)).to_le_bytes()).collect()
    }

    /// Parses the payload of an index packet that begins at byte `at`.
    ///
    /// # Errors
    /// Offsets that do not ascend, or point past the index.
    pub fn parse(payload: &[u8], at: u64) -> Result<Self, FormatError> {
        let mut fields = ByteReader::new(payload, at, "the index");
        let mut frames = Vec::with_capacity(payload.len() / Self::ENTRY_BYTES);
        let mut least = StreamHeader::BYTES as u64;
        while !fields.is_empty() {
            let entry_at = fields.at();
            let value = fields.u64()?;
            let entry = IndexEntry { at: value >> 1, keyframe: value & 1 != 0 };
            if entry.at < least || entry.at >= at {
                return Err(FormatError::malformed(
                    entry_at,
                    format!("index entry points to byte {}", entry.at),
                ));
            }
            least = entry.at + PacketHeader::BYTES as u64;
            frames.push(entry);
        }
        Ok(Self { frames })
    }

    /// The trailer of an index packet that begins at byte `at`.
    #[must_use]
    pub fn trailer(at: u64) -> [u8; Self::TRAILER_BYTES] {
        let mut out = Vec::with_capacity(Self::TRAILER_BYTES);
        out.extend(at.to_le_bytes());
        out.extend(TRAILER_MAGIC);
        out.extend(crc32fast::hash(&out).to_le_bytes());
        out.try_into().expect("the fields above fill the trailer")
    }

    /// Offset of the index packet (bytes) that the trailer states; `None` if these are not the bytes of a trailer.
    #[must_use]
    pub fn parse_trailer(bytes: &[u8; Self::TRAILER_BYTES]) -> Option<u64> {
        let at = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes"));
        (*bytes == Self::trailer(at)).then_some(at)
    }

    /// Whether these bytes are meant as a trailer: they have its magic.
    pub(crate) fn is_trailer(bytes: &[u8; Self::TRAILER_BYTES]) -> bool {
        bytes[8..12] == TRAILER_MAGIC
    }

    /// Index of a stream that can seek, read from its end. Where the end is missing, as after a crash of the writer, or damaged,
    /// it is made by walking the packets. Then frames before a cut or damage are found; neither is an error here.
    ///
    /// # Errors
    /// Those of the source, and bytes that do not begin with a stream header of a known version.
    pub fn load(source: &mut (impl Read + Seek)) -> Result<Self, FormatError> {
        source.seek(SeekFrom::Start(0))?;
        let header = StreamHeader::read(source)?;
        let Some(at) = Self::index_at(source)? else { return Self::walk(source, &header, None) };
        match Self::load_at(source, &header, at) {
            Err(FormatError::Io(error)) => Err(error.into()),
            Err(_) => Self::walk(source, &header, Some(at)),
            index => index,
        }
    }

    /// Offset of the index packet (bytes) by the trailer, if there is one.
    fn index_at(source: &mut (impl Read + Seek)) -> Result<Option<u64>, FormatError> {
        let length = source.seek(SeekFrom::End(0))?;
        let smallest = StreamHeader::BYTES + PacketHeader::BYTES + Self::TRAILER_BYTES;
        if length < smallest as u64 {
            return Ok(None);
        }
        source.seek(SeekFrom::End(-(Self::TRAILER_BYTES as i64)))?;
        let mut trailer = [0; Self::TRAILER_BYTES];
        source.read_exact(&mut trailer)?;
        Ok(Self::parse_trailer(&trailer).filter(|at| *at < length))
    }

    fn load_at(source: &mut (impl Read + Seek), header: &StreamHeader, at: u64) -> Result<Self, FormatError> {
        source.seek(SeekFrom::Start(at))?;
        match PacketReader::at_packet(source, at, header).next_packet()? {
            Some(packet) if packet.header.kind == PacketKind::Index && packet.at == at => {
                Self::parse(&packet.payload, at)
            }
            _ => Err(FormatError::malformed(at, "the trailer points to no index")),
        }
    }

    /// Makes the index of the packets there are. `end`: where the index packet begins, which may be damaged.
    fn walk(
        source: &mut (impl Read + Seek),
        header: &StreamHeader,
        end: Option<u64>,
    ) -> Result<Self, FormatError> {
        let begin = StreamHeader::BYTES as u64;
        source.seek(SeekFrom::Start(begin))?;
        let mut reader = PacketReader::at_packet(source, begin, header);
        let mut index = Self::default();
        while Some(reader.at()) != end {
            match reader.next_packet() {
                // A packet that was skipped may stand before the index.
                Ok(Some(packet)) if packet.header.kind.is_frame() && Some(packet.at) != end => {
                    index.frames.push(IndexEntry { at: packet.at, keyframe: packet.is_keyframe() });
                }
                Err(FormatError::Io(error)) => return Err(error.into()),
                Ok(_) | Err(_) => break,
            }
        }
        Ok(index)
    }

    /// Number of the last keyframe at or before a frame; `None` if there is none or the frame does not exist.
    #[must_use]
    pub fn keyframe_before(&self, frame: usize) -> Option<usize> {
        self.frames.get(..=frame)?.iter().rposition(|f| f.keyframe)
    }
}
