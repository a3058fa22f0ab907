//! Changes of `.isv` streams that keep the rest whole, so that they reach what they are meant for. A payload
//! or a segment is changed, and the lengths around it are made to fit. Most bytes changed at random end at a
//! length.

use crate::sealing::{payloads, replace_payload, with_checksums};
use crate::stream::{LIMITS, open};
use isv::raw::decode::Decoder;
use isv::raw::format::{
    FrameCoding, FrameKind, FramePayload, MainFrameHeader, Packet, PacketKind, Prediction, SlicePayload,
};

/// Function that changes bytes of no known form: to at most so many.
pub type Change<'a> = dyn FnMut(&[u8], usize) -> Vec<u8> + 'a;

/// Function that changes an input so that more of it is read: to at most so many bytes, and otherwise as the number says.
pub type Mutator = fn(&[u8], usize, u32, &mut Change<'_>) -> Vec<u8>;

/// Changes the payload of one packet.
pub(crate) fn payload(stream: &[u8], most: usize, seed: u32, change: &mut Change<'_>) -> Vec<u8> {
    let mut choices = Choices(seed);
    let Some(place) = choices.one_of(&payloads(stream)).cloned() else {
        return change(stream, most);
    };
    let payload = mutated(&stream[place.clone()], most.saturating_sub(stream.len()), change);
    replace_payload(stream, &place, &payload)
}

/// Changes one segment of one frame, or one field of its header.
pub(crate) fn syntax(stream: &[u8], most: usize, seed: u32, change: &mut Change<'_>) -> Vec<u8> {
    change_syntax(stream, most, Choices(seed), change).unwrap_or_else(|| payload(stream, most, seed, change))
}

/// Changes a stream in any of the ways.
pub(crate) fn any(stream: &[u8], most: usize, seed: u32, change: &mut Change<'_>) -> Vec<u8> {
    match seed % 8 {
        0 => change(stream, most),
        1 => payload(stream, most, seed / 8, change),
        _ => syntax(stream, most, seed / 8, change),
    }
}

/// Bytes that are changed, and at most `room` more of them.
fn mutated(bytes: &[u8], room: usize, change: &mut Change<'_>) -> Vec<u8> {
    change(bytes, bytes.len() + room.max(1))
}

/// `None` if the stream, or the payload that is chosen, is not well formed enough.
fn change_syntax(
    bytes: &[u8],
    most: usize,
    mut choices: Choices,
    change: &mut Change<'_>,
) -> Option<Vec<u8>> {
    let sealed = with_checksums(bytes);
    let (header, packets) = open(&sealed)?;
    let number = choices.below(packets.len() as u32) as usize;
    let packet = packets.get(number)?;
    let PacketKind::Frame { hashed, keyframe, .. } = packet.header.kind else { return None };
    let place = packet.payload_at() as usize..packet.at as usize + packet.total_bytes();
    let geometry = packet.geometry().ok()?;
    let colour = &packet.payload[geometry.len()..];
    let mut payload = FramePayload::parse(geometry, 0, hashed, &header.profile).ok()?;
    let room = most.saturating_sub(bytes.len());
    if choices.below(8) == 0 {
        change_field(&mut payload, &mut choices);
        return Some(replace_payload(bytes, &place, &[&payload.to_bytes(), colour].concat()));
    }
    let mut segments = segments(&mut payload);
    // A segment that is read has bytes. The set of blocks, which all others depend on, not more often than the rest together.
    let filled: Vec<usize> = (1..segments.len()).filter(|segment| !segments[*segment].is_empty()).collect();
    let chosen = if choices.below(4) == 0 { 0 } else { choices.one_of(&filled).copied().unwrap_or(0) };
    let changed = mutated(segments[chosen], room, change);
    *segments[chosen] = &changed;
    let decoder = Decoder::new(&header, LIMITS);
    if chosen == 0 && (keyframe || choices.below(4) == 0) {
        fit_block_count(&mut payload, decoder, &packets[..=number]);
    }
    Some(replace_payload(bytes, &place, &[&payload.to_bytes(), colour].concat()))
}

/// All segments of a payload, the block set first.
fn segments<'p, 'a>(payload: &'p mut FramePayload<'a>) -> Vec<&'p mut &'a [u8]> {
    let slices = payload.slices.iter_mut().flat_map(|slice| [&mut slice.modes, &mut slice.coefficients]);
    [&mut payload.block_set, &mut payload.masks].into_iter().chain(slices).collect()
}

/// Gives a field of the frame header another value, which need not be allowed.
fn change_field(payload: &mut FramePayload, choices: &mut Choices) {
    let header = &mut payload.header;
    match (&mut header.coding, choices.below(10)) {
        (_, 0) => header.blocks = header.blocks.wrapping_add_signed(choices.below(5) as i32 - 2),
        (_, 1) => {
            header.slices = 1 + choices.below(6) as u16;
            payload.slices.resize(usize::from(header.slices), SlicePayload::default());
        }
        (FrameCoding::Paper { prediction }, _) => *prediction = Prediction::ALL[choices.below(4) as usize],
        (FrameCoding::Main(main), 3) => main.step = 1 << choices.below(21),
        (FrameCoding::Main(main), 4) => main.step = 1 + choices.below(MainFrameHeader::MAX_STEP),
        (FrameCoding::Main(main), 5) => main.filter = choices.below(26) as u8,
        (FrameCoding::Main(main), 6) => main.filter_limit = choices.below(256) as u8,
        (FrameCoding::Main(main), 7) => main.half_voxel_vectors ^= true,
        (FrameCoding::Main(main), 8) => main.no_spatial_prediction ^= true,
        (FrameCoding::Main(main), _) => main.kind = FrameKind::ALL[choices.below(4) as usize],
    }
}

/// Has the header announce as many blocks as the block set holds: otherwise hardly any change of it would get further.
fn fit_block_count(payload: &mut FramePayload, mut decoder: Decoder, packets: &[Packet]) {
    let Some((packet, before)) = packets.split_last() else { return };
    let (mut low, mut high) = (0, (LIMITS.frame_voxels / 512) as u32);
    while low <= high {
        payload.header.blocks = (low + high) / 2;
        before.iter().for_each(|packet| drop(decoder.decode(packet)));
        let mut packet = packet.clone();
        let geometry_bytes = packet.geometry().map_or(0, <[u8]>::len);
        packet.payload = [&payload.to_bytes(), &packet.payload[geometry_bytes..]].concat();
        match decoder.decode(&packet).err().map(|error| error.to_string()) {
            Some(refusal) if refusal.contains("holds more blocks") => low = payload.header.blocks + 1,
            Some(refusal) if refusal.contains("holds fewer blocks") && payload.header.blocks > 0 => {
                high = payload.header.blocks - 1;
            }
            _ => return,
        }
    }
}

/// Small random numbers, all from one seed.
struct Choices(u32);

impl Choices {
    /// A number below `end`; 0 if that is 0.
    fn below(&mut self, end: u32) -> u32 {
        // Numerical Recipes' generator, of which the high bits are used.
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((u64::from(self.0) * u64::from(end)) >> 32) as u32
    }

    fn one_of<'a, T>(&mut self, choices: &'a [T]) -> Option<&'a T> {
        choices.get(self.below(choices.len() as u32) as usize)
    }
}
