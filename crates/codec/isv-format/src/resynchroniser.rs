//! Packets and stream headers out of bytes that may be damaged, cut or joined: where none begins, the next one is looked for.

use crate::packet::checksum;
use crate::{
    FormatError, MAGIC, MAX_PAYLOAD, MetadataText, Packet, PacketHeader, PacketKind, StreamHeader,
    StreamIndex,
};
use std::io::{self, Read};

/// Most bytes asked of the source at a time.
const CHUNK: usize = 1 << 16;
/// Bytes that may be read in vain, as packets that turn out to be none. If the largest payload allowed is more, that counts
/// instead. A reader has so many at first and never more at once. Each byte passed regains [`PATIENCE_REGAINED`]. Packets beyond what is left are
/// damage unless they are short. Otherwise a stream of false packets, each said to reach to its end, would take the square of its
/// length.
const PATIENCE: usize = 1 << 26;
const PATIENCE_REGAINED: usize = 16;
/// Largest payload (bytes) that counts as short.
const SHORT: usize = 1 << 12;
/// Bytes of the longer of the two magics, of packets and of streams.
const LONGEST_MAGIC: usize = MAGIC.len();

/// A part of a stream.
#[derive(Debug)]
pub enum Piece {
    /// The header of a stream.
    Header(StreamHeader),
    /// A whole packet of a frame, its checksum verified.
    Frame(Packet),
    /// A whole index.
    Index {
        /// Number of frames that it lists.
        frames: usize,
        /// Whether a sound trailer follows, with which a writer ends.
        is_end: bool,
    },
    /// A whole packet of metadata; `None` if its text is none.
    Metadata(Option<MetadataText>),
    /// A whole packet that was skipped: this build does not know its type, and may pass it over.
    Skipped,
    /// A whole packet of a type that this build does not know and must not skip, as an error. Nothing behind it has a meaning, up to the
    /// next header of a stream.
    Unsupported(FormatError),
    /// Bytes that are none of these, up to the next piece.
    Damage(FormatError),
}

/// A reader of packets that finds its way back after damage. Never seeks.
///
/// A damaged length may make sound packets part of the damage, so they are looked for from the byte after a false beginning. Memory:
/// that of the packet at hand, and where a false header says so, as many bytes as that says and the source has.
#[derive(Debug)]
pub struct Resynchroniser<R> {
    window: Window<R>,
    /// Place of the window in the stream, in bytes.
    at: u64,
    /// The header of the stream, without which packets have no meaning.
    stream: Option<StreamHeader>,
    largest_payload: u32,
    /// Whether damage was told that the window is in.
    in_damage: bool,
    /// Whether nothing begins where the window does.
    must_pass: bool,
    /// Bytes that may still be read in vain.
    patience: usize,
}

impl<R: Read> Resynchroniser<R> {
    /// A reader that looks for a stream's header first.
    pub fn new(source: R) -> Self {
        Self {
            window: Window::new(source),
            at: 0,
            stream: None,
            largest_payload: MAX_PAYLOAD,
            in_damage: false,
            must_pass: false,
            patience: PATIENCE.max(MAX_PAYLOAD as usize),
        }
    }

    /// A reader inside of a stream with this header; the source is at byte `at` of it.
    pub fn inside(source: R, at: u64, header: &StreamHeader) -> Self {
        Self { at, stream: Some(*header), ..Self::new(source) }
    }

    /// Takes packets whose payload is larger than this for damage.
    #[must_use]
    pub fn with_largest_payload(self, bytes: u32) -> Self {
        Self { largest_payload: bytes, patience: PATIENCE.max(bytes as usize), ..self }
    }

    /// Place in the stream (bytes) behind the last piece, or of the damage that was told last.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Counts places from here on as if this were byte `at`.
    pub fn count_from(&mut self, at: u64) {
        self.at = at;
    }

    /// The stream is over: packets have no meaning up to the next header.
    pub fn leave_stream(&mut self) {
        self.stream = None;
    }

    /// The next piece and the place in the stream where it begins, for which it waits; `None` at the end of the bytes.
    ///
    /// # Errors
    /// Those of the source.
    pub fn next_piece(&mut self) -> io::Result<Option<(u64, Piece)>> {
        loop {
            if std::mem::take(&mut self.must_pass) {
                self.pass_to_magic()?;
            }
            if self.window.peek(1)?.is_empty() {
                return Ok(None);
            }
            let at = self.at;
            match self.piece_here() {
                Ok(piece) => {
                    // What has no meaning behind an unknown packet is not told as damage too.
                    self.in_damage = matches!(piece, Piece::Unsupported(_));
                    return Ok(Some((at, piece)));
                }
                Err(FormatError::Io(error)) => return Err(error),
                Err(why) => {
                    self.must_pass = true;
                    // Told before more is waited for.
                    if !std::mem::replace(&mut self.in_damage, true) {
                        return Ok(Some((at, Piece::Damage(why))));
                    }
                }
            }
        }
    }

    /// The piece that begins where the window does; passes it.
    fn piece_here(&mut self) -> Result<Piece, FormatError> {
        if self.window.peek(MAGIC.len())? == MAGIC {
            let header = self.header_here()?;
            self.stream = Some(header);
            self.pass(StreamHeader::BYTES);
            return Ok(Piece::Header(header));
        }
        let Some(stream) = self.stream else { return Err(FormatError::NotIsv) };
        let (header, packet_bytes) = self.packet_here(&stream)?;
        let header = match header {
            Ok(header) => header,
            Err(error) => {
                self.pass(packet_bytes);
                self.leave_stream();
                return Ok(Piece::Unsupported(error));
            }
        };
        match header.kind {
            PacketKind::Frame { .. } => {
                let at = self.at;
                let payload = self.window.peek(packet_bytes)?[PacketHeader::BYTES..].to_vec();
                self.pass(packet_bytes);
                Ok(Piece::Frame(Packet { header, at, payload }))
            }
            PacketKind::Metadata => {
                let payload = self.window.peek(packet_bytes)?[PacketHeader::BYTES..].to_vec();
                self.pass(packet_bytes);
                Ok(Piece::Metadata(MetadataText::from_payload(payload)))
            }
            PacketKind::Skippable { .. } => {
                self.pass(packet_bytes);
                Ok(Piece::Skipped)
            }
            PacketKind::Index => {
                self.pass(packet_bytes);
                let frames = header.payload_bytes as usize / StreamIndex::ENTRY_BYTES;
                // Where bytes are lost before it, the trailer says where the index was.
                let trailer = self.window.peek(StreamIndex::TRAILER_BYTES)?;
                let trailer = trailer.first_chunk().and_then(StreamIndex::parse_trailer);
                if trailer.is_some() {
                    self.pass(StreamIndex::TRAILER_BYTES);
                }
                Ok(Piece::Index { frames, is_end: trailer.is_some() })
            }
        }
    }

    fn header_here(&mut self) -> Result<StreamHeader, FormatError> {
        StreamHeader::read(&mut self.window.peek(StreamHeader::BYTES)?)
    }

    /// The header of the whole packet that begins where the window does, and the bytes of both. In place of a header the error of a type
    /// that must not be skipped: its packet is as whole.
    fn packet_here(
        &mut self,
        stream: &StreamHeader,
    ) -> Result<(Result<PacketHeader, FormatError>, usize), FormatError> {
        let at = self.at;
        let found = self.window.peek(PacketHeader::BYTES)?;
        let truncated = |bytes: usize, inside| FormatError::Truncated { at: at + bytes as u64, inside };
        // What cannot be a packet is told as such, even at the end of the bytes.
        if !PacketHeader::MAGIC.starts_with(&found[..found.len().min(PacketHeader::MAGIC.len())]) {
            return Err(FormatError::malformed(at, "no packet begins where one should"));
        }
        let Some(bytes) = found.first_chunk().copied() else {
            return Err(truncated(found.len(), "a packet header"));
        };
        let header = match PacketHeader::parse(&bytes, at, stream) {
            Err(error) if !matches!(error, FormatError::PacketType { .. }) => return Err(error),
            header => header,
        };
        let payload_bytes = PacketHeader::length(&bytes, at)?;
        let allowed = (self.largest_payload as usize).min(self.patience.max(SHORT));
        if payload_bytes as usize > allowed {
            return Err(FormatError::payload_above(payload_bytes.into(), allowed as u32, at));
        }
        let packet_bytes = PacketHeader::BYTES + payload_bytes as usize;
        let packet = self.window.peek(packet_bytes)?;
        let length = packet.len();
        let is_whole = length == packet_bytes;
        let payload = &packet[PacketHeader::BYTES..];
        let (fields, stated) = bytes.split_at(PacketHeader::BYTES - 4);
        if is_whole && checksum(fields, payload).to_le_bytes() == stated {
            return Ok((header, packet_bytes));
        }
        self.patience = self.patience.saturating_sub(payload.len());
        match is_whole {
            true => Err(FormatError::Checksum { at, what: "the packet" }),
            false => Err(truncated(length, "a packet")),
        }
    }

    /// Passes over at least a byte, up to what looks like the begin of a packet or of a stream.
    fn pass_to_magic(&mut self) -> io::Result<()> {
        self.pass(1);
        let in_stream = self.stream.is_some();
        loop {
            let is_whole = self.window.peek(LONGEST_MAGIC)?.len() == LONGEST_MAGIC;
            let bytes = self.window.unread();
            let begins = |at: &usize| {
                let rest = &bytes[*at..];
                rest.starts_with(&MAGIC) || in_stream && rest.starts_with(&PacketHeader::MAGIC)
            };
            // What may be the begin of a magic stays.
            let looked_at = (bytes.len() + 1).saturating_sub(if is_whole { LONGEST_MAGIC } else { 1 });
            let found = (0..looked_at).find(begins);
            self.pass(found.unwrap_or(looked_at));
            if found.is_some() || !is_whole {
                return Ok(());
            }
        }
    }

    fn pass(&mut self, bytes: usize) {
        let passed = self.window.pass(bytes);
        self.at += passed as u64;
        let regained = self.patience.saturating_add(passed.saturating_mul(PATIENCE_REGAINED));
        self.patience = regained.min(PATIENCE.max(self.largest_payload as usize));
    }
}

/// Bytes of a source that were read and not passed yet.
#[derive(Debug)]
struct Window<R> {
    source: R,
    /// Bytes that were read, and room behind them: it is cleared once, not for each read, as many reads give few bytes.
    buffer: Vec<u8>,
    /// Place in `buffer` of the first byte that was not passed.
    start: usize,
    /// Place in `buffer` where the room begins.
    end: usize,
    source_ended: bool,
}

impl<R: Read> Window<R> {
    fn new(source: R) -> Self {
        Self { source, buffer: Vec::new(), start: 0, end: 0, source_ended: false }
    }

    /// The next bytes without passing them: `length`, unless the source ends before. No more is waited for.
    fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        while self.end - self.start < length && !self.source_ended {
            let room = self.end..self.end + CHUNK;
            if self.buffer.len() < room.end {
                self.buffer.resize(room.end, 0);
            }
            let count = read_some(&mut self.source, &mut self.buffer[room])?;
            self.end += count;
            self.source_ended = count == 0;
        }
        Ok(&self.buffer[self.start..self.end.min(self.start + length)])
    }

    /// All that was read and not passed.
    fn unread(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// Passes bytes that were read, and returns how many.
    fn pass(&mut self, bytes: usize) -> usize {
        let passed = bytes.min(self.end - self.start);
        self.start += passed;
        // The rest moves when it is the smaller part, so that each byte is moved once or so.
        if self.start > self.end / 2 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        passed
    }
}

/// Bytes that the source has now, 0 at its end.
fn read_some(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::header::tests::header;

    const LARGEST: u32 = 1 << 20;

    /// A source that gives a byte at a time.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let most = buffer.len().min(1);
            self.0.read(&mut buffer[..most])
        }
    }

    /// A packet with its number as timestamp.
    fn packet(number: u64, payload_bytes: usize) -> Vec<u8> {
        let payload = vec![0; payload_bytes];
        let kind = PacketKind::Frame { keyframe: true, hashed: false, colour: false };
        [&PacketHeader::seal(kind, 0, number, &payload)[..], &payload].concat()
    }

    /// All pieces in words, frames by their timestamps.
    fn pieces(source: impl Read) -> Vec<String> {
        let mut reader = Resynchroniser::new(source).with_largest_payload(LARGEST);
        let mut pieces = Vec::new();
        while let Some((_, piece)) = reader.next_piece().unwrap() {
            pieces.push(match piece {
                Piece::Header(_) => "header".to_owned(),
                Piece::Frame(packet) => format!("frame {}", packet.header.timestamp_ns),
                Piece::Index { frames, is_end } => format!("index of {frames}, end {is_end}"),
                Piece::Metadata(_) => "metadata".to_owned(),
                Piece::Skipped => "skipped".to_owned(),
                Piece::Unsupported(why) | Piece::Damage(why) => why.to_string(),
            });
        }
        pieces
    }

    #[test]
    fn pieces_are_the_same_however_the_source_is_cut_into_reads() {
        let bytes = [&header().to_bytes()[..], &packet(1, 10), b"noise", &packet(2, 0), b"ISV"].concat();
        let expected = [
            "header",
            "frame 1",
            "no packet begins where one should at byte 82",
            "frame 2",
            "cut off at byte 114, inside a packet header",
        ];
        assert_eq!(pieces(&bytes[..]), expected);
        assert_eq!(pieces(Trickle(&bytes)), expected);
    }

    #[test]
    fn what_is_no_stream_is_told_once_and_passed_over() {
        let noise: Vec<u8> =
            (0..100_000u32).flat_map(|i| (i.wrapping_mul(2_654_435_761)).to_be_bytes()).collect();
        let stream = [&header().to_bytes()[..], &packet(3, 100)].concat();
        let found = pieces(&[&noise[..], b"ISVP", &noise, &stream].concat()[..]);
        assert_eq!(found, [&FormatError::NotIsv.to_string(), "header", "frame 3"]);
        assert_eq!(pieces(&b"ISVPISVP"[..]), [FormatError::NotIsv.to_string()]);
        assert!(pieces(&[][..]).is_empty());
    }

    #[test]
    fn places_count_from_where_they_are_told_to() {
        let bytes = [&header().to_bytes()[..], b"noise", &packet(3, 100)].concat();
        let mut reader = Resynchroniser::new(&bytes[..]);
        assert!(matches!(reader.next_piece().unwrap(), Some((0, Piece::Header(_)))));
        reader.count_from(1000);
        let damage = reader.next_piece().unwrap();
        assert!(matches!(damage, Some((1000, Piece::Damage(FormatError::Malformed { at: 1000, .. })))));
        assert!(matches!(reader.next_piece().unwrap(), Some((1005, Piece::Frame(Packet { at: 1005, .. })))));
    }

    #[test]
    fn behind_the_end_of_a_stream_packets_are_damage_up_to_a_header() {
        let bytes = [&packet(1, 9)[..], &packet(2, 9), &header().to_bytes(), &packet(3, 9)].concat();
        let mut reader = Resynchroniser::inside(&bytes[..], 48, &header());
        assert!(matches!(reader.next_piece().unwrap(), Some((48, Piece::Frame(_)))));
        reader.leave_stream();
        assert!(matches!(reader.next_piece().unwrap(), Some((81, Piece::Damage(FormatError::NotIsv)))));
        assert!(matches!(reader.next_piece().unwrap(), Some((114, Piece::Header(_)))));
        assert!(matches!(reader.next_piece().unwrap(), Some((162, Piece::Frame(_)))));
        assert!(reader.next_piece().unwrap().is_none());
    }

    /// Each false header says that half a megabyte follows, and so much does.
    #[test]
    fn false_packets_use_up_what_may_be_read_in_vain_and_bytes_passed_regain_it() {
        let false_bytes = 500_000;
        let false_header = {
            let mut fields = packet(9, 0);
            fields[8..12].copy_from_slice(&(false_bytes as u32).to_le_bytes());
            fields
        };
        let count = 2 * PATIENCE / false_bytes;
        let after = [packet(0, 100), packet(1, 600_000), packet(2, 100), packet(3, 600_000)].concat();
        let bytes = [header().to_bytes().to_vec(), false_header.repeat(count), after].concat();
        let found = pieces(&bytes[..]);
        let is_damage = |piece: &String| piece.contains("damaged") || piece.contains("above the limit");
        assert!(is_damage(&found[1]) && is_damage(&found[3]), "{found:?}");
        // The first large packet is one too many; behind it there is patience again.
        let sound: Vec<_> = found.into_iter().filter(|piece| !is_damage(piece)).collect();
        assert_eq!(sound, ["header", "frame 0", "frame 2", "frame 3"]);
    }
}
