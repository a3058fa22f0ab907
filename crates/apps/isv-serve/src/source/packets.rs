//! Pieces of live streams: what a source gives, with what viewers can do with it.

use isv_format::{Piece as Found, Profile, Resynchroniser, StreamHeader};
use std::io::{self, Read};

/// What comes next.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Piece {
    /// A stream begins.
    Header(StreamHeader),
    /// A frame's packet, header and payload, as it stood there.
    Frame {
        packet: Vec<u8>,
        /// Whether decoding can begin here, or begin to recover.
        entry: bool,
    },
    /// What the stream is: the packet, header and payload.
    Metadata(Vec<u8>),
    /// The stream ended as its writer meant it to.
    End,
    /// Bytes that are no packet, in words; told once until there is one again.
    Damage(String),
}

/// Reads pieces.
#[derive(Debug)]
pub(super) struct Packets<R> {
    pieces: Resynchroniser<R>,
    /// Bytes of the first stream that were left out behind its header.
    skipped: u64,
    /// The profile of the stream whose header came.
    profile: Option<Profile>,
}

impl<R: Read> Packets<R> {
    /// `skipped` bytes were left out of `source` behind its stream header. Packets with larger payloads are damage.
    pub(super) fn new(source: R, skipped: u64, largest_payload: u32) -> Self {
        let pieces = Resynchroniser::new(source).with_largest_payload(largest_payload);
        Self { pieces, skipped, profile: None }
    }

    /// The next piece, for which it waits; `None` at the end of the bytes.
    pub(super) fn next(&mut self) -> io::Result<Option<Piece>> {
        while let Some((_, found)) = self.pieces.next_piece()? {
            return Ok(Some(match found {
                Found::Header(header) => {
                    self.profile = Some(header.profile);
                    // Places in messages count from the start of the stream.
                    self.pieces.count_from(StreamHeader::BYTES as u64 + std::mem::take(&mut self.skipped));
                    Piece::Header(header)
                }
                Found::Frame(packet) => {
                    let entry = self.profile.is_some_and(|profile| packet.is_entry(&profile));
                    Piece::Frame { packet: packet.to_bytes(), entry }
                }
                Found::Index { is_end: true, .. } => {
                    self.pieces.leave_stream();
                    Piece::End
                }
                Found::Metadata(Some(text)) => Piece::Metadata(text.to_packet()),
                // Viewers have no use for these.
                Found::Index { is_end: false, .. } | Found::Metadata(None) | Found::Skipped => continue,
                Found::Unsupported(why) | Found::Damage(why) => Piece::Damage(why.to_string()),
            }));
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_format::{FormatVersion, MetadataText, PacketHeader, PacketReader, PacketWriter};
    use std::fs;
    use std::path::Path;

    const LARGEST: u32 = 1 << 20;

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

    /// All pieces in words: of frames where in `stream` they stood.
    fn pieces(source: impl Read, stream: &[u8]) -> Vec<String> {
        let mut packets = Packets::new(source, 0, LARGEST);
        let mut pieces = Vec::new();
        while let Some(piece) = packets.next().unwrap() {
            pieces.push(match piece {
                Piece::Header(header) => format!("header {}", header.to_bytes() == stream[..48]),
                Piece::Frame { packet, .. } => {
                    let at = stream.windows(packet.len()).position(|bytes| bytes == packet);
                    format!("frame {}", at.unwrap())
                }
                Piece::Metadata(packet) => {
                    format!("metadata {}", String::from_utf8_lossy(&packet[PacketHeader::BYTES..]))
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
    fn a_sound_stream_comes_as_it_is_and_another_may_follow() {
        let (bytes, places) = stream();
        assert_eq!(pieces(&bytes[..], &bytes), whole(&places));
        let twice = [&bytes[..], &bytes].concat();
        assert_eq!(pieces(&twice[..], &bytes), [whole(&places), whole(&places)].concat());
    }

    #[test]
    fn metadata_comes_as_a_packet() {
        let header = StreamHeader::parse(stream().0.first_chunk().unwrap()).unwrap();
        let header = StreamHeader { version: FormatVersion::V2, ..header };
        let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
        writer.write_metadata(&MetadataText::new(r#"{"up":"z"}"#.to_owned()).unwrap()).unwrap();
        let bytes = writer.finish().unwrap();
        assert_eq!(pieces(&bytes[..], &bytes), ["header true", r#"metadata {"up":"z"}"#, "end"]);
        let mut packets = Packets::new(&bytes[..], 0, LARGEST);
        packets.next().unwrap();
        let Some(Piece::Metadata(packet)) = packets.next().unwrap() else { panic!("metadata") };
        assert!(bytes[StreamHeader::BYTES..].starts_with(&packet), "as it stood there");
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
    fn a_packet_larger_than_allowed_is_passed_over() {
        let (bytes, places) = stream();
        let length = places[2] - places[1];
        let largest = length - isv_format::PacketHeader::BYTES - 1;
        let mut packets = Packets::new(&bytes[..], 0, u32::try_from(largest).unwrap());
        let mut frames = 0;
        let mut words = Vec::new();
        while let Some(piece) = packets.next().unwrap() {
            match piece {
                Piece::Frame { packet, .. } => {
                    assert!(packet.len() < length);
                    frames += 1;
                }
                Piece::Damage(what) => words.push(what),
                Piece::Header(_) | Piece::Metadata(_) | Piece::End => {}
            }
        }
        assert!(
            frames < places.len() - 1 && words.iter().any(|words| words.contains("above the limit")),
            "{words:?}"
        );
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
