//! Packets of a damaged stream: what is sound, and where something is missing.

use crate::resynchroniser::{Piece, Resynchroniser};
use crate::{FormatError, MetadataText, Packet, StreamHeader};
use std::io::Read;

/// What is found in a damaged stream, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Salvaged {
    /// A whole frame packet, its checksum verified.
    Frame(Packet),
    /// Bytes that are no packet.
    Damage {
        /// Offset of the first damaged byte in the stream.
        at: u64,
        /// How many they are.
        bytes: u64,
    },
    /// The header of another stream, as where two files were joined byte for byte: nothing behind it belongs to this one. The end.
    OtherStream {
        /// Offset of the other stream's header (bytes).
        at: u64,
    },
}

/// Reads what is sound of a stream whose bytes are damaged, lost or cut off: where no packet begins, the next one is looked for.
/// Never seeks. Memory: see [`Resynchroniser`].
#[derive(Debug)]
pub struct SalvageReader<R> {
    pieces: Resynchroniser<R>,
    header: StreamHeader,
    /// Offset (bytes) at which the damage that is being passed over began.
    damaged_since: Option<u64>,
    /// What was found behind damage, which is told first.
    found: Option<Salvaged>,
    /// Whether another stream begins here.
    other_stream: bool,
    saw_trailer: bool,
    /// How many frames the last sound index has.
    indexed: Option<usize>,
    /// Number of sound packets passed over, as their types are not known.
    skipped: usize,
    /// The first metadata before the first frame.
    metadata: Option<MetadataText>,
    saw_frame: bool,
}

impl<R: Read> SalvageReader<R> {
    /// Reads the stream header, without which nothing can be decoded.
    ///
    /// # Errors
    /// Bytes that are not a stream header of this version, or a damaged one.
    pub fn new(mut source: R) -> Result<Self, FormatError> {
        let header = StreamHeader::read(&mut source)?;
        Ok(Self::from_place(source, StreamHeader::BYTES as u64, header))
    }

    /// Reads a stream whose own header is damaged or lost, and was this one. What is left of it is damage like any other; a sound
    /// header that is not this one is, there too, that of another stream.
    pub fn with_header(source: R, header: StreamHeader) -> Self {
        Self::from_place(source, 0, header)
    }

    fn from_place(source: R, at: u64, header: StreamHeader) -> Self {
        Self {
            pieces: Resynchroniser::inside(source, at, &header),
            header,
            damaged_since: None,
            found: None,
            other_stream: false,
            saw_trailer: false,
            indexed: None,
            skipped: 0,
            metadata: None,
            saw_frame: false,
        }
    }

    /// Takes packets whose payload is larger than this for damage.
    #[must_use]
    pub fn with_largest_payload(self, bytes: u32) -> Self {
        Self { pieces: self.pieces.with_largest_payload(bytes), ..self }
    }

    /// The stream header.
    pub fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// Whether a sound index was met with a sound trailer behind it, and no frame since: the end is there.
    pub fn complete(&self) -> bool {
        self.saw_trailer
    }

    /// How many frames the stream has by its last sound index, once that was met.
    pub fn indexed_frames(&self) -> Option<usize> {
        self.indexed
    }

    /// Number of sound packets passed over so far, as this build does not know their types and may skip them.
    pub fn skipped(&self) -> usize {
        self.skipped
    }

    /// What the take is, once the first frame has been read; `None` if the stream does not say it.
    pub fn metadata(&self) -> Option<&MetadataText> {
        self.metadata.as_ref()
    }

    /// The next frame, or what lies before it; `None` at the end of the bytes and where another stream begins. Index and trailer are
    /// passed over where they are sound; so is a header that is this stream's again.
    ///
    /// # Errors
    /// Those of the source, and a sound packet whose type is not known and must not be skipped: a newer build may read on.
    pub fn next_frame(&mut self) -> Result<Option<Salvaged>, FormatError> {
        if let Some(found) = self.found.take() {
            return Ok(Some(found));
        }
        while !self.other_stream {
            let Some((at, piece)) = self.pieces.next_piece()? else {
                return Ok(self.damage_until(self.pieces.at()));
            };
            let found = match piece {
                Piece::Damage(_) => {
                    self.damaged_since = Some(at);
                    continue;
                }
                Piece::Frame(packet) => {
                    self.saw_frame = true;
                    self.saw_trailer = false;
                    Some(Salvaged::Frame(packet))
                }
                Piece::Index { frames, is_end } => {
                    self.indexed = Some(frames);
                    self.saw_trailer |= is_end;
                    None
                }
                Piece::Metadata(found) => {
                    if !self.saw_frame && self.metadata.is_none() {
                        self.metadata = found;
                    }
                    None
                }
                Piece::Skipped => {
                    self.skipped += 1;
                    None
                }
                Piece::Unsupported(error) => return Err(error),
                Piece::Header(header) => {
                    self.other_stream = header != self.header;
                    self.other_stream.then_some(Salvaged::OtherStream { at })
                }
            };
            match self.damage_until(at) {
                Some(damage) => {
                    self.found = found;
                    return Ok(Some(damage));
                }
                None if found.is_some() => return Ok(found),
                None => {}
            }
        }
        Ok(None)
    }

    /// The damage that ends at a byte of the stream, if there is any.
    fn damage_until(&mut self, end: u64) -> Option<Salvaged> {
        let at = self.damaged_since.take()?;
        Some(Salvaged::Damage { at, bytes: end - at })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::header::tests::header;
    use crate::{
        FrameCoding, FrameHeader, FramePayload, FrameRate, MAGIC, PacketHeader, PacketKind, PacketReader,
        PacketWriter, Prediction, SlicePayload,
    };

    const FRAMES: usize = 4;

    fn stream() -> Vec<u8> {
        let mut writer = PacketWriter::new(Vec::new(), &header()).unwrap();
        for frame in 0..FRAMES as u64 {
            let coefficients = [frame as u8; 60];
            let payload = FramePayload {
                header: FrameHeader {
                    blocks: 1,
                    slices: 1,
                    coding: FrameCoding::Paper { prediction: Prediction::None },
                    volume_hash: None,
                },
                block_set: &[7],
                masks: &[],
                slices: vec![SlicePayload { modes: &[], coefficients: &coefficients }],
            };
            writer.write_frame(frame == 0, frame, &payload).unwrap();
        }
        writer.finish().unwrap()
    }

    fn packets(bytes: &[u8]) -> Vec<Packet> {
        let mut reader = PacketReader::new(bytes).unwrap();
        std::iter::from_fn(|| reader.next_frame().unwrap()).collect()
    }

    /// Gives a few bytes at a time.
    struct Drops<'a>(&'a [u8]);

    impl Read for Drops<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let length = buffer.len().min(7);
            self.0.read(&mut buffer[..length])
        }
    }

    /// What there is, and whether the end was there.
    fn salvage(bytes: &[u8]) -> (Vec<Packet>, Vec<(u64, u64)>, bool) {
        salvage_with(SalvageReader::new(Drops(bytes)).unwrap(), bytes)
    }

    fn salvage_with(mut reader: SalvageReader<Drops>, bytes: &[u8]) -> (Vec<Packet>, Vec<(u64, u64)>, bool) {
        let (mut frames, mut damage) = (Vec::new(), Vec::new());
        while let Some(found) = reader.next_frame().unwrap() {
            match found {
                Salvaged::Frame(packet) => frames.push(packet),
                Salvaged::Damage { at, bytes } => damage.push((at, bytes)),
                Salvaged::OtherStream { at } => {
                    assert!(bytes[at as usize..].starts_with(&MAGIC));
                    assert_eq!(reader.next_frame().unwrap(), None);
                }
            }
        }
        (frames, damage, reader.complete())
    }

    #[test]
    fn a_sound_stream_is_all_there() {
        let bytes = stream();
        assert_eq!(salvage(&bytes), (packets(&bytes), Vec::new(), true));
    }

    #[test]
    fn any_flipped_byte_costs_its_packet_alone() {
        let (bytes, whole) = (stream(), packets(&stream()));
        let end = whole[FRAMES - 1].at as usize + whole[FRAMES - 1].total_bytes();
        for at in StreamHeader::BYTES..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x40;
            let (found, damage, complete) = salvage(&damaged);
            let hit = whole.iter().position(|packet| {
                (packet.at..packet.at + packet.total_bytes() as u64).contains(&(at as u64))
            });
            let others: Vec<_> =
                (0..FRAMES).filter(|frame| Some(*frame) != hit).map(|frame| whole[frame].clone()).collect();
            assert_eq!(found, others, "byte {at}");
            assert_eq!(complete, at < end, "byte {at}");
            if let Some(hit) = hit {
                assert_eq!(damage, [(whole[hit].at, whole[hit].total_bytes() as u64)]);
            } else {
                assert_eq!(damage.len(), 1, "byte {at}");
            }
        }
    }

    #[test]
    fn a_header_from_elsewhere_takes_the_place_of_one_that_is_damaged_or_lost() {
        let (bytes, whole) = (stream(), packets(&stream()));
        let with_header = |bytes: &[u8]| {
            let reader = SalvageReader::with_header(Drops(bytes), header());
            let (frames, damage, complete) = salvage_with(reader, bytes);
            let contents: Vec<_> = frames.into_iter().map(|packet| packet.payload).collect();
            assert!(complete && contents.iter().eq(whole.iter().map(|packet| &packet.payload)));
            damage
        };
        assert_eq!(with_header(&bytes), []);
        assert_eq!(with_header(&bytes[StreamHeader::BYTES..]), []);
        assert_eq!(with_header(&bytes[20..]), [(0, StreamHeader::BYTES as u64 - 20)]);
        for at in 0..StreamHeader::BYTES {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x40;
            assert_eq!(with_header(&damaged), [(0, StreamHeader::BYTES as u64)], "byte {at}");
        }
        let frame_rate = FrameRate { numerator: 1, denominator: 7 };
        let mut reader = SalvageReader::with_header(Drops(&bytes), StreamHeader { frame_rate, ..header() });
        assert_eq!(reader.next_frame().unwrap(), Some(Salvaged::OtherStream { at: 0 }));
    }

    #[test]
    fn bytes_that_are_lost_cost_what_they_touch() {
        let (bytes, whole) = (stream(), packets(&stream()));
        for (from, to) in [(60, 61), (60, 190), (StreamHeader::BYTES, 100), (200, 260)] {
            let lost = [&bytes[..from], &bytes[to..]].concat();
            let (found, damage, complete) = salvage(&lost);
            let touched = |packet: &&Packet| {
                packet.at + (packet.total_bytes() as u64) > from as u64 && packet.at < to as u64
            };
            let untouched = whole.iter().filter(|packet| !touched(packet)).count();
            assert!(found.len() == untouched && complete, "{from}..{to}");
            assert_eq!(damage.len(), 1);
        }
    }

    #[test]
    fn every_prefix_gives_its_whole_frames() {
        let (bytes, whole) = (stream(), packets(&stream()));
        for length in StreamHeader::BYTES..bytes.len() {
            let (found, damage, complete) = salvage(&bytes[..length]);
            assert!(!complete, "{length} bytes");
            let ends = |packet: &&Packet| packet.at as usize + packet.total_bytes() <= length;
            assert_eq!(found.len(), whole.iter().filter(ends).count(), "{length} bytes");
            assert!(damage.len() <= 1);
        }
    }

    /// Two files that were joined byte for byte, the first of them whole or cut.
    #[test]
    fn another_stream_is_the_end_and_the_same_goes_on() {
        let (bytes, whole) = (stream(), packets(&stream()));
        let mut other = stream();
        let header = StreamHeader { frame_rate: FrameRate { numerator: 1, denominator: 7 }, ..header() };
        other[..StreamHeader::BYTES].copy_from_slice(&header.to_bytes());
        let cut = whole[2].at as usize + 30;
        for (first, frames, damaged) in [(&bytes[..], 4, 0), (&bytes[..cut], 2, 30)] {
            let (found, damage, complete) = salvage(&[first, &other].concat());
            assert_eq!((found, complete), (whole[..frames].to_vec(), first == bytes));
            assert_eq!(damage.iter().map(|(_, bytes)| bytes).sum::<u64>(), damaged);
            let (found, damage, complete) = salvage(&[first, &bytes].concat());
            assert!(found.len() == frames + FRAMES && complete);
            assert_eq!(damage.iter().map(|(_, bytes)| bytes).sum::<u64>(), damaged);
            let (found, _, complete) = salvage(&[first, &bytes[..cut]].concat());
            assert!(found.len() == frames + 2 && !complete);
        }
    }

    /// False packets, each said to reach to the end: it is not the square of the length that is read.
    #[test]
    fn false_packets_end_in_time() {
        let mut bytes = header().to_bytes().to_vec();
        let count = 100_000;
        for n in 0..count {
            let rest = (count - n - 1) * PacketHeader::BYTES;
            let kind = PacketKind::Frame { keyframe: true, hashed: false, colour: false };
            let mut fields = PacketHeader::seal(kind, 0, 0, &[]);
            fields[8..12].copy_from_slice(&(rest as u32).to_le_bytes());
            bytes.extend(fields);
        }
        let mut reader = SalvageReader::new(&bytes[..]).unwrap();
        while let Some(found) = reader.next_frame().unwrap() {
            // The last one says that nothing follows, which is true.
            if let Salvaged::Damage { bytes, .. } = found {
                assert_eq!(bytes as usize, (count - 1) * PacketHeader::BYTES);
            }
        }
    }
}
