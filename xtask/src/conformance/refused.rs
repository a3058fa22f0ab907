//! Streams that must be refused, and some that may be.

use super::cells::by_cell;
use super::extremes::{MAIN, frame_of_ones, keyframe, small_main, small_paper};
use super::raw::{RawFrame, RawStream, crc32, judge, octree, segment};
use anyhow::{Context, Result, bail, ensure};
use isv::raw::decode::DecodeError;
use isv::raw::decode::RefusalClass::{self, Cut, Damaged, Foreign, Limit, Malformed, Missing, Unsupported};
use isv::raw::encode::{Encoder, EncoderSettings, MotionMode};
use isv::raw::format::{
    FrameCoding, FrameKind, MainFrameHeader, PacketKind, PaperParameters, Prediction, Profile, StreamHeader,
    StreamIndex,
};
use isv::raw::volume::{BlockEdge, Grid};
use isv_entropy::{BitModel, IntegerModel, RangeEncoder};
use isv_testkit::{Random, ball};

/// A stream that is refused after some frames, and what our decoder has to say of it.
pub(super) struct Refused {
    pub(super) name: &'static str,
    pub(super) bytes: Vec<u8>,
    pub(super) frames: usize,
    pub(super) class: RefusalClass,
    says: &'static str,
}

impl Refused {
    /// Compares what our decoder says of the stream: the frames before the refusal, and why it refuses.
    pub(super) fn check(&self, frames: usize, error: Option<DecodeError>) -> Result<()> {
        let error = error.with_context(|| format!("{} is accepted", self.name))?;
        let found = (frames, error.class());
        ensure!(found == (self.frames, Some(self.class)), "{}: {found:?}: {error}", self.name);
        ensure!(error.to_string().contains(self.says), "{}: {error}", self.name);
        Ok(())
    }
}

pub(super) fn case(
    name: &'static str,
    bytes: Vec<u8>,
    frames: usize,
    class: RefusalClass,
    says: &'static str,
) -> Refused {
    Refused { name, bytes, frames, class, says }
}

/// Streams that every decoder must refuse.
pub(super) fn streams() -> Result<Vec<Refused>> {
    let mut cases = header_cases()?;
    cases.extend(packet_cases()?);
    cases.extend(payload_cases()?);
    cases.extend(symbol_cases()?);
    cases.extend(super::version_2::refused()?);
    for case in &cases {
        let (frames, error) = judge(&case.bytes);
        case.check(frames.len(), error)?;
    }
    Ok(cases)
}

/// Streams of which a decoder may skip what is wrong: the index, the trailer and volume hashes.
pub(super) fn optional_streams() -> Result<Vec<Refused>> {
    let header = small_paper()?;
    let good = || -> Result<RawStream> { one_frame(&header) };
    let index = |payload: &[u8]| -> Result<Vec<u8>> {
        let mut stream = good()?;
        stream.finish_with(payload);
        Ok(stream.bytes)
    };
    let entry = |at: u64| (at << 1 | 1).to_le_bytes();
    let whole = good()?.finish();
    let changed = |from_end: usize, value: u8| {
        let mut bytes = whole.clone();
        let place = bytes.len() - from_end;
        bytes[place] ^= value;
        bytes
    };
    let trailer_of = |at: u64| -> Result<Vec<u8>> {
        let mut bytes = whole[..whole.len() - 16].to_vec();
        bytes.extend(StreamIndex::trailer(at));
        Ok(bytes)
    };
    // A byte of the index packet's header, its checksum right.
    let index_packet = |at: usize, value: u8| -> Result<Vec<u8>> {
        let first = good()?.bytes.len();
        let bytes = whole.clone().splice_at(first + at, &[value]);
        let packet = &bytes[first..bytes.len() - 16];
        let checksum = crc32(&[&packet[..20], &packet[24..]].concat());
        Ok(bytes.splice_at(first + 20, &checksum.to_le_bytes()))
    };
    let mut hash = RawStream::new(&header);
    let mut frame = keyframe(&header, &[[0; 3]], 0);
    frame.header.volume_hash = Some(0x0123_4567_89ab_cdef);
    hash.frame(true, 0, true, &frame.to_bytes());
    Ok(vec![
        case("volume_hash", hash.finish(), 0, Damaged, "hash"),
        case("index_descends", index(&[entry(100), entry(48)].concat())?, 1, Malformed, "index"),
        case("index_in_stream_header", index(&entry(24))?, 1, Malformed, "index"),
        case("index_beyond_itself", index(&entry(1 << 40))?, 1, Malformed, "index"),
        case("index_of_7_bytes", index(&[0; 7])?, 1, Malformed, "index"),
        case("trailer_checksum", changed(1, 0x40), 1, Damaged, "trailer"),
        case("trailer_magic_bit", changed(6, 0x40), 1, Malformed, "trailer"),
        case("trailer_cut", whole[..whole.len() - 5].to_vec(), 1, Cut, "trailer"),
        case("index_cut", whole[..whole.len() - 20].to_vec(), 1, Cut, "packet"),
        case("index_checksum", changed(17, 1), 1, Damaged, "packet"),
        case("after_the_trailer", [&whole[..], &[0; 9]].concat(), 1, Malformed, ""),
        case("index_entries_23_apart", index(&[entry(48), entry(71)].concat())?, 1, Malformed, "index"),
        case("index_at_itself", index(&entry(good()?.bytes.len() as u64))?, 1, Malformed, "index"),
        case("index_at_elsewhere", trailer_of(good()?.bytes.len() as u64 + 1)?, 1, Malformed, "trailer"),
        case("index_at_48", trailer_of(48)?, 1, Malformed, "trailer"),
        case("index_flag", index_packet(5, 1)?, 1, Malformed, "flags"),
        case("index_flag_7", index_packet(5, 0x80)?, 1, Malformed, "flags"),
        case("index_byte_6", index_packet(6, 1)?, 1, Malformed, ""),
        case("index_byte_7", index_packet(7, 1)?, 1, Malformed, ""),
        case("index_without_trailer", whole[..whole.len() - 16].to_vec(), 1, Cut, "trailer"),
    ])
}

/// A stream of one frame, which decodes.
fn one_frame(header: &StreamHeader) -> Result<RawStream> {
    let mut stream = RawStream::new(header);
    stream.frame(true, 0, false, &keyframe(header, &[[0; 3]], 0).to_bytes());
    Ok(stream)
}

/// A stream without frames, bytes of its header changed, its checksum right.
pub(super) fn with_header(header: &StreamHeader, at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut out = header.to_bytes().to_vec();
    out[at..at + bytes.len()].copy_from_slice(bytes);
    let checksum = crc32(&out[..44]);
    out[44..].copy_from_slice(&checksum.to_le_bytes());
    out
}

fn header_cases() -> Result<Vec<Refused>> {
    let (paper, main) = (small_paper()?, small_main()?);
    let wrong = |name, header: &StreamHeader, at, bytes: &[u8], class| {
        case(name, with_header(header, at, bytes), 0, class, "")
    };
    let mut damaged = one_frame(&paper)?.bytes;
    damaged[20] ^= 4;
    let magic = paper.to_bytes()[..8].to_vec();
    let unsealed = |at: usize, bytes: &[u8]| paper.to_bytes().to_vec().splice_at(at, bytes);
    Ok(vec![
        wrong("magic", &paper, 0, b"\x88ISV", Foreign),
        case(
            "text",
            b"ISV is what this text begins with, and it goes on for a while.".to_vec(),
            0,
            Foreign,
            "",
        ),
        wrong("version_0", &paper, 8, &[0, 0], Unsupported),
        case(
            "version_2_other_checksum",
            one_frame(&paper)?.bytes.splice_at(8, &[2]),
            0,
            Damaged,
            "stream header",
        ),
        wrong("profile_2", &paper, 12, &[2], Unsupported),
        wrong("header_length_47", &paper, 10, &[47, 0], Malformed),
        wrong("header_length_52", &main, 10, &[52, 0], Malformed),
        wrong("edge_2", &paper, 13, &[1], Malformed),
        wrong("edge_32", &paper, 13, &[5], Malformed),
        wrong("edge_log2_255", &paper, 13, &[255], Malformed),
        wrong("main_edge_4", &main, 13, &[2], Malformed),
        wrong("main_edge_16", &main, 13, &[4], Malformed),
        wrong("truncation_1", &paper, 14, &[1], Malformed),
        wrong("truncation_17", &main, 14, &[17], Malformed),
        wrong("header_byte_15", &paper, 15, &[1], Malformed),
        wrong("voxel_999_nm", &paper, 16, &999u64.to_le_bytes(), Malformed),
        wrong("voxel_above_a_kilometre", &main, 16, &1_000_000_000_001u64.to_le_bytes(), Malformed),
        wrong("rate_numerator_0", &paper, 24, &[0; 4], Malformed),
        wrong("rate_denominator_0", &main, 28, &[0; 4], Malformed),
        wrong("coefficients_0", &paper, 32, &[0; 2], Malformed),
        wrong("coefficients_65", &paper, 32, &[65, 0], Malformed),
        wrong("header_byte_34", &paper, 34, &[1, 0], Malformed),
        wrong("dc_step_0", &paper, 36, &[0; 4], Malformed),
        wrong("dc_step_above", &paper, 36, &((1u32 << 20) + 1).to_le_bytes(), Malformed),
        wrong("ac_step_0", &paper, 40, &[0; 4], Malformed),
        wrong("ac_step_above", &paper, 40, &((1u32 << 20) + 1).to_le_bytes(), Malformed),
        wrong("main_coefficients", &main, 32, &[64, 0], Malformed),
        wrong("main_header_byte_35", &main, 35, &[1], Malformed),
        wrong("main_dc_step", &main, 36, &[1], Malformed),
        wrong("main_ac_step", &main, 43, &[1], Malformed),
        case("header_checksum", damaged, 0, Damaged, "stream header"),
        case("header_cut", paper.to_bytes()[..20].to_vec(), 0, Cut, "stream header"),
        case("version_2_short", with_header(&paper, 8, &[2, 0])[..10].to_vec(), 0, Cut, "stream header"),
        case("empty", Vec::new(), 0, Cut, "stream header"),
        case("bytes_1", magic[..1].to_vec(), 0, Cut, "stream header"),
        case("bytes_1_foreign", b"I".to_vec(), 0, Foreign, ""),
        case("bytes_7", magic[..7].to_vec(), 0, Cut, "stream header"),
        case("bytes_7_foreign", magic[..7].to_vec().splice_at(6, b"x"), 0, Foreign, ""),
        case("bytes_8", magic.clone(), 0, Cut, "stream header"),
        case("bytes_9", [&magic[..], &[2]].concat(), 0, Cut, "stream header"),
        // Of what is wrong the checksum comes first, but for magic and version.
        case("length_47_other_checksum", unsealed(10, &[47, 0]), 0, Damaged, "stream header"),
        case("profile_2_other_checksum", unsealed(12, &[2]), 0, Damaged, "stream header"),
        // Then the fields in their order.
        wrong("length_47_and_profile_2", &paper, 10, &[47, 0, 2], Malformed),
        wrong("profile_2_and_edge_32", &paper, 12, &[2, 5], Unsupported),
    ])
}

/// Bytes with some of them replaced.
trait SpliceAt {
    fn splice_at(self, at: usize, bytes: &[u8]) -> Self;
}

impl SpliceAt for Vec<u8> {
    fn splice_at(mut self, at: usize, bytes: &[u8]) -> Self {
        self[at..at + bytes.len()].copy_from_slice(bytes);
        self
    }
}

fn packet_cases() -> Result<Vec<Refused>> {
    let header = small_paper()?;
    let good = one_frame(&header)?;
    let first = good.bytes.len();
    let payload = frame_of_ones(&header, Prediction::ZeroMotion, 1).to_bytes();
    // A second packet, bytes of whose header are changed, its checksum right.
    let changed = |at: usize, bytes: &[u8]| {
        let mut stream = good.clone();
        stream.frame(false, 0, false, &payload);
        let mut out = stream.bytes.splice_at(first + at, bytes);
        let checksum = crc32(&[&out[first..first + 20], &out[first + 24..]].concat());
        out[first + 20..first + 24].copy_from_slice(&checksum.to_le_bytes());
        out
    };
    let since = |keyframe: bool, since: u16| {
        let mut stream = good.clone();
        let payload = if keyframe { keyframe_bytes(&header) } else { payload.clone() };
        stream.packet(PacketKind::Frame { keyframe, hashed: false, colour: false }, since, 0, &payload);
        stream.bytes
    };
    let whole = changed(0, b"I");
    // A first packet that is no keyframe, with these flags.
    let without_keyframe = |flags: u8, payload: &[u8]| {
        let mut stream = RawStream::new(&header);
        stream.packet(PacketKind::Frame { keyframe: false, hashed: false, colour: false }, 1, 0, payload);
        let bytes = stream.bytes.splice_at(48 + 5, &[flags]);
        let checksum = crc32(&[&bytes[48..68], &bytes[72..]].concat());
        bytes.splice_at(68, &checksum.to_le_bytes())
    };
    let mut first_is_none = RawStream::new(&header);
    first_is_none.frame(false, 0, false, &payload);
    Ok(vec![
        case("packet_magic", changed(0, b"ISVQ"), 1, Malformed, "no packet"),
        case("packet_type_0", changed(4, &[0]), 1, Malformed, "type 0"),
        case("packet_type_3", changed(4, &[3]), 1, Malformed, "type 3"),
        case("packet_flag_2", changed(5, &[4]), 1, Malformed, "flags"),
        case("packet_flag_7", changed(5, &[0x80]), 1, Malformed, "flags"),
        case("keyframe_counts", since(true, 1), 1, Malformed, "counts frames"),
        case("payload_above_limit", changed(8, &((1u32 << 30) + 1).to_le_bytes()), 1, Limit, "payload"),
        case("payload_of_4_gib", changed(8, &[255; 4]), 1, Limit, "payload"),
        case("payload_of_1_gib_cut", changed(8, &(1u32 << 30).to_le_bytes()), 1, Cut, "packet"),
        case("packet_checksum", whole.clone().splice_at(first + 21, &[0xaa]), 1, Damaged, "packet"),
        case("payload_bit", flipped(&whole, whole.len() - 9), 1, Damaged, "packet"),
        case("timestamp_bit", flipped(&whole, first + 13), 1, Damaged, "packet"),
        case("packet_header_cut", whole[..first + 23].to_vec(), 1, Cut, "packet header"),
        case("payload_cut", whole[..whole.len() - 1].to_vec(), 1, Cut, "packet"),
        case("payload_absent", whole[..first + 24].to_vec(), 1, Cut, "packet"),
        case("no_keyframe", first_is_none.bytes, 0, Missing, "keyframe"),
        case("packet_left_out", since(false, 2), 1, Missing, "missing"),
        case("packet_twice", since(false, 0), 1, Missing, "missing"),
        // Until the checksum has been compared, magic and length are all that is looked at.
        case("type_bit", flipped(&whole, first + 4), 1, Damaged, "packet"),
        case("flag_bit", flipped(&whole, first + 5), 1, Damaged, "packet"),
        case("since_keyframe_bit", flipped(&since(true, 0), first + 6), 1, Damaged, "packet"),
        case("packet_type_3_cut", changed(4, &[3])[..whole.len() - 1].to_vec(), 1, Cut, "packet"),
        case("packet_magic_cut", [&good.bytes[..], b"ISQ"].concat(), 1, Cut, "packet header"),
        case(
            "packet_magic_payload_cut",
            changed(0, b"ISVQ")[..whole.len() - 1].to_vec(),
            1,
            Malformed,
            "no packet",
        ),
        case("packet_magic_in_23_bytes", changed(0, b"ISVQ")[..first + 23].to_vec(), 1, Cut, "packet header"),
        // What is wrong with a header comes before what is missing, and that before what is wrong with a payload.
        case("flag_2_without_keyframe", without_keyframe(4, &payload), 0, Malformed, "flags"),
        case("payload_empty_without_keyframe", without_keyframe(0, &[]), 0, Missing, "keyframe"),
        case("packet_type_3_of_4_gib", changed(4, &[3]).splice_at(first + 8, &[255; 4]), 1, Limit, "payload"),
    ])
}

fn keyframe_bytes(header: &StreamHeader) -> Vec<u8> {
    keyframe(header, &[[0; 3]], 0).to_bytes()
}

pub(super) fn flipped(bytes: &[u8], at: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at] ^= 0x10;
    bytes
}

/// A good frame and then one with this payload.
fn after_one(header: &StreamHeader, keyframe: bool, payload: &[u8]) -> Result<Vec<u8>> {
    let mut stream = one_frame(header)?;
    stream.frame(keyframe, 0, false, payload);
    Ok(stream.bytes)
}

fn payload_cases() -> Result<Vec<Refused>> {
    let (paper, main) = (small_paper()?, small_main()?);
    let key = |header, payload: &[u8]| after_one(header, true, payload);
    let inter = |header, payload: &[u8]| after_one(header, false, payload);
    let paper_key = keyframe_bytes(&paper);
    let main_key = keyframe_bytes(&main);
    let coded = |change: fn(&mut MainFrameHeader)| {
        let mut frame = keyframe(&main, &[[0; 3]], 0);
        let mut fields = MAIN;
        change(&mut fields);
        frame.header.coding = FrameCoding::Main(fields);
        frame.to_bytes()
    };
    let many = PaperParameters { coefficients: 300, dc_step: 1, ac_step: 1 };
    let grid = Grid { edge: BlockEdge::E8, ..paper.grid };
    let many = StreamHeader { profile: Profile::Paper(many), grid, ..paper };
    let sliced = |header: &StreamHeader, slices: u16| {
        let mut frame = keyframe(header, &[[0; 3]], 0);
        frame.header.slices = slices;
        frame.slices = vec![[Vec::new(), vec![0; 8]]; usize::from(slices)];
        frame.to_bytes()
    };
    let prediction = |payload: &[u8], code: u8| payload.to_vec().splice_at(0, &[code]);
    let mut hashed = one_frame(&paper)?;
    hashed.frame(true, 0, true, &paper_key[..6]);
    Ok(vec![
        case("paper_prediction_4", inter(&paper, &prediction(&paper_key, 4))?, 1, Malformed, "prediction 4"),
        case("main_prediction_1", inter(&main, &prediction(&main_key, 1))?, 1, Malformed, "prediction 1"),
        case("main_prediction_3", inter(&main, &prediction(&main_key, 3))?, 1, Malformed, "prediction 3"),
        case("main_prediction_4", inter(&main, &prediction(&main_key, 4))?, 1, Malformed, "prediction 4"),
        case("main_prediction_18", inter(&main, &prediction(&main_key, 18))?, 1, Malformed, "prediction 18"),
        case("paper_keyframe_predicts", key(&paper, &prediction(&paper_key, 1))?, 1, Malformed, ""),
        case("main_keyframe_predicts", key(&main, &prediction(&main_key, 2))?, 1, Malformed, ""),
        case("main_keyframe_still_cells", key(&main, &prediction(&main_key, 6))?, 1, Malformed, ""),
        case("main_keyframe_resilient", key(&main, &prediction(&main_key, 10))?, 1, Malformed, ""),
        case(
            "varint_of_6_bytes",
            key(&paper, &[0, 0x80, 0x80, 0x80, 0x80, 0x80, 0, 1, 0, 0, 0, 0])?,
            1,
            Malformed,
            "5 bytes",
        ),
        case(
            "varint_of_33_bits",
            key(&paper, &[0, 0x81, 0x80, 0x80, 0x80, 0x10, 1, 0, 0, 0, 0])?,
            1,
            Malformed,
            "32 bits",
        ),
        case(
            "varint_of_35_bits",
            key(&paper, &[0, 0x81, 0x80, 0x80, 0x80, 0x40, 1, 0, 0, 0, 0])?,
            1,
            Malformed,
            "32 bits",
        ),
        // Lengths that add up to 2^32 more than there is.
        case("segments_wrap", key(&paper, &wrapping(&paper_key))?, 1, Malformed, "too early"),
        case("slices_0", key(&paper, &[0, 1, 0, 0, 0])?, 1, Malformed, "no slices"),
        case("slices_257", key(&main, &sliced(&main, 257))?, 1, Limit, "slices"),
        case("slices_for_300_coefficients", key(&many, &sliced(&many, 219))?, 1, Limit, "slices"),
        case("main_step_0", key(&main, &coded(|main| main.step = 0))?, 1, Malformed, "step 0"),
        case("main_step_above", key(&main, &coded(|main| main.step = (1 << 20) + 1))?, 1, Malformed, "step"),
        case("main_filter_26", key(&main, &coded(|main| main.filter = 26))?, 1, Malformed, "filter"),
        case("main_filter_63", key(&main, &coded(|main| main.filter = 63))?, 1, Malformed, "filter"),
        case("payload_empty", key(&paper, &[])?, 1, Malformed, "too early"),
        case("segments_too_long", key(&paper, &paper_key[..paper_key.len() - 1])?, 1, Malformed, "too early"),
        case("segments_too_short", key(&paper, &[&paper_key[..], &[0]].concat())?, 1, Malformed, "left over"),
        case(
            "segment_of_4_gib",
            key(&paper, &[0, 1, 1, 255, 255, 255, 255, 15, 0, 0, 0])?,
            1,
            Malformed,
            "too early",
        ),
        case("hash_cut", hashed.bytes, 1, Malformed, "too early"),
        // Several faults in one: which one comes first (7.1, 7.11).
        case(
            "keyframe_predicts_in_257_slices",
            key(&main, &prediction(&sliced(&main, 257), 2))?,
            1,
            Limit,
            "slices",
        ),
        case(
            "keyframe_predicts_many_blocks",
            key(&main, &with_blocks(&main_key, 2))?,
            1,
            Malformed,
            "predicts",
        ),
        case("many_blocks_cut", key(&paper, &with_blocks(&paper_key, 0)[..6])?, 1, Malformed, "too early"),
        case(
            "many_blocks_step_0",
            key(&main, &with_blocks(&coded(|main| main.step = 0), 0))?,
            1,
            Malformed,
            "step 0",
        ),
        case(
            "slices_for_300_coefficients_left_over",
            key(&many, &[sliced(&many, 219), vec![0]].concat())?,
            1,
            Malformed,
            "left over",
        ),
    ])
}

/// The payload of one block, in one slice of profile `paper`, whose block set and masks claim 2^32 bytes more than they have.
fn wrapping(payload: &[u8]) -> Vec<u8> {
    let [block_set, masks] = [payload[3], payload[4]];
    [&payload[..3], &[255, 255, 255, 255, 15], &[block_set + masks + 1], &payload[5..]].concat()
}

/// The payload of one block, in one slice, that claims 2^32 - 1 blocks and a prediction.
fn with_blocks(payload: &[u8], prediction: u8) -> Vec<u8> {
    [&[prediction, 255, 255, 255, 255, 15], &payload[2..]].concat()
}

/// A stream whose segment, of random bytes, makes our decoder say this; the shortest are tried first.
fn ending(says: &str, stream: impl Fn(&[u8]) -> Result<Vec<u8>>) -> Result<Vec<u8>> {
    let mut random = Random::new(1);
    for attempt in 0..600 {
        let bytes: Vec<u8> = (0..attempt / 50).map(|_| (random.signed() * 128.0) as i8 as u8).collect();
        let bytes = stream(&bytes)?;
        if judge(&bytes).1.is_some_and(|error| error.to_string().contains(says)) {
            return Ok(bytes);
        }
    }
    bail!("nothing makes our decoder say: {says}")
}

fn symbol_cases() -> Result<Vec<Refused>> {
    let (paper, main) = (small_paper()?, small_main()?);
    let early = "too early";
    let key_with = |header: &StreamHeader, change: &dyn Fn(&mut RawFrame)| -> Result<Vec<u8>> {
        let mut frame = keyframe(header, &[[0; 3]], 0);
        change(&mut frame);
        after_one(header, true, &frame.to_bytes())
    };
    // The frame before has one block, and in profile main the 26 around it.
    let inter_with = |header: &StreamHeader, prediction, change: &dyn Fn(&mut RawFrame)| -> Result<Vec<u8>> {
        let blocks = if header.profile == Profile::Main { 27 } else { 1 };
        let mut frame = frame_of_ones(header, prediction, blocks);
        if blocks == 1 {
            frame.block_set = octree(&[[0; 3]], 0);
        }
        change(&mut frame);
        after_one(header, false, &frame.to_bytes())
    };
    // The block in the corner of the range of coordinates, and a frame after it, whose symbols are all ones.
    let in_the_corner = |blocks: u32, skip_cells: bool| {
        let mut stream = RawStream::new(&main);
        stream.frame(true, 0, false, &keyframe(&main, &[[-(1 << 20); 3]], 0).to_bytes());
        let mut frame = frame_of_ones(&main, Prediction::ThreeDof, blocks);
        frame.header.coding =
            FrameCoding::Main(MainFrameHeader { kind: FrameKind::Predicted { skip_cells }, ..MAIN });
        stream.frame(false, 0, false, &frame.to_bytes());
        stream.bytes
    };
    let vector = |components: &[i32]| {
        let components = components.to_vec();
        let mut bytes = segment(|encoder: &mut RangeEncoder| {
            for component in components {
                IntegerModel::default().encode(encoder, component);
            }
        });
        bytes.extend([0; 40]);
        bytes
    };
    let main_vector = |component: i32| {
        let mut bytes = segment(|encoder: &mut RangeEncoder| {
            encoder.encode(&mut BitModel::default(), false);
            encoder.encode(&mut BitModel::default(), true);
            IntegerModel::default().encode(encoder, component);
        });
        bytes.extend([0; 60]);
        bytes
    };
    // Any masks: one. The first block: one. Then zeros for ever.
    let empty_mask = [&[0x3f, 0xff, 0x7f][..], &[0xff; 600]].concat();
    // One level, the second, so that samples have both signs.
    let crossed = |frame: &mut RawFrame| {
        frame.slices[0][1] = segment(|encoder: &mut RangeEncoder| {
            let mut decide = |bit| encoder.encode(&mut BitModel::default(), bit);
            [false, true, false, true, true].into_iter().for_each(&mut decide);
            encoder.encode_raw(0, 1);
        });
    };
    let mut depth = segment(|encoder| encoder.encode_raw(22, 5));
    depth.extend([0; 20]);
    Ok(vec![
        case("octree_depth_22", key_with(&paper, &|f| f.block_set = depth.clone())?, 1, Malformed, "root"),
        case(
            "main_octree_depth_22",
            key_with(&main, &|f| f.block_set = depth.clone())?,
            1,
            Malformed,
            "root",
        ),
        case(
            "more_blocks",
            key_with(&paper, &|f| f.block_set = octree(&[[0; 3], [1, 0, 0]], 1))?,
            1,
            Malformed,
            "more blocks",
        ),
        case("fewer_blocks", key_with(&paper, &|f| f.header.blocks = 2)?, 1, Malformed, "fewer blocks"),
        case("block_set_ends", key_with(&paper, &|f| f.block_set.clear())?, 1, Malformed, early),
        case("main_block_set_ends", key_with(&main, &|f| f.block_set.truncate(3))?, 1, Malformed, early),
        case("main_more_flags", in_the_corner(7, false), 1, Malformed, "more blocks"),
        case("main_fewer_blocks", in_the_corner(10, false), 1, Malformed, "fewer blocks"),
        case("main_block_twice", in_the_corner(9, false), 1, Malformed, "twice"),
        case("main_block_in_still_cell", in_the_corner(1, true), 1, Malformed, "stays as it is"),
        case("mask_empty", key_with(&paper, &|f| f.masks = empty_mask.clone())?, 1, Malformed, "empty"),
        case(
            "main_mask_empty",
            key_with(&main, &|f| {
                crossed(f);
                f.masks = empty_mask.clone();
            })?,
            1,
            Malformed,
            "empty",
        ),
        case(
            "version_2_cells_all_drawn",
            key_with(&by_cell(main), &|f| {
                crossed(f);
                f.masks = empty_mask.clone();
            })?,
            1,
            Malformed,
            "are drawn",
        ),
        case(
            "version_2_cells_end",
            ending("masks end", |bytes| {
                key_with(&by_cell(main), &|f| {
                    crossed(f);
                    f.masks = bytes.to_vec();
                })
            })?,
            1,
            Malformed,
            early,
        ),
        case(
            "masks_end",
            ending("masks end", |bytes| key_with(&paper, &|f| f.masks = bytes.to_vec()))?,
            1,
            Malformed,
            early,
        ),
        case(
            "main_masks_end",
            ending("masks end", |bytes| {
                key_with(&main, &|f| {
                    crossed(f);
                    f.masks = bytes.to_vec();
                })
            })?,
            1,
            Malformed,
            early,
        ),
        case(
            "translation_13",
            inter_with(&paper, Prediction::ThreeDof, &|f| f.slices[0][0] = vector(&[13]))?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "translation_minus_1000",
            inter_with(&paper, Prediction::SixDof, &|f| f.slices[0][0] = vector(&[0, -1000]))?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "rotation_33",
            inter_with(&paper, Prediction::SixDof, &|f| f.slices[0][0] = vector(&[0, 0, 0, 0, 33]))?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "main_vector_129",
            inter_with(&main, Prediction::ThreeDof, &|f| {
                quarters(f);
                f.slices[0][0] = main_vector(129);
            })?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "main_vector_minus_130",
            inter_with(&main, Prediction::ThreeDof, &|f| f.slices[0][0] = main_vector(-65))?,
            1,
            Malformed,
            "vector",
        ),
        // The lowest number of 16 bits, whose absolute value is none.
        case(
            "main_vector_minus_32768",
            inter_with(&main, Prediction::ThreeDof, &|f| {
                quarters(f);
                f.slices[0][0] = main_vector(-32768);
            })?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "main_vector_minus_16384_halves",
            inter_with(&main, Prediction::ThreeDof, &|f| f.slices[0][0] = main_vector(-16384))?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "main_vector_largest",
            inter_with(&main, Prediction::ThreeDof, &|f| f.slices[0][0] = main_vector(1 << 20))?,
            1,
            Malformed,
            "vector",
        ),
        case(
            "main_modes_end",
            ending("modes end", |bytes| {
                inter_with(&main, Prediction::ThreeDof, &|f| f.slices[0][0] = bytes.to_vec())
            })?,
            1,
            Malformed,
            early,
        ),
        case("motion_ends", motion_cut()?, 1, Malformed, early),
        case(
            "main_flags_end",
            inter_with(&main, Prediction::ThreeDof, &|f| f.block_set.clear())?,
            1,
            Malformed,
            early,
        ),
        case(
            "coefficients_end",
            ending("coefficients end", |bytes| key_with(&paper, &|f| f.slices[0][1] = bytes.to_vec()))?,
            1,
            Malformed,
            early,
        ),
        case(
            "main_coefficients_end",
            ending("coefficients end", |bytes| key_with(&main, &|f| f.slices[0][1] = bytes.to_vec()))?,
            1,
            Malformed,
            early,
        ),
    ])
}

/// Two frames of a moving ball of profile `paper`, of whose vectors so much was left off that they are overrun.
fn motion_cut() -> Result<Vec<u8>> {
    let paper = PaperParameters { coefficients: 4, dc_step: 4000, ac_step: 60_000 };
    let small = small_paper()?;
    let header = StreamHeader { profile: Profile::Paper(paper), ..small };
    let motion = MotionMode::Fixed(Prediction::ThreeDof);
    let mut encoder = Encoder::new(&header, EncoderSettings { motion, ..Default::default() });
    let [first, second] = [0.0, 1.0].map(|t| encoder.encode(&ball(header.grid, t)));
    let whole = second.payload();
    for length in 0..whole.slices[0].modes.len() {
        let mut cut = whole.clone();
        cut.slices[0].modes = &whole.slices[0].modes[..length];
        let mut stream = RawStream::new(&header);
        stream.frame(true, 0, false, &first.payload().to_bytes());
        stream.frame(false, 0, false, &cut.to_bytes());
        if judge(&stream.bytes).1.is_some_and(|error| error.to_string().contains("motion vectors end")) {
            return Ok(stream.bytes);
        }
    }
    bail!("no part of the vectors is overrun")
}

/// Has a frame's vectors count quarters.
fn quarters(frame: &mut RawFrame) {
    if let FrameCoding::Main(main) = &mut frame.header.coding {
        main.half_voxel_vectors = false;
    }
}
