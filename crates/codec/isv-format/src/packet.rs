//! Packets: one a frame, each whole in itself.

use crate::bytes::ByteReader;
use crate::{FormatError, FrameKind, Profile};

/// First bytes of a packet.
const MAGIC: [u8; 4] = *b"ISVP";
/// Largest payload of a packet. A frame of a million blocks is a few tens of megabytes.
pub const MAX_PAYLOAD: u32 = 1 << 30;

/// What a packet holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketKind {
    /// A frame.
    Frame {
        /// Whether the frame can be decoded without any before it.
        keyframe: bool,
        /// Whether the frame header carries a hash of the decoded volume.
        hashed: bool,
    },
    /// The index: where the frames are. Comes last.
    Index,
}

/// The 24 bytes before a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketHeader {
    /// What the payload is.
    pub kind: PacketKind,
    /// Frames since the last keyframe, modulo `2^16`; 0 for a keyframe and for an index. Tells when a packet is missing.
    pub since_keyframe: u16,
    /// Bytes of payload, at most [`MAX_PAYLOAD`].
    pub payload_bytes: u32,
    /// When the frame is shown, in nanoseconds; 0 for an index.
    pub timestamp_ns: u64,
    /// CRC-32 of the header's first 20 bytes and the payload.
    pub(crate) checksum: u32,
}

const TYPE_FRAME: u8 = 1;
const TYPE_INDEX: u8 = 2;
const FLAG_KEYFRAME: u8 = 1;
const FLAG_HASHED: u8 = 2;

impl PacketHeader {
    /// Size in bytes.
    pub const BYTES: usize = 24;

    /// First bytes of every header: what to look for where the place of the next packet is not known.
    pub const MAGIC: [u8; 4] = MAGIC;

    /// The [`Self::BYTES`] bytes of the header of a packet with this payload, with the checksum of both.
    ///
    /// # Panics
    /// If the payload is larger than [`MAX_PAYLOAD`].
    #[must_use]
    pub fn seal(
        kind: PacketKind,
        since_keyframe: u16,
        timestamp_ns: u64,
        payload: &[u8],
    ) -> [u8; Self::BYTES] {
        assert!(payload.len() <= MAX_PAYLOAD as usize, "packet of {} bytes", payload.len());
        let payload_bytes = payload.len() as u32;
        let mut header = Self { kind, since_keyframe, payload_bytes, timestamp_ns, checksum: 0 };
        header.checksum = checksum(&header.to_bytes()[..Self::BYTES - 4], payload);
        header.to_bytes()
    }

    /// The header as it stands in a stream.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let (code, flags) = match self.kind {
            PacketKind::Frame { keyframe, hashed } => {
                (TYPE_FRAME, (u8::from(keyframe) * FLAG_KEYFRAME) | (u8::from(hashed) * FLAG_HASHED))
            }
            PacketKind::Index => (TYPE_INDEX, 0),
        };
        let mut out = Vec::with_capacity(Self::BYTES);
        out.extend(MAGIC);
        out.extend([code, flags]);
        out.extend(self.since_keyframe.to_le_bytes());
        out.extend(self.payload_bytes.to_le_bytes());
        out.extend(self.timestamp_ns.to_le_bytes());
        out.extend(self.checksum.to_le_bytes());
        out.try_into().expect("the fields above fill the header")
    }

    /// Bytes of payload behind a header that begins at byte `at` of the stream: all that can be relied on before the checksum, for
    /// which the payload is needed.
    ///
    /// # Errors
    /// A wrong magic, or a payload above the limit.
    pub fn length(bytes: &[u8; Self::BYTES], at: u64) -> Result<u32, FormatError> {
        let mut fields = ByteReader::new(bytes, at, "a packet header");
        if fields.take(4)? != MAGIC {
            return Err(FormatError::malformed(at, "no packet begins where one should"));
        }
        fields.take(4)?;
        let payload_bytes = fields.u32()?;
        if payload_bytes > MAX_PAYLOAD {
            let (asked, allowed) = (u64::from(payload_bytes), u64::from(MAX_PAYLOAD));
            return Err(FormatError::LimitExceeded { at, what: "packet payload bytes", asked, allowed });
        }
        Ok(payload_bytes)
    }

    /// Parses a header that begins at byte `at` of the stream. The checksum waits for the payload.
    ///
    /// # Errors
    /// As [`Self::length`]; then an unknown type or a reserved bit set.
    pub fn parse(bytes: &[u8; Self::BYTES], at: u64) -> Result<Self, FormatError> {
        let payload_bytes = Self::length(bytes, at)?;
        let mut fields = ByteReader::new(&bytes[MAGIC.len()..], at, "a packet header");
        let (code, flags, since_keyframe) = (fields.u8()?, fields.u8()?, fields.u16()?);
        let kind = match code {
            TYPE_FRAME if flags & !(FLAG_KEYFRAME | FLAG_HASHED) == 0 => {
                PacketKind::Frame { keyframe: flags & FLAG_KEYFRAME != 0, hashed: flags & FLAG_HASHED != 0 }
            }
            TYPE_INDEX if flags == 0 => PacketKind::Index,
            _ => return Err(FormatError::malformed(at, format!("packet type {code} with flags {flags:#x}"))),
        };
        if since_keyframe != 0 && !matches!(kind, PacketKind::Frame { keyframe: false, .. }) {
            return Err(FormatError::malformed(at, "a keyframe or an index counts frames since a keyframe"));
        }
        fields.u32()?;
        Ok(Self { kind, since_keyframe, payload_bytes, timestamp_ns: fields.u64()?, checksum: fields.u32()? })
    }
}

/// CRC-32 (IEEE 802.3) of the fields before the checksum and the payload after it.
pub(crate) fn checksum(fields: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(fields);
    hasher.update(payload);
    hasher.finalize()
}

/// A whole packet, checksum verified.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Its header.
    pub header: PacketHeader,
    /// Where the header begins in the stream.
    pub at: u64,
    /// Its payload.
    pub payload: Vec<u8>,
}

impl Packet {
    /// Whether this is a frame that can be decoded without any before it.
    #[must_use]
    pub fn is_keyframe(&self) -> bool {
        matches!(self.header.kind, PacketKind::Frame { keyframe: true, .. })
    }

    /// Whether this is a frame whose symbols can be read without any before it: a keyframe, or a resilient frame of profile `main`.
    #[must_use]
    pub fn is_entry(&self, profile: &Profile) -> bool {
        let PacketKind::Frame { keyframe, .. } = self.header.kind else { return false };
        keyframe
            || self.payload.first().is_some_and(|code| FrameKind::of_payload_is_resilient(*code, profile))
    }

    /// Whether so many damaged bytes before this packet may have held its keyframe and all frames since: then the count in its header
    /// says nothing about the frame before the damage, which it may fit by chance.
    #[must_use]
    pub fn may_lack_keyframe(&self, damaged: u64) -> bool {
        damaged >= u64::from(self.header.since_keyframe) * PacketHeader::BYTES as u64
    }

    /// Where the payload begins in the stream.
    #[must_use]
    pub fn payload_at(&self) -> u64 {
        self.at + PacketHeader::BYTES as u64
    }

    /// Header and payload as they stand in a stream.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        [&self.header.to_bytes()[..], &self.payload].concat()
    }

    /// Size of header and payload (bytes).
    #[must_use]
    pub fn total_bytes(&self) -> usize {
        PacketHeader::BYTES + self.payload.len()
    }
}
