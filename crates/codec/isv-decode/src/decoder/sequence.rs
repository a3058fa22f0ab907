//! Position of a decoder in its stream.

use crate::DecodeError;
use isv_format::{Link, Packet, PacketChain};

/// Frames decoded so far, and since the last keyframe.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sequence {
    /// Packets of the frames decoded.
    chain: PacketChain,
    frames: u64,
    /// Bytes of the packets from the last keyframe on, refused ones too, without their colour parts.
    bytes: u64,
}

impl Sequence {
    /// Frames decoded so far.
    pub(crate) fn frames(self) -> u64 {
        self.frames
    }

    /// Counts a frame that was decoded.
    pub(crate) fn advance(&mut self, packet: &Packet) {
        self.bytes = self.gop_bytes(packet);
        self.frames += 1;
        self.chain.push(packet);
    }

    /// Counts a frame that was refused or is not wanted, whose bytes are there all the same. Without them, a decoder that begins
    /// between keyframes may have too few bytes for its first frame.
    pub(crate) fn pass_over(&mut self, packet: &Packet) {
        self.bytes = self.gop_bytes(packet);
    }

    /// Bytes of the packets from the last keyframe up to this one, without their colour parts: those make no blocks.
    pub(crate) fn gop_bytes(self, packet: &Packet) -> u64 {
        let before = if packet.is_keyframe() { 0 } else { self.bytes };
        before + packet.geometry_packet_bytes() as u64
    }

    /// What is wrong with the frame that is being decoded.
    pub(crate) fn malformed(self, packet: &Packet, what: &'static str) -> DecodeError {
        DecodeError::Malformed { frame: self.frames, at: packet.at, what }
    }

    /// Number of frames missing between the last one decoded and a packet of its GOP; 0 where the packet's count is before that
    /// one's.
    pub(crate) fn missing_before(self, packet: &Packet) -> u16 {
        match self.chain.link(packet) {
            Link::Gap { missing } => missing,
            _ => 0,
        }
    }

    /// Whether a frame that predicts follows the frame that it predicts from.
    pub(crate) fn check(self, packet: &Packet, has_reference: bool) -> Result<(), DecodeError> {
        if !has_reference {
            return Err(DecodeError::NoReference { at: packet.at });
        }
        match self.chain.link(packet) {
            Link::Next => Ok(()),
            _ => Err(DecodeError::MissingFrame {
                at: packet.at,
                expected: self.chain.expected(),
                found: packet.header.since_keyframe,
            }),
        }
    }
}
