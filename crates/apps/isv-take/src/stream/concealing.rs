//! What can be seen of a stream with losses: frames in time, and where one is lost, the last one.

use super::{ByteSource, DecodeSettings, StreamError, StreamFault, StreamFrame, source, timed};
use crate::device::{Decoded, StreamDecoder};
use crate::timeline::{is_on_time, seconds_between};
use crate::{Event, FrameRange, Health, Input, Observer};
use isv_decode::DecodeError;
use isv_format::{Link, Packet, PacketChain, RefusalClass, SalvageReader, Salvaged, StreamHeader};
use isv_surface::SurfaceOptions;
use std::sync::Arc;

/// A frame is never held in place of so many: ten seconds of the fastest cameras. A header may state a frame rate of thousands of millions.
const MOST_HELD: usize = 10_000;

/// Decodes what there is of a stream, in order. Each packet's count and time say which frame it is; frames that are not there or cannot be
/// decoded are the last one that could. The observer is told where that begins and ends.
pub struct ConcealingFrames {
    name: String,
    header: StreamHeader,
    packets: SalvageReader<ByteSource>,
    decoder: StreamDecoder,
    observer: Arc<dyn Observer>,
    range: Option<FrameRange>,
    health: Health,
    /// Packets that were in their places.
    chain: PacketChain,
    /// The last frame that could be decoded.
    last: Option<Decoded>,
    /// When the last frame that was given is shown.
    shown_ns: u64,
    /// Number of the next frame to give.
    next: usize,
    at_hand: Option<AtHand>,
    /// Whether bytes were met that are no packet.
    is_damaged: bool,
}

/// The next frame of which there is a packet, or the last one that should be there.
struct AtHand {
    number: usize,
    /// Time stamp of the packet, if there is one.
    timestamp_ns: Option<u64>,
    /// What was decoded of it, if anything, in how many milliseconds.
    decoded: Option<(Decoded, f64)>,
}

impl ConcealingFrames {
    /// Opens a stream, to be decoded from its start.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn open(input: &Input, settings: &DecodeSettings) -> Result<Self, StreamError> {
        Self::from_source(&input.name(), source(input)?, settings)
    }

    /// Reads a stream from bytes as they come; `name` is theirs in messages.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn from_source(
        name: &str,
        source: ByteSource,
        settings: &DecodeSettings,
    ) -> Result<Self, StreamError> {
        let DecodeSettings { frames: range, lod, colour, device, memory, observer } = settings;
        let name = name.to_owned();
        let packets = SalvageReader::new(source);
        let packets = packets.map_err(|error| StreamFault::from(error).in_stream(&name))?;
        let packets = packets.with_largest_payload(memory.largest_payload());
        let header = *packets.header();
        let decoder = device.decoder(&header, memory.decoder_limits(), *lod, *colour, observer);
        let mut decoder = decoder.map_err(|fault| fault.in_stream(&name))?;
        decoder.recover(true);
        Ok(Self {
            name,
            header,
            packets,
            decoder,
            observer: Arc::clone(observer),
            range: *range,
            health: Health::Exact,
            chain: PacketChain::default(),
            last: None,
            shown_ns: 0,
            next: 0,
            at_hand: None,
            is_damaged: false,
        })
    }

    /// The header of the stream.
    #[must_use]
    pub fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// The frames with their surfaces, where they are decoded on a GPU.
    ///
    /// # Errors
    /// [`StreamError`] if the GPU fails.
    pub fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self, StreamError> {
        self.decoder = self
            .decoder
            .with_surfaces(options)
            .map_err(|error| StreamFault::from(error).in_stream(&self.name))?;
        Ok(self)
    }

    fn advance(&mut self) -> Result<Option<StreamFrame>, StreamFault> {
        loop {
            if self.range.is_some_and(|range| self.next >= range.end) {
                return Ok(None);
            }
            let Some(AtHand { number, .. }) = self.at_hand else {
                match self.next_packet()? {
                    Some(packet) => self.take(&packet)?,
                    None => {
                        self.end()?;
                        if self.at_hand.is_none() {
                            return Ok(None);
                        }
                    }
                }
                continue;
            };
            let a_frame_later = self.shown_ns.saturating_add(self.header.frame_rate.timestamp_ns(1));
            let frame = if self.next < number {
                self.shown_ns = a_frame_later;
                self.last.clone().map(|frame| (frame, 0.0))
            } else {
                let AtHand { timestamp_ns, decoded, .. } = self.at_hand.take().expect("it is at hand");
                self.shown_ns = timestamp_ns.unwrap_or(a_frame_later);
                if let Some((frame, _)) = &decoded {
                    self.last = Some(frame.clone());
                }
                decoded.or_else(|| self.last.clone().map(|frame| (frame, 0.0)))
            };
            let number = self.next;
            self.next += 1;
            if let Some((Decoded { volume, coded_blocks, surface, colour, .. }, decode_ms)) = frame
                && self.range.is_none_or(|range| number >= range.start)
            {
                let timestamp_ns = self.shown_ns;
                return Ok(Some(StreamFrame {
                    number,
                    timestamp_ns,
                    volume,
                    coded_blocks,
                    surface,
                    colour,
                    decode_ms,
                }));
            }
        }
    }

    /// The next packet that is sound.
    fn next_packet(&mut self) -> Result<Option<Packet>, StreamFault> {
        let mut damaged = 0;
        loop {
            match self.packets.next_frame()? {
                Some(Salvaged::Damage { at, bytes }) => {
                    self.observer.event(&Event::Damage { name: self.name.clone(), at, bytes });
                    self.is_damaged = true;
                    damaged += bytes;
                }
                Some(Salvaged::OtherStream { at }) => {
                    self.observer.event(&Event::OtherStream { name: self.name.clone(), at });
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

    /// Decodes a packet, if that can be done and it is not one of a frame that was given already.
    fn take(&mut self, packet: &Packet) -> Result<(), StreamFault> {
        let Some(missing) = self.missing_before(packet) else { return Ok(()) };
        if missing > 0 {
            self.is_now(Health::Held, self.next, "no packet is there for it");
        }
        let number = self.next + missing;
        self.chain.push(packet);
        let (decoded, decode_ms) = timed(|| self.decoder.decode(packet));
        let decoded = match decoded {
            Ok(frame) => {
                let health = if frame.inexact_blocks == 0 { Health::Exact } else { Health::Inexact };
                self.is_now(health, number, "");
                Some((frame, decode_ms))
            }
            // Not the stream's fault.
            Err(DecodeError::Backend(error)) => {
                return Err(DecodeError::Backend(error).into());
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
        self.at_hand = Some(AtHand { number, timestamp_ns: Some(packet.header.timestamp_ns), decoded });
        Ok(())
    }

    /// Number of frames missing before a packet; nothing if it comes twice or too late. Times say so if
    /// frames come at the stream's rate. Those of a clock do not come so evenly. The counts within a GOP tell
    /// then, and what is missing before a keyframe is not known.
    fn missing_before(&self, packet: &Packet) -> Option<usize> {
        let (rate, now_ns) = (self.header.frame_rate, packet.header.timestamp_ns);
        let link = self.chain.link(packet);
        let Some(last) = self.chain.last() else {
            // Streams begin at time 0 and with a keyframe. One of a part of a take, or one that was repaired, begins with one later.
            let has_lost = (self.is_damaged || link != Link::Keyframe) && is_on_time(rate, now_ns);
            return Some(if has_lost { self.frames_between(0, now_ns) } else { 0 });
        };
        let last_ns = last.timestamp_ns;
        let on_time = is_on_time(rate, last_ns) && is_on_time(rate, now_ns);
        // At time 0 another take begins.
        let is_late = now_ns > 0 && seconds_between(rate, now_ns, last_ns).is_some_and(|late| late > 0.0);
        if link == Link::Doubled || is_late && (on_time || !link.is_in_order()) {
            return None;
        }
        let missing = match link {
            _ if on_time && now_ns > last_ns => self.frames_between(last_ns, now_ns).saturating_sub(1),
            Link::Gap { missing } if usize::from(missing) < MOST_HELD => usize::from(missing),
            _ => 0,
        };
        Some(missing)
    }

    /// How many frames long the time between two packets is; 0 if that is no time to hold a frame for.
    fn frames_between(&self, last_ns: u64, now_ns: u64) -> usize {
        let rate = self.header.frame_rate;
        let seconds = seconds_between(rate, last_ns, now_ns).unwrap_or(0.0);
        let frames = (seconds * rate.per_second()).round() as usize;
        if frames > MOST_HELD { 0 } else { frames }
    }

    /// At the end of the packets: frames that the stream had by its index and that have not come are the last one, too. Then there may be
    /// too few for the range.
    fn end(&mut self) -> Result<(), StreamFault> {
        let there = self.packets.indexed_frames().unwrap_or(0);
        if self.next < there && there - self.next <= MOST_HELD && self.last.is_some() {
            self.is_now(Health::Held, self.next, "no packet is there for it");
            self.at_hand = Some(AtHand { number: there - 1, timestamp_ns: None, decoded: None });
            return Ok(());
        }
        self.range.map_or(Ok(0..0), |range| range.within(self.next))?;
        Ok(())
    }

    /// Tells the observer where it changes.
    fn is_now(&mut self, health: Health, frame: usize, why: &str) {
        if std::mem::replace(&mut self.health, health) != health {
            let (name, why) = (self.name.clone(), why.to_owned());
            self.observer.event(&Event::Health { name, frame, health, why });
        }
    }
}

impl Iterator for ConcealingFrames {
    type Item = Result<StreamFrame, StreamError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance().map_err(|fault| fault.in_stream(&self.name)).transpose()
    }
}
