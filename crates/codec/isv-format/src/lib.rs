//! The `.isv` container: syntax only, no coding. `docs/spec/format.md`, sections 5 and 6, is the normative description.
//!
//! ```text
//! stream = StreamHeader, packet ..., [index packet, trailer]
//! packet = PacketHeader (length, type, keyframe flag, timestamp, checksum), payload
//! metadata payload = JSON, before the first frame
//! frame payload = geometry part, [colour part and its length]
//! geometry part = FrameHeader, block-set segment, mask segment, then a segment of modes and one of coefficients a slice
//! ```
//!
//! Everything can be written to a pipe and read from one: no field is patched afterwards and nothing needs the index. The index
//! only saves a reader that can seek from walking the packets.

mod bytes;
mod chain;
mod colour;
mod colour_layers;
mod error;
mod frame;
mod frame_rate;
mod header;
mod index;
mod mask_coding;
mod metadata;
mod packet;
mod payload_parts;
mod reader;
mod refusal;
mod resynchroniser;
mod salvage;
mod version;
mod writer;

pub use chain::{Link, PacketChain};
pub use colour::{ColourHeader, ColourKind, ColourPayload};
pub use colour_layers::ColourLayers;
pub use error::FormatError;
pub use frame::{
    FrameCoding, FrameHeader, FrameKind, FramePayload, MainFrameHeader, Prediction, SliceLayout, SlicePayload,
};
pub use frame_rate::{FrameRate, ParseFrameRateError};
pub use header::{MAGIC, PaperParameters, Profile, StreamHeader};
pub use index::{IndexEntry, StreamIndex};
pub use mask_coding::MaskCoding;
pub use metadata::{MOST_METADATA_BYTES, MetadataText};
pub use packet::{MAX_PAYLOAD, Packet, PacketHeader, PacketKind};
pub use payload_parts::PayloadParts;
pub use reader::PacketReader;
pub use refusal::RefusalClass;
pub use resynchroniser::{Piece, Resynchroniser};
pub use salvage::{SalvageReader, Salvaged};
pub use version::FormatVersion;
pub use writer::PacketWriter;
