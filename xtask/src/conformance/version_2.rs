//! Streams of version 2 of the container: packets that are skipped, and what must be refused. Colour parts are not among them yet, but
//! where they do not fit their payload.

use super::Stream;
use super::extremes::{frame_of_ones, judged, keyframe, small_main, small_paper};
use super::raw::RawStream;
use super::refused::{Refused, case, flipped, with_header};
use anyhow::Result;
use isv::raw::decode::RefusalClass::{Cut, Damaged, Limit, Malformed, Unsupported};
use isv::raw::format::{ColourLayers, FormatVersion, PacketHeader, PacketKind, Prediction, StreamHeader};

/// Streams that decode, by name.
pub(super) fn streams() -> Result<Vec<(&'static str, Stream)>> {
    let (paper, main) = (second(small_paper()?), second(small_main()?));
    Ok(vec![
        ("version_2_no_frames_no_index", judged(RawStream::new(&paper).bytes)?),
        ("version_2_skipped", skipped(&main)?),
        ("version_2_skipped_no_index", skipped_no_index(&paper)?),
        ("version_2_colour_absent", colour_absent(&main.with_colour(ColourLayers::QuarterVoxels))?),
    ])
}

/// Returns the header in version 2.
fn second(header: StreamHeader) -> StreamHeader {
    StreamHeader { version: FormatVersion::V2, ..header }
}

/// A packet to skip that holds what looks like a frame's: a reader that searches its payload finds a false one.
fn frame_in_disguise(header: &StreamHeader) -> Vec<u8> {
    let payload = keyframe(header, &[[9; 3]], 0).to_bytes();
    let kind = PacketKind::Frame { keyframe: true, hashed: false, colour: false };
    [&PacketHeader::seal(kind, 0, 1 << 40, &payload)[..], &payload].concat()
}

/// Packets to skip before the first frame, between frames of a GOP, before a keyframe and before the index.
fn skipped(header: &StreamHeader) -> Result<Stream> {
    let mut stream = RawStream::new(header);
    let key = keyframe(header, &[[0; 3], [1, 0, 0]], 1).to_bytes();
    // Of two neighbouring blocks and the blocks around them.
    let predicted = frame_of_ones(header, Prediction::ThreeDof, 36).to_bytes();
    stream.unknown(0x80, 0, 0, 0, &[]);
    stream.unknown(0xff, 0xff, u16::MAX, u64::MAX, b"flags, count and time of unknown types mean nothing");
    stream.frame(true, 0, false, &key);
    stream.unknown(0x81, 1, 0, 1, &frame_in_disguise(header));
    stream.frame(false, 1, false, &predicted);
    stream.unknown(0x82, 0, 1, 2, &[0; 5000]);
    stream.unknown(0x82, 0, 1, 2, &[0; 5000]);
    stream.frame(true, 2, false, &key);
    stream.unknown(0x80, 0, 0, 3, &header.to_bytes());
    judged(stream.finish())
}

/// A stream that ends behind a packet to skip.
fn skipped_no_index(header: &StreamHeader) -> Result<Stream> {
    let mut stream = RawStream::new(header);
    stream.frame(true, 0, false, &keyframe(header, &[[0; 3]], 0).to_bytes());
    stream.unknown(0x90, 0, 0, 0, b"ISVP");
    judged(stream.bytes)
}

/// Frames without colour in a stream that may have some.
fn colour_absent(header: &StreamHeader) -> Result<Stream> {
    let mut stream = RawStream::new(header);
    stream.frame(true, 0, false, &keyframe(header, &[[0; 3]], 0).to_bytes());
    judged(stream.finish())
}

/// Streams that every decoder must refuse.
pub(super) fn refused() -> Result<Vec<Refused>> {
    let mut cases = headers()?;
    cases.extend(unknown_types()?);
    cases.extend(colour_parts()?);
    Ok(cases)
}

fn headers() -> Result<Vec<Refused>> {
    let (paper, main) = (small_paper()?, second(small_main()?));
    let version_3 = with_header(&paper, 8, &[3, 0]);
    let byte_15 = |name, header: &StreamHeader, byte| {
        case(name, with_header(header, 15, &[byte]), 0, Malformed, "byte 15")
    };
    Ok(vec![
        case("version_3", version_3.clone(), 0, Unsupported, "version 3"),
        case("version_3_other_checksum", flipped(&version_3, 20), 0, Unsupported, "version 3"),
        case("version_3_short", version_3[..10].to_vec(), 0, Unsupported, "version 3"),
        byte_15("version_2_byte_15_bit_3", &main, 1 << 3),
        byte_15("version_2_byte_15_bit_7", &main, 1 << 7 | 1),
        byte_15("version_2_colour_in_paper", &second(paper), 1),
        byte_15("version_2_cells_in_paper", &second(paper), 1 << 2),
        byte_15("version_1_cells", &small_main()?, 1 << 2),
    ])
}

fn unknown_types() -> Result<Vec<Refused>> {
    let header = small_main()?;
    let after_one = |header: &StreamHeader, code: u8| {
        let mut stream = RawStream::new(header);
        stream.frame(true, 0, false, &keyframe(header, &[[0; 3]], 0).to_bytes());
        let place = stream.bytes.len();
        stream.unknown(code, 0, 0, 0, b"what it is, a later version says");
        (stream.bytes, place)
    };
    let second = second(header);
    let (must_know, place) = after_one(&second, 3);
    let (may_skip, _) = after_one(&second, 0x83);
    let mut too_long = may_skip.clone();
    too_long[place + 8..place + 12].copy_from_slice(&((1u32 << 30) + 1).to_le_bytes());
    let last = must_know.len() - 1;
    Ok(vec![
        case("version_1_type_128", after_one(&header, 0x80).0, 1, Malformed, "type 128"),
        case("version_1_type_131", after_one(&header, 0x83).0, 1, Malformed, "type 131"),
        case("version_2_type_0", after_one(&second, 0).0, 1, Unsupported, "type 0"),
        case("version_2_type_3", must_know.clone(), 1, Unsupported, "type 3"),
        case("version_2_type_127", after_one(&second, 127).0, 1, Unsupported, "type 127"),
        // Until the checksum has been compared, magic and length are all that is looked at.
        case("version_2_type_3_bit", flipped(&must_know, last), 1, Damaged, "packet"),
        case("version_2_type_3_cut", must_know[..last].to_vec(), 1, Cut, "packet"),
        case("version_2_skipped_bit", flipped(&may_skip, last), 1, Damaged, "packet"),
        case("version_2_skipped_cut", may_skip[..last].to_vec(), 1, Cut, "packet"),
        case("version_2_skipped_above_limit", too_long, 1, Limit, "payload"),
    ])
}

fn colour_parts() -> Result<Vec<Refused>> {
    let header = second(small_main()?);
    let coloured = header.with_colour(ColourLayers::Voxels);
    let geometry = keyframe(&header, &[[0; 3]], 0).to_bytes();
    let ending = |length: u32| [&geometry[..], &length.to_le_bytes()].concat();
    let after_one = |header: &StreamHeader, colour, payload: &[u8]| {
        let mut stream = RawStream::new(header);
        stream.frame(true, 0, false, &geometry);
        let kind = PacketKind::Frame { keyframe: true, hashed: false, colour };
        stream.packet(kind, 0, 0, payload);
        stream.bytes
    };
    let flag_3 = {
        let mut stream = RawStream::new(&coloured);
        stream.frame(true, 0, false, &geometry);
        stream.unknown(1, 1 << 3 | 1, 0, 0, &geometry);
        stream.bytes
    };
    let beyond = geometry.len() as u32 + 1;
    Ok(vec![
        case("version_2_colour_without_layers", after_one(&header, true, &ending(0)), 1, Malformed, "flags"),
        case("version_2_flag_3", flag_3, 1, Malformed, "flags"),
        case("version_2_colour_beyond", after_one(&coloured, true, &ending(beyond)), 1, Malformed, "colour"),
        case("version_2_colour_4_gib", after_one(&coloured, true, &ending(u32::MAX)), 1, Malformed, "colour"),
        case("version_2_colour_of_3_bytes", after_one(&coloured, true, &[0; 3]), 1, Malformed, "colour"),
        case("version_2_colour_alone", after_one(&coloured, true, &ending(beyond - 1)), 1, Malformed, ""),
        // Without the flag the same bytes are geometry, and too many.
        case("version_2_colour_unsaid", after_one(&coloured, false, &ending(0)), 1, Malformed, "left over"),
    ])
}
