//! Version 2 of the container, in all ways of reading a stream. Colour parts are kept apart, and packets of unknown types are
//! skipped or stop a reader.

use isv_format::{
    ColourLayers, FormatError, FormatVersion, FrameCoding, FrameHeader, FrameKind, FramePayload, FrameRate,
    MOST_METADATA_BYTES, MainFrameHeader, MetadataText, Packet, PacketHeader, PacketKind, PacketReader,
    PacketWriter, Piece, Profile, RefusalClass, Resynchroniser, SalvageReader, Salvaged, SlicePayload,
    StreamHeader, StreamIndex,
};
use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};
use std::io::{Cursor, Read};

const FRAMES: usize = 4;
/// A type that readers may skip, and one that they must know.
const SKIPPABLE: u8 = 0x93;
const NEEDED: u8 = 0x13;

fn header() -> StreamHeader {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    StreamHeader::new(Profile::Main, grid, FrameRate::DEFAULT).with_colour(ColourLayers::Voxels)
}

/// A header of version 1.
fn first_version() -> StreamHeader {
    StreamHeader { version: FormatVersion::V1, colour_layers: ColourLayers::None, ..header() }
}

fn frame(kind: FrameKind, coefficients: &[u8]) -> FramePayload<'_> {
    let main = MainFrameHeader {
        kind,
        step: 1000,
        filter: 0,
        filter_limit: 0,
        half_voxel_vectors: false,
        no_spatial_prediction: false,
    };
    FramePayload {
        header: FrameHeader { blocks: 1, slices: 1, coding: FrameCoding::Main(main), volume_hash: None },
        block_set: &[7],
        masks: &[],
        slices: vec![SlicePayload { modes: &[], coefficients }],
    }
}

/// The colour part of a frame; the second one has none.
fn colour(number: usize) -> Option<Vec<u8>> {
    (number != 1).then(|| vec![number as u8; 10 * number])
}

/// Frames of which the first is a keyframe.
fn stream(header: &StreamHeader, colour: impl Fn(usize) -> Option<Vec<u8>>) -> Vec<u8> {
    let mut writer = PacketWriter::new(Vec::new(), header).unwrap();
    for number in 0..FRAMES {
        let coefficients = [number as u8; 30];
        let kind = if number == 0 { FrameKind::Intra } else { FrameKind::Resilient };
        let (frame, colour) = (frame(kind, &coefficients), colour(number));
        writer.write_coloured_frame(number == 0, number as u64, &frame, colour.as_deref()).unwrap();
    }
    writer.finish().unwrap()
}

/// A whole packet of an unknown type, its other fields at random.
fn unknown(code: u8, payload: &[u8]) -> Vec<u8> {
    [&PacketHeader::seal(PacketKind::Skippable { code }, 77, 1 << 50, payload)[..], payload].concat()
}

fn frames(bytes: &[u8]) -> Vec<Packet> {
    let mut reader = PacketReader::new(bytes).unwrap();
    std::iter::from_fn(|| reader.next_frame().unwrap()).collect()
}

/// The stream with packets before each of its frames and before its index, which is made anew.
fn with_packets(bytes: &[u8], between: &[u8]) -> Vec<u8> {
    let mut out = bytes[..StreamHeader::BYTES].to_vec();
    let mut index = StreamIndex::default();
    for packet in frames(bytes) {
        out.extend(between);
        index.frames.push(isv_format::IndexEntry { at: out.len() as u64, keyframe: packet.is_keyframe() });
        out.extend(packet.to_bytes());
    }
    out.extend(between);
    let at = out.len() as u64;
    let payload = index.to_payload();
    out.extend(PacketHeader::seal(PacketKind::Index, 0, 0, &payload));
    out.extend(payload);
    out.extend(StreamIndex::trailer(at));
    out
}

/// Payloads, in order.
fn payloads(packets: &[Packet]) -> Vec<&[u8]> {
    packets.iter().map(|packet| &packet.payload[..]).collect()
}

#[test]
fn colour_parts_roundtrip_and_geometry_is_as_without() {
    let (plain, coloured) = (stream(&first_version(), |_| None), stream(&header(), colour));
    let (plain, coloured) = (frames(&plain), frames(&coloured));
    for (number, (plain, coloured)) in plain.iter().zip(&coloured).enumerate() {
        assert_eq!(coloured.geometry().unwrap(), plain.payload);
        assert_eq!(coloured.colour().unwrap(), colour(number).as_deref());
        assert_eq!(coloured.geometry_packet_bytes(), plain.total_bytes());
        assert_eq!((plain.colour().unwrap(), plain.geometry().unwrap()), (None, &plain.payload[..]));
        assert!(coloured.is_entry(&Profile::Main));
    }
}

#[test]
fn copies_keep_colour_parts() {
    let bytes = stream(&header(), colour);
    let mut writer = PacketWriter::new(Vec::new(), &header()).unwrap();
    for packet in frames(&bytes) {
        writer.copy_frame(&packet, packet.header.timestamp_ns).unwrap();
    }
    assert_eq!(writer.finish().unwrap(), bytes);
}

#[test]
#[should_panic(expected = "without colour")]
fn a_stream_without_layers_takes_no_colour() {
    let mut writer = PacketWriter::new(Vec::new(), &first_version()).unwrap();
    let _ = writer.write_coloured_frame(true, 0, &frame(FrameKind::Intra, &[]), Some(b"colour"));
}

#[test]
fn the_flag_of_colour_needs_layers() {
    let coloured = frames(&stream(&header(), colour)).remove(0).to_bytes();
    let second = StreamHeader { version: FormatVersion::V2, ..first_version() };
    for header in [first_version(), second] {
        let bytes = [&header.to_bytes()[..], &coloured].concat();
        let error = PacketReader::new(&bytes[..]).unwrap().next_packet().unwrap_err();
        assert!(matches!(error, FormatError::Malformed { at: 48, .. }), "{error}");
    }
}

#[test]
fn packets_to_skip_change_nothing_in_any_way_of_reading() {
    let whole = stream(&header(), colour);
    let disguised = frames(&whole).remove(3).to_bytes();
    let between = [unknown(SKIPPABLE, &disguised), unknown(0xff, &[]), unknown(0x81, &[5; 9000])].concat();
    let bytes = with_packets(&whole, &between);
    let (expected, found) = (frames(&whole), frames(&bytes));
    assert_eq!(payloads(&found), payloads(&expected));
    let mut reader = PacketReader::new(&bytes[..]).unwrap();
    while reader.next_frame().unwrap().is_some() {}
    assert!(reader.complete());
    assert_eq!((reader.skipped(), reader.at()), (3 * (FRAMES + 1), bytes.len() as u64));
    // By index, and by one that is made where the end is lost or damaged.
    let index = StreamIndex::load(&mut Cursor::new(&bytes)).unwrap();
    assert!(index.frames.iter().map(|frame| frame.at).eq(found.iter().map(|packet| packet.at)));
    let cut = bytes.len() - StreamIndex::TRAILER_BYTES;
    assert_eq!(StreamIndex::load(&mut Cursor::new(&bytes[..cut])).unwrap(), index);
    let mut damaged = bytes.clone();
    damaged[cut - 3] ^= 0x10;
    assert_eq!(StreamIndex::load(&mut Cursor::new(&damaged)).unwrap(), index);
    // Past damage.
    let mut salvage = SalvageReader::new(&bytes[..]).unwrap();
    let salvaged: Vec<Salvaged> = std::iter::from_fn(|| salvage.next_frame().unwrap()).collect();
    assert!(salvaged.iter().zip(&found).all(|(a, b)| *a == Salvaged::Frame(b.clone())));
    assert!(salvaged.len() == FRAMES && salvage.complete() && salvage.skipped() == reader.skipped());
}

/// A packet of metadata.
fn metadata(text: &[u8]) -> Vec<u8> {
    [&PacketHeader::seal(PacketKind::Metadata, 0, 0, text)[..], text].concat()
}

#[test]
fn the_first_metadata_before_the_first_frame_count() {
    let whole = stream(&header(), colour);
    let read = |bytes: &[u8]| {
        let mut reader = PacketReader::new(bytes).unwrap();
        let mut salvage = SalvageReader::new(bytes).unwrap();
        let frames = std::iter::from_fn(|| reader.next_frame().unwrap()).count();
        assert_eq!(std::iter::from_fn(|| salvage.next_frame().unwrap()).count(), frames);
        assert!(frames == FRAMES && reader.complete() && reader.skipped() == 0);
        assert_eq!(reader.metadata(), salvage.metadata());
        reader.metadata().map(|text| text.as_str().to_owned())
    };
    let (first, second) = (metadata(b"{\"title\":\"a\"}"), metadata(b"{}"));
    let long = metadata(&vec![b' '; MOST_METADATA_BYTES + 1]);
    let begin = StreamHeader::BYTES;
    let behind_header = |packets: &[u8]| {
        let mut bytes = whole[..begin].to_vec();
        bytes.extend(packets);
        // Frames as they are: places in the index are others, and nobody asks for them here.
        frames(&whole).iter().for_each(|packet| bytes.extend(packet.to_bytes()));
        bytes
    };
    let read_cut = |packets: &[u8]| {
        let bytes = behind_header(packets);
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        while reader.next_frame().unwrap().is_some() {}
        reader.metadata().map(|text| text.as_str().to_owned())
    };
    assert_eq!(read(&whole), None);
    assert_eq!(read_cut(&[&first[..], &second].concat()).as_deref(), Some("{\"title\":\"a\"}"));
    assert_eq!(read_cut(&[&long[..], &second].concat()).as_deref(), Some("{}"), "a long one is passed over");
    assert_eq!(read_cut(&[&metadata(b"\xff")[..], &second].concat()).as_deref(), Some("{}"), "no text");
    let late = [&behind_header(&[])[..], &second].concat();
    let mut reader = PacketReader::new(&late[..]).unwrap();
    while reader.next_frame().unwrap().is_some() {}
    assert_eq!(reader.metadata(), None, "behind the frames it is too late");
    let mut writer = PacketWriter::new(Vec::new(), &header()).unwrap();
    writer.write_metadata(&MetadataText::new("{}".to_owned()).unwrap()).unwrap();
    frames(&whole)
        .iter()
        .for_each(|packet| _ = writer.copy_frame(packet, packet.header.timestamp_ns).unwrap());
    assert_eq!(read(&writer.finish().unwrap()).as_deref(), Some("{}"));
    assert_eq!(MetadataText::new(" ".repeat(MOST_METADATA_BYTES + 1)), None);
}

#[test]
fn a_damaged_packet_to_skip_costs_itself_alone() {
    let between = unknown(SKIPPABLE, b"something");
    let whole = with_packets(&stream(&header(), colour), &between);
    let first = StreamHeader::BYTES;
    for at in first..first + between.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x20;
        let error = PacketReader::new(&bytes[..]).unwrap().next_frame().unwrap_err();
        let of_packet = at - first;
        if matches!(of_packet, 4..8 | 12..) {
            assert_eq!(error.class(), Some(RefusalClass::Damaged), "byte {of_packet}: {error}");
        }
        let mut salvage = SalvageReader::new(&bytes[..]).unwrap();
        let damage = Salvaged::Damage { at: first as u64, bytes: between.len() as u64 };
        assert_eq!(salvage.next_frame().unwrap(), Some(damage), "byte {of_packet}");
        assert_eq!(std::iter::from_fn(|| salvage.next_frame().unwrap()).count(), FRAMES);
    }
}

#[test]
fn what_must_be_known_stops_readers() {
    let whole = stream(&header(), colour);
    let first = frames(&whole).remove(0).to_bytes();
    let needed =
        [&whole[..48 + first.len()], &unknown(NEEDED, b"needed"), &whole[48 + first.len()..]].concat();
    let needed_at = 48 + first.len() as u64;
    let is_newer = |error: &FormatError| {
        assert_eq!(error.class(), Some(RefusalClass::Unsupported));
        matches!(error, FormatError::PacketType { found: NEEDED, at } if *at == needed_at)
    };
    let mut reader = PacketReader::new(&needed[..]).unwrap();
    assert!(reader.next_frame().unwrap().is_some());
    assert!(is_newer(&reader.next_frame().unwrap_err()));
    let mut salvage = SalvageReader::new(&needed[..]).unwrap();
    assert!(matches!(salvage.next_frame().unwrap(), Some(Salvaged::Frame(_))));
    assert!(is_newer(&salvage.next_frame().unwrap_err()));
    // A live reader goes on at the next stream, and tells once why.
    let bytes = [&needed[..], &whole].concat();
    let mut live = Resynchroniser::new(&bytes[..]);
    let pieces: Vec<Piece> =
        std::iter::from_fn(|| live.next_piece().unwrap()).map(|(_, piece)| piece).collect();
    assert!(matches!(&pieces[2], Piece::Unsupported(error) if is_newer(error)));
    assert!(matches!(pieces[3], Piece::Header(_)));
    assert_eq!(pieces.len(), 3 + 1 + FRAMES + 1);
    assert!(!pieces.iter().any(|piece| matches!(piece, Piece::Damage(_))));
}

#[test]
fn a_damaged_type_is_damage_and_no_newer_version() {
    let mut bytes = stream(&header(), colour);
    bytes[48 + 4] = NEEDED;
    let mut salvage = SalvageReader::new(&bytes[..]).unwrap();
    assert!(matches!(salvage.next_frame().unwrap(), Some(Salvaged::Damage { at: 48, .. })));
    let error = PacketReader::new(&bytes[..]).unwrap().next_packet().unwrap_err();
    assert_eq!(error.class(), Some(RefusalClass::Damaged));
}

#[test]
fn version_1_knows_all_types() {
    for code in [SKIPPABLE, NEEDED] {
        let bytes = [&first_version().to_bytes()[..], &unknown(code, b"x")].concat();
        let error = PacketReader::new(&bytes[..]).unwrap().next_packet().unwrap_err();
        assert!(matches!(error, FormatError::Malformed { at: 48, .. }), "{error}");
        let mut salvage = SalvageReader::new(&bytes[..]).unwrap();
        assert!(matches!(salvage.next_frame().unwrap(), Some(Salvaged::Damage { at: 48, bytes: 25 })));
    }
}

/// A source of zeros after its bytes.
struct Endless<'a>(&'a [u8], usize);

impl Read for Endless<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.0.is_empty() {
            self.1 = self.1.max(buffer.len());
            buffer.fill(0);
            return Ok(buffer.len());
        }
        self.0.read(buffer)
    }
}

#[test]
fn a_payload_to_skip_is_not_held_and_is_bounded() {
    let mut fields = unknown(SKIPPABLE, &[]);
    let length = 1u32 << 26;
    fields[8..12].copy_from_slice(&length.to_le_bytes());
    let bytes = [&header().to_bytes()[..], &fields].concat();
    let mut source = Endless(&bytes, 0);
    let error = PacketReader::new(&mut source).unwrap().next_packet().unwrap_err();
    assert_eq!(error.class(), Some(RefusalClass::Damaged));
    assert!(source.1 <= 1 << 16, "{} bytes at once", source.1);
    let reader = PacketReader::new(&bytes[..]).unwrap().with_largest_payload(length - 1);
    assert_eq!({ reader }.next_packet().unwrap_err().class(), Some(RefusalClass::Limit));
}
