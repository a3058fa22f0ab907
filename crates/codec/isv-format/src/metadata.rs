//! The metadata packet: what a take is, as JSON, for people and programs. Decoding needs nothing of it.

use crate::packet::{PacketHeader, PacketKind};

/// Type of the packet. Readers that do not know it pass it over.
pub(crate) const TYPE_METADATA: u8 = 128;
/// Most bytes of the text. A longer one is passed over.
pub const MOST_METADATA_BYTES: usize = 1 << 16;

/// The text of a metadata packet: a JSON object in UTF-8. Its keys are in section 6.8 of the specification.
///
/// A reader keeps the first one that a stream has before its first frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetadataText(String);

impl MetadataText {
    /// Takes a text; `None` if it is longer than 65,536 bytes.
    #[must_use]
    pub fn new(text: String) -> Option<Self> {
        (text.len() <= MOST_METADATA_BYTES).then_some(Self(text))
    }

    /// Takes a payload; `None` if it is too long or not UTF-8.
    #[must_use]
    pub fn from_payload(payload: Vec<u8>) -> Option<Self> {
        String::from_utf8(payload).ok().and_then(Self::new)
    }

    /// The packet that holds it, header and payload.
    #[must_use]
    pub fn to_packet(&self) -> Vec<u8> {
        let payload = self.0.as_bytes();
        [&PacketHeader::seal(PacketKind::Metadata, 0, 0, payload)[..], payload].concat()
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}
