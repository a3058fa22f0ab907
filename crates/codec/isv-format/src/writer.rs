//! Packets into a byte sink, one after the other.

use crate::packet::{MAX_PAYLOAD, PacketHeader, PacketKind};
use crate::{
    FormatError, FormatVersion, FramePayload, IndexEntry, MetadataText, Packet, PayloadParts, StreamHeader,
    StreamIndex,
};
use std::io::Write;

/// Writes a stream to anything that takes bytes. Never seeks, patches nothing.
#[derive(Debug)]
pub struct PacketWriter<W> {
    sink: W,
    version: FormatVersion,
    has_colour: bool,
    at: u64,
    since_keyframe: u16,
    /// Places of the frames written, up to one more than an index can hold.
    index: StreamIndex,
    most_indexed: usize,
}

impl<W: Write> PacketWriter<W> {
    /// Writes the stream header.
    ///
    /// # Errors
    /// I/O errors of the sink.
    pub fn new(mut sink: W, header: &StreamHeader) -> Result<Self, FormatError> {
        sink.write_all(&header.to_bytes())?;
        sink.flush()?;
        Ok(Self {
            sink,
            version: header.version,
            has_colour: header.colour_layers.is_some(),
            at: StreamHeader::BYTES as u64,
            since_keyframe: 0,
            index: StreamIndex::default(),
            most_indexed: MAX_PAYLOAD as usize / StreamIndex::ENTRY_BYTES,
        })
    }

    /// The sink. What is written to it behind the writer's back breaks the stream.
    pub fn sink_mut(&mut self) -> &mut W {
        &mut self.sink
    }

    /// Writes what the take is. Comes before the first frame, and once.
    ///
    /// # Errors
    /// I/O errors of the sink.
    ///
    /// # Panics
    /// Panics in a stream of version 1, and behind a frame.
    pub fn write_metadata(&mut self, text: &MetadataText) -> Result<(), FormatError> {
        assert!(self.version >= FormatVersion::V2, "metadata in a stream of version 1");
        assert!(self.index.frames.is_empty(), "metadata behind a frame");
        self.write_packet(PacketKind::Metadata, 0, text.as_str().as_bytes())?;
        self.sink.flush()?;
        Ok(())
    }

    /// Writes a frame packet and returns its size in bytes. The sink is flushed: whoever is at the other end of a pipe has the
    /// frame at once.
    ///
    /// # Errors
    /// I/O errors of the sink, and a payload above [`MAX_PAYLOAD`].
    pub fn write_frame(
        &mut self,
        keyframe: bool,
        timestamp_ns: u64,
        frame: &FramePayload,
    ) -> Result<usize, FormatError> {
        self.write_coloured_frame(keyframe, timestamp_ns, frame, None)
    }

    /// Writes a frame packet with a colour part, if there is one, and returns its size in bytes.
    ///
    /// # Errors
    /// As [`Self::write_frame`].
    ///
    /// # Panics
    /// If there is a colour part in a stream whose header has no layers of colour.
    pub fn write_coloured_frame(
        &mut self,
        keyframe: bool,
        timestamp_ns: u64,
        frame: &FramePayload,
        colour: Option<&[u8]>,
    ) -> Result<usize, FormatError> {
        assert!(colour.is_none() || self.has_colour, "a colour part in a stream without colour");
        let (at, geometry) = (self.at, frame.to_bytes());
        let hashed = frame.header.volume_hash.is_some();
        let kind = PacketKind::Frame { keyframe, hashed, colour: colour.is_some() };
        let payload = match colour {
            Some(colour) => PayloadParts::join(geometry, colour, at)?,
            None => geometry,
        };
        self.since_keyframe = if keyframe { 0 } else { self.since_keyframe.wrapping_add(1) };
        let bytes = self.write_packet(kind, timestamp_ns, &payload)?;
        self.sink.flush()?;
        self.note(IndexEntry { at, keyframe });
        Ok(bytes)
    }

    /// Writes a frame packet of a stream with the same header, and returns its size in bytes. The packet stays as it is, colour
    /// part and all, but for its time.
    ///
    /// # Errors
    /// I/O errors of the sink.
    ///
    /// # Panics
    /// If the packet is no frame.
    pub fn copy_frame(&mut self, packet: &Packet, timestamp_ns: u64) -> Result<usize, FormatError> {
        let PacketKind::Frame { keyframe, .. } = packet.header.kind else {
            panic!("a frame is copied, and an index is made anew by `finish`")
        };
        let at = self.at;
        self.since_keyframe = packet.header.since_keyframe;
        let bytes = self.write_packet(packet.header.kind, timestamp_ns, &packet.payload)?;
        self.sink.flush()?;
        self.note(IndexEntry { at, keyframe });
        Ok(bytes)
    }

    /// Writes the index and the trailer, and gives the sink back. A stream of more frames than an index can hold, 2^27, ends
    /// without.
    ///
    /// # Errors
    /// I/O errors of the sink.
    pub fn finish(mut self) -> Result<W, FormatError> {
        if self.index.frames.len() > self.most_indexed {
            return Ok(self.sink);
        }
        let at = self.at;
        self.since_keyframe = 0;
        self.write_packet(PacketKind::Index, 0, &self.index.to_payload())?;
        self.sink.write_all(&StreamIndex::trailer(at))?;
        self.sink.flush()?;
        Ok(self.sink)
    }

    fn note(&mut self, entry: IndexEntry) {
        if self.index.frames.len() <= self.most_indexed {
            self.index.frames.push(entry);
        }
    }

    fn write_packet(
        &mut self,
        kind: PacketKind,
        timestamp_ns: u64,
        payload: &[u8],
    ) -> Result<usize, FormatError> {
        if payload.len() > MAX_PAYLOAD as usize {
            return Err(FormatError::payload_above(payload.len() as u64, MAX_PAYLOAD, self.at));
        }
        self.sink.write_all(&PacketHeader::seal(kind, self.since_keyframe, timestamp_ns, payload))?;
        self.sink.write_all(payload)?;
        let bytes = PacketHeader::BYTES + payload.len();
        self.at += bytes as u64;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::header::tests::header;
    use crate::{FrameCoding, FrameHeader, PacketReader, Prediction, SlicePayload};
    use std::io::Cursor;

    fn stream() -> Vec<u8> {
        let mut writer = PacketWriter::new(Vec::new(), &header()).unwrap();
        for frame in 0..3u64 {
            let coefficients = [frame as u8; 30];
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
            writer.write_frame(frame != 1, frame * 1000, &payload).unwrap();
        }
        writer.finish().unwrap()
    }

    /// Frames read before the end or the first error.
    fn frames(bytes: &[u8]) -> (usize, Result<(), FormatError>) {
        let mut reader = match PacketReader::new(bytes) {
            Ok(reader) => reader,
            Err(error) => return (0, Err(error)),
        };
        let mut count = 0;
        loop {
            match reader.next_frame() {
                Ok(Some(packet)) => {
                    assert_eq!(packet.header.timestamp_ns, count as u64 * 1000);
                    count += 1;
                }
                Ok(None) => return (count, Ok(())),
                Err(error) => return (count, Err(error)),
            }
        }
    }

    #[test]
    fn stream_roundtrips_with_its_index() {
        let bytes = stream();
        let (count, end) = frames(&bytes);
        assert_eq!(count, 3);
        end.unwrap();
        let index = StreamIndex::load(&mut Cursor::new(&bytes)).unwrap();
        assert_eq!(index.frames.iter().map(|f| f.keyframe).collect::<Vec<_>>(), [true, false, true]);
        assert_eq!(index.keyframe_before(1), Some(0));
        assert_eq!(index.keyframe_before(2), Some(2));
        assert_eq!(index.keyframe_before(3), None);
        for entry in &index.frames {
            let packet = PacketReader::at_packet(&bytes[entry.at as usize..], entry.at, &header())
                .next_packet()
                .unwrap()
                .unwrap();
            assert_eq!((packet.at, packet.is_keyframe()), (entry.at, entry.keyframe));
        }
    }

    #[test]
    fn what_an_index_cannot_hold_ends_without_one() {
        let whole = stream();
        let (mut reader, mut packets) = (PacketReader::new(&whole[..]).unwrap(), Vec::new());
        while let Some(packet) = reader.next_frame().unwrap() {
            packets.push(packet);
        }
        for most_indexed in [3, 2, 1] {
            let mut writer = PacketWriter::new(Vec::new(), &header()).unwrap();
            writer.most_indexed = most_indexed;
            for packet in &packets {
                writer.copy_frame(packet, packet.header.timestamp_ns).unwrap();
            }
            assert!(writer.index.frames.len() <= most_indexed + 1);
            let bytes = writer.finish().unwrap();
            assert_eq!(bytes == whole, most_indexed == 3);
            let (count, end) = frames(&bytes);
            assert_eq!(count, 3);
            end.unwrap();
            assert_eq!(StreamIndex::load(&mut Cursor::new(&bytes)).unwrap().frames.len(), 3);
        }
    }

    #[test]
    fn every_prefix_yields_its_whole_frames_and_then_fails_or_ends_at_a_packet() {
        let bytes = stream();
        let index = StreamIndex::load(&mut Cursor::new(&bytes)).unwrap();
        let ends: Vec<u64> = index.frames.iter().skip(1).map(|f| f.at).collect();
        for length in 0..bytes.len() {
            let (count, end) = frames(&bytes[..length]);
            let whole = ends.iter().filter(|e| **e <= length as u64).count();
            assert!(count >= whole && count <= whole + 1, "{length} bytes: {count} frames");
            if length > StreamHeader::BYTES {
                let walked = StreamIndex::load(&mut Cursor::new(&bytes[..length])).unwrap();
                assert_eq!(walked.frames.len(), count, "{length} bytes");
                assert_eq!(walked.frames, index.frames[..count]);
            } else if length < StreamHeader::BYTES {
                assert!(end.is_err(), "{length} bytes");
            }
        }
    }

    #[test]
    fn a_reader_may_be_stricter_about_sizes_than_the_format() {
        let bytes = stream();
        let payload =
            PacketReader::new(&bytes[..]).unwrap().next_packet().unwrap().unwrap().payload.len() as u32;
        let first =
            |largest| PacketReader::new(&bytes[..]).unwrap().with_largest_payload(largest).next_packet();
        assert!(first(payload).is_ok());
        assert!(
            matches!(first(payload - 1), Err(FormatError::LimitExceeded { allowed, .. }) if allowed + 1 == payload.into())
        );
    }

    #[test]
    fn every_flipped_bit_is_noticed() {
        let bytes = stream();
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let error = frames(&damaged).1.unwrap_err();
            // Of a packet header only magic and length are relied on before the checksum.
            let of_first_packet = (bit / 8).checked_sub(StreamHeader::BYTES);
            if matches!(of_first_packet, Some(4..8 | 12..PacketHeader::BYTES)) {
                assert!(matches!(error, FormatError::Checksum { .. }), "bit {bit}: {error}");
            }
        }
    }

    #[test]
    fn a_damaged_index_is_made_anew() {
        let bytes = stream();
        let index = StreamIndex::load(&mut Cursor::new(&bytes)).unwrap();
        let end = bytes.len() - StreamIndex::TRAILER_BYTES;
        let begin = end - PacketHeader::BYTES - 8 * index.frames.len();
        for at in begin..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x20;
            let made = StreamIndex::load(&mut Cursor::new(&damaged)).unwrap();
            assert_eq!(made, index, "byte {at}");
        }
        // One whose checksum is right, but that points beyond itself.
        let payload: Vec<u8> = index.to_payload().iter().map(|byte| byte | 0x80).collect();
        let header = PacketHeader::seal(PacketKind::Index, 0, 0, &payload);
        let wrong = [&bytes[..begin], &header, &payload, &StreamIndex::trailer(begin as u64)].concat();
        assert_eq!(StreamIndex::load(&mut Cursor::new(&wrong)).unwrap(), index);
    }
}
