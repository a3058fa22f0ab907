//! The `.isv` container: syntax only, no coding. `docs/spec/format.md`, sections 5 and 6, is the normative description.
//!
//! ```text
//! stream = StreamHeader, packet ..., [index packet, trailer]
//! packet = PacketHeader (length, type, keyframe flag, timestamp, checksum), payload
//! frame payload = FrameHeader, block-set segment, mask segment, then a segment of modes and one of coefficients a slice
//! ```
//!
//! Everything can be written to a pipe and read from one: no field is patched afterwards and nothing needs the index,
//! which only saves a reader that can seek from walking the packets.

mod bytes;
mod chain;
mod colour;
mod error;
mod frame;
mod frame_rate;
mod header;
mod index;
mod packet;
mod reader;
mod refusal;
mod resynchroniser;
mod salvage;
mod writer;

pub use chain::{Link, PacketChain};
pub use colour::{ColourHeader, ColourKind, ColourPayload};
pub use error::FormatError;
pub use frame::{
    FrameCoding, FrameHeader, FrameKind, FramePayload, MainFrameHeader, Prediction, SliceLayout, SlicePayload,
};
pub use frame_rate::{FrameRate, ParseFrameRateError};
pub use header::{FORMAT_VERSION, MAGIC, PaperParameters, Profile, StreamHeader};
pub use index::{IndexEntry, StreamIndex};
pub use packet::{MAX_PAYLOAD, Packet, PacketHeader, PacketKind};
pub use reader::PacketReader;
pub use refusal::RefusalClass;
pub use resynchroniser::{Piece, Resynchroniser};
pub use salvage::{SalvageReader, Salvaged};
pub use writer::PacketWriter;
