//! What happens during a job that its caller may want to know.

use crate::DeviceError;
use std::fmt;

#[cfg(feature = "io")]
use crate::decode::DecodeEvent;
#[cfg(feature = "encode")]
use crate::encode::EncodeEvent;

/// A thing that happened, or was decided. Its text is a sentence for people.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event {
    /// The CPU does what a GPU was to do, and why.
    FellBack(DeviceError),
    /// The CPU does what no GPU does; what.
    OnCpu(&'static str),
    /// A stream ends without its index.
    Cut {
        /// Name of the stream.
        name: String,
    },
    /// Bytes follow the end of a stream.
    BytesBehindEnd {
        /// Name of the stream.
        name: String,
        /// Number of bytes.
        bytes: u64,
    },
    /// Bytes of a stream are damaged.
    Damage {
        /// Name of the stream.
        name: String,
        /// Place of the first one, in bytes from the stream's start.
        at: u64,
        /// Number of bytes.
        bytes: u64,
    },
    /// Another stream begins inside a stream.
    OtherStream {
        /// Name of the stream.
        name: String,
        /// Place of the other stream, in bytes from the stream's start.
        at: u64,
    },
    /// Packets of a stream are missing, doubled or out of order before one of them.
    Gap {
        /// Name of the stream.
        name: String,
        /// Number of the packet's frame, if it is known.
        frame: Option<usize>,
        /// Place of the packet, in bytes from the stream's start.
        at: u64,
    },
    /// Packets of a stream are left out of a copy: this build does not know their types.
    LeftOut {
        /// Name of the stream.
        name: String,
        /// Number of packets.
        packets: usize,
    },
    /// Sound or picture beside a stream ends earlier or later than its geometry.
    #[cfg(feature = "io")]
    OtherEnd {
        /// Name of the stream.
        name: String,
        /// Both ends.
        end: isv_mp4::OtherEnd,
    },
    /// The bytes behind the last sound frame of a stream cannot be read.
    EndsInDamage {
        /// Name of the stream.
        name: String,
        /// Cause of the failure.
        why: String,
    },
    /// Decoded frames relate to what was encoded in another way than before.
    Health {
        /// Name of the stream.
        name: String,
        /// Number of the first frame.
        frame: usize,
        /// The relation.
        health: Health,
        /// Why, if that is not plain.
        why: String,
    },
    /// Something about decoding to files.
    #[cfg(feature = "io")]
    Decode(DecodeEvent),
    /// Something about encoding.
    #[cfg(feature = "encode")]
    Encode(EncodeEvent),
}

/// How a frame that is shown relates to what was encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// It is the same.
    Exact,
    /// Nothing was decoded, as packets are missing or what they hold is wrong: the last frame is held.
    Held,
    /// The last frame is held, as more is asked of the decoder than is allowed.
    BeyondLimit,
    /// It is near.
    Inexact,
}

/// Observer of events, which come from any thread.
pub trait Observer: Send + Sync {
    /// Takes note of an event.
    fn event(&self, event: &Event);
}

impl<F: Fn(&Event) + Send + Sync> Observer for F {
    fn event(&self, event: &Event) {
        self(event);
    }
}

impl Event {
    /// Whether the result may not be what its user wants.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        match self {
            Self::FellBack(_)
            | Self::Cut { .. }
            | Self::BytesBehindEnd { .. }
            | Self::Damage { .. }
            | Self::OtherStream { .. }
            | Self::Gap { .. }
            | Self::LeftOut { .. }
            | Self::EndsInDamage { .. } => true,
            Self::OnCpu(_) => false,
            #[cfg(feature = "io")]
            Self::OtherEnd { .. } => true,
            Self::Health { health, .. } => *health != Health::Exact,
            #[cfg(feature = "io")]
            Self::Decode(_) => true,
            #[cfg(feature = "encode")]
            Self::Encode(event) => event.is_warning(),
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FellBack(why) => write!(f, "{why}: working on the CPU"),
            Self::OnCpu(what) => write!(f, "{what} on the CPU"),
            Self::Cut { name } => {
                write!(f, "{name}: ends without an index: it may have been cut after its last whole frame")
            }
            Self::BytesBehindEnd { name, bytes } => {
                write!(f, "{name}: {bytes} bytes follow the end of the stream and are left out")
            }
            Self::Damage { name, at, bytes } => {
                write!(f, "{name}: {bytes} bytes are damaged from byte {at} on")
            }
            Self::OtherStream { name, at } => {
                write!(f, "{name}: another stream begins at byte {at} and is left out")
            }
            Self::Gap { name, frame, at } => {
                write!(f, "{name}: packets are missing or out of order ")?;
                match frame {
                    Some(frame) => write!(f, "before frame {frame}"),
                    None => write!(f, "at byte {at}"),
                }
            }
            Self::LeftOut { name, packets } => write!(f, "{name}: {}", left_out_in_words(*packets)),
            #[cfg(feature = "io")]
            Self::OtherEnd { name, end } => write!(f, "{name}: {}", end_in_words(end)),
            Self::EndsInDamage { name, why } => write!(f, "{name}: {why}: what is before that was copied"),
            Self::Health { name, frame, health, why } => match health {
                Health::Exact => write!(f, "{name}: exact again from frame {frame} on"),
                Health::Held | Health::BeyondLimit => {
                    write!(f, "{name}: frame {frame} is lost, the last one is held: {why}")
                }
                Health::Inexact => write!(f, "{name}: near what was encoded from frame {frame} on"),
            },
            #[cfg(feature = "io")]
            Self::Decode(event) => event.fmt(f),
            #[cfg(feature = "encode")]
            Self::Encode(event) => event.fmt(f),
        }
    }
}

/// How a track ends beside geometry, and what players make of it.
#[cfg(feature = "io")]
fn end_in_words(end: &isv_mp4::OtherEnd) -> String {
    let longer_s = end.longer_s();
    let (how, then) = match longer_s > 0.0 {
        true => ("longer", "the player stops with the geometry"),
        false => ("shorter", "the take goes on without it"),
    };
    let (kind, track, by_s) = (end.kind.name(), end.track, longer_s.abs());
    let (end_s, geometry_s) = (end.end_s, end.geometry_s);
    format!(
        "the {kind} of track {track} is {by_s:.2} s {how} than the geometry ({end_s:.2} s beside {geometry_s:.2} s): {then}"
    )
}

/// Packets of unknown types that a copy does not have, in words.
#[must_use]
pub fn left_out_in_words(packets: usize) -> String {
    match packets {
        1 => "1 packet of a type that only a newer isv knows is left out".to_owned(),
        _ => format!("{packets} packets of types that only a newer isv knows are left out"),
    }
}
