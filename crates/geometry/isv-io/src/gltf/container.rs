//! The GLB container: a header of 12 bytes, a chunk of JSON, and a chunk of bytes for the first buffer.

use super::fault::GltfFault;
use crate::error::Flaw;

/// First bytes of a binary file.
pub(super) const MAGIC: &[u8; 4] = b"glTF";
pub(super) const VERSION: u32 = 2;
pub(super) const JSON_CHUNK: &[u8; 4] = b"JSON";
pub(super) const BIN_CHUNK: &[u8; 4] = b"BIN\0";
/// Bytes of the magic, the version and the length of the file.
pub(super) const HEADER_BYTES: usize = 12;
/// Bytes of a chunk's length and type.
pub(super) const CHUNK_HEADER_BYTES: usize = 8;

/// The parts of a glTF file.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    /// Start of the JSON in the file.
    pub(super) json_offset: usize,
    /// The bytes of the buffer without an address.
    pub(super) binary: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Takes a file apart. What comes after the second chunk is for extensions, and ignored.
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let flaw = |at, fault: GltfFault| Flaw::at_byte(at, fault.into());
        let Some(header) = bytes.strip_prefix(MAGIC) else {
            return match bytes.trim_ascii_start().first() {
                Some(b'{') => Ok(Self { json: bytes, json_offset: 0, binary: None }),
                _ => Err(flaw(0, GltfFault::NotGltf)),
            };
        };
        let word = |at: usize| header.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word));
        let cut = |part, promised| flaw(bytes.len(), truncated(part, promised, bytes.len()));
        let (Some(version), Some(length)) = (word(0), word(4)) else {
            return Err(cut("header", HEADER_BYTES));
        };
        if version != VERSION {
            return Err(flaw(MAGIC.len(), GltfFault::Version { version }));
        }
        let file = bytes.get(HEADER_BYTES..length as usize).ok_or_else(|| cut("file", length as usize))?;
        let mut chunks = Chunks { rest: file, at: HEADER_BYTES };
        let json = chunks.next()?.filter(|chunk| chunk.kind == *JSON_CHUNK);
        let json = json.ok_or(flaw(HEADER_BYTES, GltfFault::NoJsonChunk))?.bytes;
        let binary = chunks.next()?.filter(|chunk| chunk.kind == *BIN_CHUNK).map(|chunk| chunk.bytes);
        Ok(Self { json, json_offset: HEADER_BYTES + CHUNK_HEADER_BYTES, binary })
    }
}

fn truncated(part: &'static str, promised: usize, found: usize) -> GltfFault {
    GltfFault::Truncated { part, promised: promised as u64, found: found as u64 }
}

struct Chunk<'a> {
    kind: [u8; 4],
    bytes: &'a [u8],
}

struct Chunks<'a> {
    rest: &'a [u8],
    /// Start of `rest` in the file.
    at: usize,
}

impl<'a> Chunks<'a> {
    /// The next chunk; `None` at the end of the file.
    fn next(&mut self) -> Result<Option<Chunk<'a>>, Flaw> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        let cut = |part, promised, found| Flaw::at_byte(self.at, truncated(part, promised, found).into());
        let Some((header, rest)) = self.rest.split_first_chunk::<CHUNK_HEADER_BYTES>() else {
            return Err(cut("chunk header", CHUNK_HEADER_BYTES, self.rest.len()));
        };
        let [a, b, c, d, kind @ ..] = *header;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        let Some((bytes, rest)) = rest.split_at_checked(length) else {
            return Err(cut("chunk", length, rest.len()));
        };
        self.at += CHUNK_HEADER_BYTES + length;
        self.rest = rest;
        Ok(Some(Chunk { kind, bytes }))
    }
}
