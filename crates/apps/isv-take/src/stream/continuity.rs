//! Whether packets of a stream follow each other without a gap.

use isv_format::{Packet, PacketHeader};

/// Follows the packets of a stream.
#[derive(Clone, Copy, Debug, Default)]
pub struct Continuity {
    /// Frames between the last packet and its keyframe, modulo 2^16.
    since_keyframe: Option<u16>,
}

impl Continuity {
    /// What is wrong with the next packet following the last one. What is missing before a keyframe does not show.
    pub fn check(&mut self, packet: &Packet) -> Option<&'static str> {
        let found = packet.header.since_keyframe;
        let last = self.since_keyframe.replace(found);
        let follows = packet.is_keyframe() || last.is_none_or(|last| last.wrapping_add(1) == found);
        (!follows).then_some("packets are missing or out of order")
    }
}

/// Whether a packet is the one before it once more. Keyframes of a stream whose times are all 0 may be alike.
#[must_use]
pub fn is_doubled(packet: &Packet, last: &PacketHeader) -> bool {
    packet.header == *last && (packet.header.timestamp_ns > 0 || !packet.is_keyframe())
}
