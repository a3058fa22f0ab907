//! Whether the frames of a stream follow each other: what the headers of their packets say.

use crate::{Packet, PacketHeader};

/// The place of a frame packet behind the one before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// No packet was before it, and it is no keyframe.
    First,
    /// A keyframe, which needs no frame before it. Frames that are missing before it do not show.
    Keyframe,
    /// The next frame.
    Next,
    /// Frames are missing in between.
    Gap {
        /// Number of frames missing, below 2^15.
        missing: u16,
    },
    /// A repetition of the last packet.
    Doubled,
    /// A frame from before the last one, or one of another GOP: counts wrap around at 2^16.
    Backward,
}

impl Link {
    /// Whether the packet is where a writer puts it: no other packet is known to belong before it.
    #[must_use]
    pub fn is_in_order(self) -> bool {
        matches!(self, Self::First | Self::Keyframe | Self::Next)
    }
}

/// The chain of a stream's frame packets, each of which counts the frames since its keyframe (`docs/spec/format.md`, section 6.1).
///
/// Decoders, repair and verification, concealment and servers all ask it whether a packet follows the last one.
#[derive(Clone, Copy, Debug, Default)]
pub struct PacketChain {
    last: Option<PacketHeader>,
}

impl PacketChain {
    /// The header of the last packet.
    #[must_use]
    pub fn last(&self) -> Option<&PacketHeader> {
        self.last.as_ref()
    }

    /// The count that the next frame of the GOP has; 0 before any packet.
    #[must_use]
    pub fn expected(&self) -> u16 {
        self.last.map_or(0, |last| last.since_keyframe.wrapping_add(1))
    }

    /// The place of a packet behind the last one.
    #[must_use]
    pub fn link(&self, packet: &Packet) -> Link {
        let Some(last) = &self.last else {
            return if packet.is_keyframe() { Link::Keyframe } else { Link::First };
        };
        // Keyframes of a stream whose times are all 0 may be alike.
        if packet.header == *last && (packet.header.timestamp_ns > 0 || !packet.is_keyframe()) {
            return Link::Doubled;
        }
        if packet.is_keyframe() {
            return Link::Keyframe;
        }
        match packet.header.since_keyframe.wrapping_sub(self.expected()) {
            0 => Link::Next,
            missing if missing < 1 << 15 => Link::Gap { missing },
            _ => Link::Backward,
        }
    }

    /// Adds a packet, and tells its place behind the last one.
    pub fn push(&mut self, packet: &Packet) -> Link {
        let link = self.link(packet);
        self.last = Some(packet.header);
        link
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PacketKind;

    fn packet(since_keyframe: u16, timestamp_ns: u64) -> Packet {
        let kind = PacketKind::Frame { keyframe: since_keyframe == 0, hashed: false, colour: false };
        let header = PacketHeader::seal(kind, since_keyframe, timestamp_ns, &[]);
        Packet {
            header: PacketHeader::parse(&header, 0, &crate::header::tests::header()).unwrap(),
            at: 0,
            payload: Vec::new(),
        }
    }

    /// The links of packets with these counts, each a nanosecond later.
    fn links(counts: &[u16]) -> Vec<Link> {
        let mut chain = PacketChain::default();
        (1..).zip(counts).map(|(time, count)| chain.push(&packet(*count, time))).collect()
    }

    #[test]
    fn counts_tell_what_is_missing_within_a_gop() {
        assert_eq!(links(&[0, 1, 2]), [Link::Keyframe, Link::Next, Link::Next]);
        assert_eq!(links(&[0, 3, 4]), [Link::Keyframe, Link::Gap { missing: 2 }, Link::Next]);
        assert_eq!(links(&[5, 6, 0]), [Link::First, Link::Next, Link::Keyframe]);
        assert_eq!(links(&[0, 4, 2]), [Link::Keyframe, Link::Gap { missing: 3 }, Link::Backward]);
        assert!(Link::First.is_in_order() && !Link::Backward.is_in_order());
    }

    #[test]
    fn counts_wrap_around_in_a_long_gop() {
        let mut chain = PacketChain::default();
        chain.push(&packet(u16::MAX, 1));
        let wrapped = |count: u16| {
            let kind = PacketKind::Frame { keyframe: false, hashed: false, colour: false };
            let header = PacketHeader::seal(kind, count, 2, &[]);
            Packet {
                header: PacketHeader::parse(&header, 0, &crate::header::tests::header()).unwrap(),
                at: 0,
                payload: Vec::new(),
            }
        };
        assert_eq!(chain.expected(), 0);
        assert_eq!(chain.link(&wrapped(0)), Link::Next);
        assert_eq!(chain.link(&wrapped(2)), Link::Gap { missing: 2 });
    }

    #[test]
    fn a_packet_may_come_twice() {
        let mut chain = PacketChain::default();
        chain.push(&packet(0, 7));
        assert_eq!(chain.push(&packet(0, 7)), Link::Doubled);
        chain.push(&packet(1, 0));
        assert_eq!(chain.push(&packet(1, 0)), Link::Doubled);
        chain.push(&packet(0, 0));
        assert_eq!(chain.push(&packet(0, 0)), Link::Keyframe, "all times are 0");
    }
}
