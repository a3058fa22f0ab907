//! Packets: one a frame, each whole in itself.

use crate::bytes::ByteReader;
use crate::metadata::{MOST_METADATA_BYTES, TYPE_METADATA};
use crate::{FormatError, FormatVersion, FrameKind, PayloadParts, Profile, StreamHeader};

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
        /// Whether a colour part follows the geometry in the payload.
        colour: bool,
    },
    /// The index: where the frames are. Comes last.
    Index,
    /// What the take is: see [`crate::MetadataText`]. Occurs in version 2.
    Metadata,
    /// A type that this build does not know, and may skip. Readers pass such packets over; they occur in version 2.
    Skippable {
        /// The type, at least 128: bit 7 says that it may be skipped.
        code: u8,
    },
}

impl PacketKind {
    /// Whether this is a frame.
    #[must_use]
    pub fn is_frame(self) -> bool {
        matches!(self, Self::Frame { .. })
    }
}

/// The 24 bytes before a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketHeader {
    /// What the payload is.
    pub kind: PacketKind,
    /// Frames since the last keyframe, modulo `2^16`; 0 for a keyframe and for an index. Tells when a packet is missing. Means nothing
    /// in other packets.
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
const FLAG_COLOUR: u8 = 4;
/// Bit of a type that readers may skip without knowing it.
const SKIPPABLE: u8 = 1 << 7;

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
            PacketKind::Frame { keyframe, hashed, colour } => {
                let flag = |is_set, flag| if is_set { flag } else { 0 };
                let flags = flag(keyframe, FLAG_KEYFRAME) | flag(hashed, FLAG_HASHED);
                (TYPE_FRAME, flags | flag(colour, FLAG_COLOUR))
            }
            PacketKind::Index => (TYPE_INDEX, 0),
            PacketKind::Metadata => (TYPE_METADATA, 0),
            PacketKind::Skippable { code } => (code, 0),
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

    /// Bytes of payload behind a header that begins at byte `at` of the stream. Nothing else can be relied on before the
    /// checksum, for which the payload is needed.
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
            return Err(FormatError::payload_above(payload_bytes.into(), MAX_PAYLOAD, at));
        }
        Ok(payload_bytes)
    }

    /// Parses a header that begins at byte `at` of a stream. The checksum waits for the payload.
    ///
    /// # Errors
    /// As [`Self::length`]; then an unknown type that may not be skipped, or a reserved bit set.
    pub fn parse(bytes: &[u8; Self::BYTES], at: u64, stream: &StreamHeader) -> Result<Self, FormatError> {
        let payload_bytes = Self::length(bytes, at)?;
        let mut fields = ByteReader::new(&bytes[MAGIC.len()..], at, "a packet header");
        let (code, flags, since_keyframe) = (fields.u8()?, fields.u8()?, fields.u16()?);
        let kind = Self::parse_kind(code, flags, at, stream)?;
        let counts = matches!(
            kind,
            PacketKind::Frame { keyframe: false, .. } | PacketKind::Metadata | PacketKind::Skippable { .. }
        );
        if since_keyframe != 0 && !counts {
            return Err(FormatError::malformed(at, "a keyframe or an index counts frames since a keyframe"));
        }
        fields.u32()?;
        Ok(Self { kind, since_keyframe, payload_bytes, timestamp_ns: fields.u64()?, checksum: fields.u32()? })
    }

    /// Type and flags. Those of colour and of unknown types depend on the stream's header.
    fn parse_kind(code: u8, flags: u8, at: u64, stream: &StreamHeader) -> Result<PacketKind, FormatError> {
        let colour_flag = if stream.colour_layers.is_some() { FLAG_COLOUR } else { 0 };
        let is_set = |flag| flags & flag != 0;
        match code {
            TYPE_FRAME if flags & !(FLAG_KEYFRAME | FLAG_HASHED | colour_flag) == 0 => {
                let (keyframe, hashed) = (is_set(FLAG_KEYFRAME), is_set(FLAG_HASHED));
                Ok(PacketKind::Frame { keyframe, hashed, colour: is_set(FLAG_COLOUR) })
            }
            TYPE_INDEX if flags == 0 => Ok(PacketKind::Index),
            _ if stream.version == FormatVersion::V1 || matches!(code, TYPE_FRAME | TYPE_INDEX) => {
                Err(FormatError::malformed(at, format!("packet type {code} with flags {flags:#x}")))
            }
            TYPE_METADATA => Ok(PacketKind::Metadata),
            _ if code & SKIPPABLE != 0 => Ok(PacketKind::Skippable { code }),
            _ => Err(FormatError::PacketType { found: code, at }),
        }
    }

    /// Whether a reader needs the payload of a packet with these bytes as header, for more than its checksum. They may be damaged.
    pub(crate) fn is_of_known_type(bytes: &[u8; Self::BYTES]) -> bool {
        matches!(bytes[MAGIC.len()], TYPE_FRAME | TYPE_INDEX)
    }

    /// Whether a packet with these bytes as header says that it holds metadata of a length that is kept. They may be damaged.
    pub(crate) fn is_of_metadata(bytes: &[u8; Self::BYTES], payload_bytes: u32) -> bool {
        bytes[MAGIC.len()] == TYPE_METADATA && payload_bytes as usize <= MOST_METADATA_BYTES
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
    /// Header of the packet.
    pub header: PacketHeader,
    /// Offset of the header in the stream (bytes).
    pub at: u64,
    /// Bytes behind the header, as many as it states.
    pub payload: Vec<u8>,
}

impl Packet {
    /// Whether this is a frame that can be decoded without any before it.
    #[must_use]
    pub fn is_keyframe(&self) -> bool {
        matches!(self.header.kind, PacketKind::Frame { keyframe: true, .. })
    }

    /// The parts of the payload: that of geometry alone, unless the frame has colour.
    ///
    /// # Errors
    /// A colour part that is longer than the payload.
    pub fn parts(&self) -> Result<PayloadParts<'_>, FormatError> {
        match self.header.kind {
            PacketKind::Frame { colour: true, .. } => PayloadParts::split(&self.payload, self.payload_at()),
            _ => Ok(PayloadParts { geometry: &self.payload, colour: None }),
        }
    }

    /// The geometry part of the payload: all of it, unless the frame has colour.
    ///
    /// # Errors
    /// As [`Self::parts`].
    pub fn geometry(&self) -> Result<&[u8], FormatError> {
        Ok(self.parts()?.geometry)
    }

    /// The colour part of the payload; `None` if the frame has no colour.
    ///
    /// # Errors
    /// As [`Self::parts`].
    pub fn colour(&self) -> Result<Option<&[u8]>, FormatError> {
        Ok(self.parts()?.colour)
    }

    /// Whether this is a frame whose symbols can be read without any before it: a keyframe, or a resilient frame of profile `main`.
    #[must_use]
    pub fn is_entry(&self, profile: &Profile) -> bool {
        let PacketKind::Frame { keyframe, .. } = self.header.kind else { return false };
        let first = self.geometry().ok().and_then(|geometry| geometry.first());
        keyframe || first.is_some_and(|code| FrameKind::of_payload_is_resilient(*code, profile))
    }

    /// Whether so many damaged bytes before this packet may have held its keyframe and all frames since. Then the count in its
    /// header says nothing about the frame before the damage, which it may fit by chance.
    #[must_use]
    pub fn may_lack_keyframe(&self, damaged: u64) -> bool {
        damaged >= u64::from(self.header.since_keyframe) * PacketHeader::BYTES as u64
    }

    /// Offset of the payload in the stream (bytes).
    #[must_use]
    pub fn payload_at(&self) -> u64 {
        self.at + PacketHeader::BYTES as u64
    }

    /// Header and payload as they stand in a stream.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        [&self.header.to_bytes()[..], &self.payload].concat()
    }

    /// Size (bytes) of header and geometry part: all of the packet if it has no colour.
    #[must_use]
    pub fn geometry_packet_bytes(&self) -> usize {
        // Nothing is made of a payload that cannot be split.
        PacketHeader::BYTES + self.geometry().map_or(0, <[u8]>::len)
    }

    /// Size of header and payload (bytes).
    #[must_use]
    pub fn total_bytes(&self) -> usize {
        PacketHeader::BYTES + self.payload.len()
    }
}
