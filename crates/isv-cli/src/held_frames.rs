//! What can be seen of a stream with losses: frames in time, and where one is lost, the last one.

use crate::backend::{self, BackendArgs};
use crate::frame_range::FrameRange;
use crate::memory;
use crate::output::say;
use crate::stats::timed;
use crate::stream::{self, ByteSource, StreamFrame};
use crate::timeline::seconds_between;
use anyhow::{Context, Result};
use isv::decode::{DecodeError, Lod};
use isv::format::{Packet, RefusalClass, SalvageReader, Salvaged, StreamHeader};
use isv::gpu::{AnyDecoder, AnyFrame};
use isv::surface::SurfaceOptions;
use std::path::Path;

/// A frame is never held in place of so many: ten seconds of the fastest cameras. A header may state a frame rate of thousands of millions.
const MOST_HELD: usize = 10_000;

/// How what is shown relates to what was encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Health {
    /// It is the same.
    Exact,
    /// Nothing was decoded, as packets are missing or what they hold is wrong: the last frame is held.
    Held,
    /// The same, as more is asked of this decoder than is allowed.
    BeyondLimit,
    /// It is near.
    Inexact,
}

/// Decodes what there is of a stream, in order. Each packet's time says which frame it is; frames that are not there or cannot be
/// decoded are the last one that could. Says on stderr where that begins and ends.
pub(crate) struct HeldFrames {
    name: String,
    header: StreamHeader,
    packets: SalvageReader<ByteSource>,
    decoder: AnyDecoder,
    range: Option<FrameRange>,
    health: Health,
    /// The last packet's time in nanoseconds.
    last_ns: Option<u64>,
    /// The last frame that could be decoded.
    last: Option<AnyFrame>,
    /// Number of the next frame to give.
    next: usize,
    /// Number of the frame that the packet at hand is, and what was decoded of it, if anything, in how many milliseconds.
    at_hand: Option<(usize, Option<(AnyFrame, f64)>)>,
}

impl HeldFrames {
    /// Opens a stream, to be decoded from its start at a level of detail by a backend.
    pub(crate) fn open(
        path: &Path,
        range: Option<FrameRange>,
        lod: Lod,
        backend: BackendArgs,
    ) -> Result<Self> {
        let name = stream::name(path);
        let packets = SalvageReader::new(stream::source(path)?).with_context(|| name.clone())?;
        let packets = packets.with_largest_payload(memory::largest_payload());
        let header = *packets.header();
        let mut decoder = backend.decoder(&header, lod).with_context(|| name.clone())?;
        decoder.recover(true);
        Ok(Self {
            name,
            header,
            packets,
            decoder,
            range,
            health: Health::Exact,
            last_ns: None,
            last: None,
            next: 0,
            at_hand: None,
        })
    }

    /// The header of the stream.
    pub(crate) fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// The frames with their surfaces, where they are decoded on a GPU.
    pub(crate) fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self> {
        self.decoder = self.decoder.with_surfaces(options)?;
        Ok(self)
    }

    fn advance(&mut self) -> Result<Option<StreamFrame>> {
        loop {
            if self.range.is_some_and(|range| self.next >= range.end) {
                return Ok(None);
            }
            let Some((number, _)) = self.at_hand else {
                let Some(packet) = self.next_packet()? else { return Ok(None) };
                self.take(&packet)?;
                continue;
            };
            let frame = if self.next < number {
                self.last.clone().map(|frame| (frame, 0.0))
            } else {
                let (_, decoded) = self.at_hand.take().expect("it is at hand");
                if let Some((frame, _)) = &decoded {
                    self.last = Some(frame.clone());
                }
                decoded.or_else(|| self.last.clone().map(|frame| (frame, 0.0)))
            };
            let number = self.next;
            self.next += 1;
            if let Some((AnyFrame { volume, surface, .. }, decode_ms)) = frame
                && self.range.is_none_or(|range| number >= range.start)
            {
                let timestamp_ns = self.header.frame_rate.timestamp_ns(number as u64);
                return Ok(Some(StreamFrame { number, timestamp_ns, volume, surface, decode_ms }));
            }
        }
    }

    /// The next packet that is sound.
    fn next_packet(&mut self) -> Result<Option<Packet>> {
        let mut damaged = 0;
        loop {
            match self.packets.next_frame().with_context(|| self.name.clone())? {
                Some(Salvaged::Damage { at, bytes }) => {
                    say(format_args!("{}: {bytes} bytes are damaged from byte {at} on", self.name));
                    damaged += bytes;
                }
                Some(Salvaged::OtherStream { at }) => {
                    say(format_args!("{}: another stream begins at byte {at} and is left out", self.name));
                }
                Some(Salvaged::Frame(packet)) => {
                    if damaged > 0 && packet.may_lack_keyframe(damaged) {
                        self.decoder.lose_packet();
                    }
                    return Ok(Some(packet));
                }
                None => return Ok(None),
            }
        }
    }

    /// Decodes a packet, if that can be done.
    fn take(&mut self, packet: &Packet) -> Result<()> {
        let now_ns = packet.header.timestamp_ns;
        let missing = match self.last_ns {
            Some(last_ns) => self.frames_between(last_ns, now_ns).saturating_sub(1),
            // Streams begin at time 0.
            None => self.frames_between(0, now_ns),
        };
        if missing > 0 {
            self.is_now(Health::Held, self.next, "packets are missing");
        }
        let number = self.next + missing;
        self.last_ns = Some(now_ns);
        let (decoded, decode_ms) = timed(|| self.decoder.decode(packet));
        if let Some(why) = self.decoder.take_notice() {
            backend::notify(&why);
        }
        let decoded = match decoded {
            Ok(frame) => {
                let health = if frame.inexact_blocks == 0 { Health::Exact } else { Health::Inexact };
                self.is_now(health, number, "");
                Some((frame, decode_ms))
            }
            // Not the stream's fault.
            Err(DecodeError::Backend(error)) => {
                return Err(stream::fault(&self.name, 0, error.into()));
            }
            Err(error) => {
                let health = match error.class() {
                    Some(RefusalClass::Limit) => Health::BeyondLimit,
                    _ => Health::Held,
                };
                self.is_now(health, number, &error.to_string());
                None
            }
        };
        self.at_hand = Some((number, decoded));
        Ok(())
    }

    /// How many frames long the time between two packets is; 0 if that is no time to hold a frame for.
    fn frames_between(&self, last_ns: u64, now_ns: u64) -> usize {
        let rate = self.header.frame_rate;
        let seconds = seconds_between(rate, last_ns, now_ns).unwrap_or(0.0);
        let frames = (seconds * rate.per_second()).round() as usize;
        if frames > MOST_HELD { 0 } else { frames }
    }

    /// Says so where it changes.
    fn is_now(&mut self, health: Health, frame: usize, why: &str) {
        if std::mem::replace(&mut self.health, health) != health {
            let name = &self.name;
            match health {
                Health::Exact => say(format_args!("{name}: exact again from frame {frame} on")),
                Health::Held | Health::BeyondLimit => {
                    say(format_args!("{name}: frame {frame} is lost, the last one is held: {why}"));
                }
                Health::Inexact => say(format_args!("{name}: near what was encoded from frame {frame} on")),
            }
        }
    }
}

impl Iterator for HeldFrames {
    type Item = Result<StreamFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().transpose()
    }
}
