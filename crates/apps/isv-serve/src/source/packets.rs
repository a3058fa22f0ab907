//! Packets of a stream that may be damaged, cut, or followed by another.

use super::replay::Replay;
use isv_format::{FormatError, MAGIC, PacketHeader, PacketReader, Profile, StreamHeader};
use std::io::{self, Read};

/// Bytes that may be read in vain, as packets that turn out to be none: so many at first and never more at once, and so many
/// regained for each byte passed. Packets beyond what is left are damage unless they are short. Otherwise each false header
/// of 24 bytes would cost as much as the largest packet. Salvaging a file follows the same rule but for the upper limit,
/// without which a stream of hours would have saved up for hours.
const PATIENCE_BYTES: usize = 1 << 26;
const PATIENCE_REGAINED: usize = 16;
/// What counts as short then, header and payload.
const SHORT_BYTES: usize = 1 << 12;

/// What comes next.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Piece<'a> {
    /// A stream begins.
    Header([u8; StreamHeader::BYTES]),
    /// A frame's packet, header and payload, as it stood there.
    Frame {
        packet: &'a [u8],
        /// Whether decoding can begin here, or begin to recover.
        entry: bool,
    },
    /// The stream ended as its writer meant it to.
    End,
    /// Bytes that are no packet, in words; told once until there is one again.
    Damage(String),
}

/// Reads pieces. What is no packet is passed over up to the next bytes with which a packet or a stream begins: bytes that a
/// wrong length made part of the damage are looked through too. It holds at most one packet.
#[derive(Debug)]
pub(super) struct Packets<R> {
    bytes: Replay<R>,
    /// In bytes, header and payload.
    largest_packet: usize,
    /// Bytes of the stream before the next one, for messages.
    at: u64,
    /// Bytes of the first stream that were left out behind its header.
    skipped: u64,
    /// The profile of the stream whose header came; without one packets have no meaning.
    profile: Option<Profile>,
    /// Whether the damage was told that the next bytes are in.
    told: bool,
    /// Bytes that may still be read in vain.
    patience: usize,
}

/// What one attempt to read gave.
enum Found {
    Header,
    Frame { entry: bool },
    End,
}

impl<R: Read> Packets<R> {
    /// `skipped` bytes were left out of `source` behind its stream header. Larger packets are damage.
    pub(super) fn new(source: R, skipped: u64, largest_packet: usize) -> Self {
        let patience = PATIENCE_BYTES.max(largest_packet);
        Self {
            bytes: Replay::new(source),
            largest_packet,
            at: 0,
            skipped,
            profile: None,
            told: false,
            patience,
        }
    }

    /// The next piece, for which it waits; `None` at the end of the bytes.
    pub(super) fn next(&mut self) -> io::Result<Option<Piece<'_>>> {
        loop {
            self.forget();
            if self.bytes.peek(1)?.is_empty() {
                return Ok(None);
            }
            match self.read() {
                Ok(found) => {
                    self.told = false;
                    return Ok(Some(self.piece(found)));
                }
                Err(FormatError::Io(error)) => return Err(error),
                Err(error) => {
                    self.patience = self.patience.saturating_sub(self.bytes.read_so_far().len());
                    self.bytes.rewind();
                    self.pass_over()?;
                    if !std::mem::replace(&mut self.told, true) {
                        return Ok(Some(Piece::Damage(error.to_string())));
                    }
                }
            }
        }
    }

    /// Reads a header or a packet, or what is neither.
    fn read(&mut self) -> Result<Found, FormatError> {
        match Begins::of(self.bytes.peek(MAGIC.len())?, self.profile.is_some()) {
            Some(Begins::Stream) => self.read_header(),
            Some(Begins::Packet) => self.read_packet(),
            None if self.profile.is_some() => Err(FormatError::Malformed {
                at: self.at,
                what: "no packet begins where one should".to_owned(),
            }),
            None => Err(FormatError::NotIsv),
        }
    }

    fn read_header(&mut self) -> Result<Found, FormatError> {
        self.at = 0;
        self.profile = None;
        let header =
            *PacketReader::new(&mut self.bytes)?.header().expect("a reader that began at the header has it");
        self.profile = Some(header.profile);
        Ok(Found::Header)
    }

    fn read_packet(&mut self) -> Result<Found, FormatError> {
        let believed = self.largest_packet.min(self.patience.max(SHORT_BYTES));
        let largest = believed.saturating_sub(PacketHeader::BYTES);
        let largest = u32::try_from(largest).unwrap_or(u32::MAX);
        let frame =
            PacketReader::at_packet(&mut self.bytes, self.at).with_largest_payload(largest).next_frame()?;
        self.profile = self.profile.filter(|_| frame.is_some());
        Ok(frame
            .zip(self.profile)
            .map_or(Found::End, |(packet, profile)| Found::Frame { entry: packet.is_entry(&profile) }))
    }

    fn piece(&mut self, found: Found) -> Piece<'_> {
        let bytes = self.bytes.read_so_far();
        match found {
            Found::Header => {
                self.at += std::mem::take(&mut self.skipped);
                Piece::Header(bytes.try_into().expect("a stream header was read"))
            }
            Found::Frame { entry } => Piece::Frame { packet: bytes, entry },
            Found::End => Piece::End,
        }
    }

    /// Passes over a byte and all that follow it, up to what may be the beginning of a packet or a stream.
    fn pass_over(&mut self) -> io::Result<()> {
        self.bytes.skip(1);
        loop {
            self.forget();
            let bytes = self.bytes.peek(MAGIC.len())?;
            if bytes.len() < MAGIC.len() {
                let rest = bytes.len();
                self.bytes.skip(rest);
                return Ok(());
            }
            let bytes = self.bytes.unread();
            let mut openings = bytes.windows(MAGIC.len());
            if let Some(at) = openings.position(|bytes| Begins::of(bytes, self.profile.is_some()).is_some()) {
                self.bytes.skip(at);
                return Ok(());
            }
            let passed = bytes.len() + 1 - MAGIC.len();
            self.bytes.skip(passed);
        }
    }

    fn forget(&mut self) {
        let passed = self.bytes.forget();
        self.at += passed as u64;
        let regained = self.patience.saturating_add(passed.saturating_mul(PATIENCE_REGAINED));
        self.patience = regained.min(PATIENCE_BYTES.max(self.largest_packet));
    }
}

/// What bytes may be the beginning of.
#[derive(Clone, Copy, Debug)]
enum Begins {
    Stream,
    Packet,
}

impl Begins {
    fn of(bytes: &[u8], in_stream: bool) -> Option<Self> {
        if bytes.starts_with(&MAGIC) {
            Some(Self::Stream)
        } else if in_stream && bytes.starts_with(&PacketHeader::MAGIC) {
            Some(Self::Packet)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_format::PacketKind;
    use std::fs;
    use std::path::Path;

    const LARGEST: usize = 1 << 20;

    /// A stream of three packets, with where its packets begin and where the index does.
    fn stream() -> (Vec<u8>, Vec<usize>) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../conformance");
        let bytes = fs::read(root.join("main_inter.isv")).unwrap();
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let mut places = Vec::new();
        while let Some(packet) = reader.next_packet().unwrap() {
            places.push(packet.at as usize);
        }
        assert!(places.len() > 3, "{places:?}");
        (bytes, places)
    }

    /// Gives a byte at a time.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let most = buffer.len().min(1);
            self.0.read(&mut buffer[..most])
        }
    }

    /// All pieces in words: of frames where in `stream` they stood.
    fn pieces(source: impl Read, stream: &[u8]) -> Vec<String> {
        let mut packets = Packets::new(source, 0, LARGEST);
        let mut pieces = Vec::new();
        while let Some(piece) = packets.next().unwrap() {
            pieces.push(match piece {
                Piece::Header(header) => format!("header {}", header == stream[..48]),
                Piece::Frame { packet, .. } => {
                    format!(
                        "frame {}",
                        stream.windows(packet.len()).position(|bytes| bytes == packet).unwrap()
                    )
                }
                Piece::End => "end".to_owned(),
                Piece::Damage(words) => words,
            });
        }
        pieces
    }

    fn whole(places: &[usize]) -> Vec<String> {
        let frames = places[..places.len() - 1].iter().map(|at| format!("frame {at}"));
        std::iter::once("header true".to_owned()).chain(frames).chain(["end".to_owned()]).collect()
    }

    #[test]
    fn a_sound_stream_comes_as_it_is_however_it_is_cut_into_reads() {
        let (bytes, places) = stream();
        assert_eq!(pieces(&bytes[..], &bytes), whole(&places));
        assert_eq!(pieces(Trickle(&bytes), &bytes), whole(&places));
        let twice = [&bytes[..], &bytes].concat();
        assert_eq!(pieces(&twice[..], &bytes), [whole(&places), whole(&places)].concat());
    }

    #[test]
    fn whatever_bit_of_a_packet_is_damaged_only_that_packet_is_lost() {
        let (bytes, places) = stream();
        let (first, second) = (places[1], places[2]);
        let expected: Vec<_> =
            whole(&places).into_iter().filter(|piece| *piece != format!("frame {first}")).collect();
        for byte in first..second.min(first + 200) {
            let mut damaged = bytes.clone();
            damaged[byte] ^= 0x10;
            let (mut found, frames) = (pieces(&damaged[..], &bytes), expected.clone());
            assert!(!found.remove(2).starts_with("frame"), "byte {byte}");
            assert_eq!(found, frames, "byte {byte}");
        }
    }

    #[test]
    fn a_cut_stream_is_followed_by_the_next_one() {
        let (bytes, places) = stream();
        for cut in [20, 48, places[1], places[1] + 5, places[1] + 30, places[2] - 1, bytes.len() - 3] {
            let restarted = [&bytes[..cut], &bytes].concat();
            let found = pieces(&restarted[..], &bytes);
            let expected = whole(&places);
            assert_eq!(found[found.len() - expected.len()..], expected, "cut at {cut}");
            let told =
                found.iter().filter(|piece| !piece.starts_with("frame") && !expected.contains(piece)).count();
            assert!(told <= 1, "cut at {cut}: {found:?}");
        }
    }

    #[test]
    fn what_is_no_stream_is_told_once_and_passed_over() {
        let (bytes, places) = stream();
        let noise: Vec<u8> =
            (0..100_000u32).flat_map(|i| (i.wrapping_mul(2_654_435_761)).to_be_bytes()).collect();
        let found = pieces(&[&noise[..], b"ISVP", &noise, &bytes].concat()[..], &bytes);
        assert_eq!(found[0], FormatError::NotIsv.to_string());
        assert_eq!(found[1..], whole(&places));
        assert_eq!(pieces(&b"ISVPISVP"[..], &bytes), [FormatError::NotIsv.to_string()]);
        assert!(pieces(&[][..], &bytes).is_empty());
    }

    #[test]
    fn a_packet_larger_than_allowed_is_passed_over() {
        let (bytes, places) = stream();
        let length = places[2] - places[1];
        let mut packets = Packets::new(&bytes[..], 0, length - 1);
        let mut frames = 0;
        let mut words = Vec::new();
        while let Some(piece) = packets.next().unwrap() {
            match piece {
                Piece::Frame { packet, .. } => {
                    assert!(packet.len() < length);
                    frames += 1;
                }
                Piece::Damage(what) => words.push(what),
                Piece::Header(_) | Piece::End => {}
            }
        }
        assert!(
            frames < places.len() - 1 && words.iter().any(|words| words.contains("above the limit")),
            "{words:?}"
        );
    }

    /// A packet with its number as timestamp.
    fn packet(number: u64, payload_bytes: usize) -> Vec<u8> {
        let payload = vec![0; payload_bytes];
        let kind = PacketKind::Frame { keyframe: true, hashed: false };
        [&PacketHeader::seal(kind, 0, number, &payload)[..], &payload].concat()
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
        let count = 2 * PATIENCE_BYTES / false_bytes;
        let header = stream().0[..StreamHeader::BYTES].to_vec();
        let after = [packet(0, 100), packet(1, 600_000), packet(2, 100), packet(3, 600_000)].concat();
        let bytes = [header, false_header.repeat(count), after].concat();
        let mut packets = Packets::new(&bytes[..], 0, LARGEST);
        let mut found = Vec::new();
        while let Some(piece) = packets.next().unwrap() {
            found.push(match piece {
                Piece::Header(_) => "header".to_owned(),
                Piece::Frame { packet, .. } => format!("frame {}", packet[12]),
                Piece::End => "end".to_owned(),
                Piece::Damage(_) => "damage".to_owned(),
            });
        }
        // The first large packet is one too many; behind it there is patience again.
        assert_eq!(found, ["header", "damage", "frame 0", "damage", "frame 2", "frame 3"]);
    }

    #[test]
    fn places_in_messages_count_from_the_start_of_the_stream() {
        let (bytes, places) = stream();
        let mut damaged = bytes.clone();
        damaged[places[2] + 30] ^= 1;
        // Without the first two packets, as when a file is joined late.
        let joined = [&damaged[..48], &damaged[places[2]..]].concat();
        let mut packets = Packets::new(&joined[..], (places[2] - 48) as u64, LARGEST);
        packets.next().unwrap();
        let Some(Piece::Damage(words)) = packets.next().unwrap() else { panic!("damage") };
        assert!(words.contains(&format!("at byte {} ", places[2])), "{words}");
    }
}
