//! Where in its stream a decoder is.

use crate::DecodeError;
use isv_format::Packet;

/// Frames decoded so far, and since the last keyframe.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sequence {
    /// Frames between the last keyframe and the reference, modulo `2^16`.
    since_keyframe: u16,
    frames: u64,
    /// Bytes of the packets from the last keyframe on, refused ones too.
    bytes: u64,
}

impl Sequence {
    /// Frames decoded so far.
    pub(super) fn frames(self) -> u64 {
        self.frames
    }

    /// Counts a frame that was decoded.
    pub(super) fn advance(&mut self, packet: &Packet) {
        self.bytes = self.gop_bytes(packet);
        self.frames += 1;
        self.since_keyframe = packet.header.since_keyframe;
    }

    /// Counts a frame that was refused or is not wanted, whose bytes are there all the same: who begins between keyframes may have too
    /// few for the first frame.
    pub(super) fn pass_over(&mut self, packet: &Packet) {
        self.bytes = self.gop_bytes(packet);
    }

    /// Bytes of the packets from the last keyframe up to this one.
    pub(super) fn gop_bytes(self, packet: &Packet) -> u64 {
        let before = if packet.is_keyframe() { 0 } else { self.bytes };
        before + packet.total_bytes() as u64
    }

    /// What is wrong with the frame that is being decoded.
    pub(super) fn malformed(self, packet: &Packet, what: &'static str) -> DecodeError {
        DecodeError::Malformed { frame: self.frames, at: packet.at, what }
    }

    /// How many frames are missing between the last one decoded and a packet of its GOP; 0 where the packet's count is before that
    /// one's: another GOP's, as counts wrap around.
    pub(super) fn missing_before(self, packet: &Packet) -> u16 {
        let missing = packet.header.since_keyframe.wrapping_sub(self.since_keyframe).wrapping_sub(1);
        if missing < 1 << 15 { missing } else { 0 }
    }

    /// Whether a frame that predicts follows the frame that it predicts from.
    pub(super) fn check(self, packet: &Packet, has_reference: bool) -> Result<(), DecodeError> {
        if !has_reference {
            return Err(DecodeError::NoReference { at: packet.at });
        }
        let (expected, found) = (self.since_keyframe.wrapping_add(1), packet.header.since_keyframe);
        if expected != found {
            return Err(DecodeError::MissingFrame { at: packet.at, expected, found });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_format::{PacketHeader, PacketKind};

    #[test]
    fn counts_wrap_around_in_a_long_gop() {
        let packet = |since_keyframe| {
            let kind = PacketKind::Frame { keyframe: false, hashed: false };
            let header = PacketHeader::seal(kind, since_keyframe, 0, &[]);
            Packet { header: PacketHeader::parse(&header, 0).unwrap(), at: 0, payload: Vec::new() }
        };
        let mut sequence = Sequence::default();
        sequence.advance(&packet(u16::MAX));
        sequence.check(&packet(0), true).unwrap();
        assert_eq!(sequence.missing_before(&packet(0)), 0);
        let missing = sequence.check(&packet(2), true);
        assert!(matches!(missing, Err(DecodeError::MissingFrame { expected: 0, found: 2, .. })));
        assert_eq!(sequence.missing_before(&packet(2)), 2);
    }
}
