//! Streams whose colour must be refused; their volumes decode.

use super::super::raw::RawStream;
use super::super::refused::{Refused, case};
use super::symbols::Taste;
use super::{Builder, intra, judge_with_colour, payload, predicted, resilient, small_ball};
use anyhow::{Context, Result, bail, ensure};
use isv::raw::decode::RefusalClass::{self, Damaged, Limit, Malformed, Missing};
use isv::raw::encode::{Encoder, EncoderSettings};
use isv::raw::format::{ColourHeader, ColourKind, ColourLayers, ColourPayload, StreamHeader};
use isv_entropy::{BitModel, IntegerModel};

/// Two frames of geometry of a GOP, and colour parts that fit them.
struct Pair {
    header: StreamHeader,
    geometry: [Vec<u8>; 2],
    /// Parts of the kinds intra, predicted and resilient; the last two are for the second frame.
    parts: [Vec<u8>; 3],
}

impl Pair {
    fn new() -> Result<Self> {
        let mut builder = Builder::new(ColourLayers::HalfVoxels, 2, 21)?;
        let mut encoder = Encoder::new(&builder.header, EncoderSettings::default());
        let (mut geometry, mut parts) = (Vec::new(), Vec::new());
        let resilient = resilient(Taste::MIXED);
        for (frame, part) in [intra(Taste::MIXED), predicted(Taste::MIXED)].into_iter().enumerate() {
            let coded = encoder.encode(&small_ball(&builder.header, [frame as i32, 0, 0]));
            let volume = encoder.reconstruction().context("a frame was just encoded")?;
            geometry.push(coded.payload().to_bytes());
            let before = builder.reference.clone();
            let (header, segments) = builder.drawn(volume, &part);
            parts.push(payload(header, &segments));
            if frame == 1 {
                builder.reference = before;
                let (header, segments) = builder.drawn(volume, &resilient);
                parts.push(payload(header, &segments));
            }
        }
        Ok(Self {
            header: builder.header,
            geometry: geometry.try_into().ok().context("two frames")?,
            parts: parts.try_into().ok().context("three parts")?,
        })
    }

    /// A stream with these colour parts.
    fn stream(&self, parts: [Option<&[u8]>; 2]) -> Vec<u8> {
        let mut stream = RawStream::new(&self.header);
        for (frame, part) in parts.into_iter().enumerate() {
            stream.frame_with(frame == 0, 0, false, &self.geometry[frame], part);
        }
        stream.bytes
    }

    /// A stream whose second frame has this colour part.
    fn second(&self, part: &[u8]) -> Vec<u8> {
        self.stream([Some(&self.parts[0]), Some(part)])
    }

    /// A stream whose second frame has the segments of the usual part, changed.
    fn changed(&self, change: impl FnOnce(&mut ColourHeader, &mut Vec<Vec<u8>>)) -> Result<Vec<u8>> {
        let ColourPayload { mut header, modes, layers } = ColourPayload::parse(&self.parts[1], 0, 2)?;
        let mut segments: Vec<Vec<u8>> =
            modes.iter().chain(layers.iter().flatten()).map(|segment| segment.to_vec()).collect();
        change(&mut header, &mut segments);
        let [modes, layers @ ..] = &segments[..] else { unreachable!("there is a segment") };
        let layers = layers.iter().map(|segment| vec![&segment[..]]).collect();
        Ok(self.second(&ColourPayload { header, modes: vec![modes], layers }.to_bytes()))
    }
}

impl Pair {
    /// A stream whose second frame has a segment that is cut, so that our decoder says this. Other cuts give other symbols.
    fn ending(&self, segment: usize, says: &str) -> Result<Vec<u8>> {
        for length in 0..1000 {
            let stream = self.changed(|header, segments| {
                header.hash = None;
                segments[segment].truncate(length);
            })?;
            let (_, _, error) = judge_with_colour(&stream);
            if error.is_some_and(|error| error.to_string().contains(says)) {
                return Ok(stream);
            }
        }
        bail!("nothing makes our decoder say: {says}")
    }
}

/// Streams that a decoder of colour must refuse.
pub(in super::super) fn streams() -> Result<Vec<Refused>> {
    let pair = Pair::new()?;
    let [intra, usual, resilient] = &pair.parts;
    let with = |at: usize, bytes: &[u8]| {
        let mut part = usual.clone();
        part.splice(at..at + bytes.len(), bytes.iter().copied());
        pair.second(&part)
    };
    // One byte of kind, steps of two bytes each, slices.
    let slices = |count: u32| {
        let varint = [count as u8 | 0x80, (count >> 7) as u8];
        pair.second(&[&usual[..5], &varint, &usual[6..]].concat())
    };
    let step = |at: usize, value: &[u8]| pair.second(&[&usual[..at], value, &usual[at + 2..]].concat());
    let after = |bytes: Vec<u8>, name, class: RefusalClass, says| case(name, bytes, 1, class, says);
    let first = |bytes: Vec<u8>, name, class: RefusalClass, says| case(name, bytes, 0, class, says);
    let mut cases = vec![
        after(pair.second(&[]), "empty", Malformed, "ends"),
        after(with(0, &[3]), "kind_3", Malformed, "kind"),
        after(with(0, &[0x7f]), "kind_127", Malformed, "kind"),
        after(step(1, &[0]), "luma_step_0", Malformed, "step"),
        after(step(1, &[0x80, 0x80, 4]), "luma_step_65536", Malformed, "step"),
        after(step(1, &[0xff, 0xff, 0xff, 0xff, 0x1f]), "luma_step_above_32_bits", Malformed, ""),
        after(step(3, &[0]), "chroma_step_0", Malformed, "step"),
        after(step(3, &[0x80, 0x80, 4]), "chroma_step_65536", Malformed, "step"),
        after(slices(0), "slices_0", Malformed, "slices"),
        after(slices(257), "slices_257", Limit, "slices"),
        after(pair.second(&usual[..9]), "hash_cut", Malformed, "ends"),
        after(pair.second(&usual[..15]), "lengths_cut", Malformed, "ends"),
        after(pair.second(&usual[..usual.len() - 1]), "segments_cut", Malformed, "ends"),
        after(pair.second(&[&usual[..], &[0]].concat()), "byte_left_over", Malformed, "left over"),
        after(pair.changed(|header, _| header.hash = Some(1))?, "other_hash", Damaged, "hash"),
        after(pair.ending(0, "modes end")?, "modes_end", Malformed, "modes end"),
        after(pair.ending(1, "coefficients end")?, "layer_0_ends", Malformed, "coefficients end"),
        after(pair.ending(2, "coefficients end")?, "layer_1_ends", Malformed, "coefficients end"),
        // Whatever the bytes of its segments are.
        first(pair.stream([Some(usual), None]), "keyframe_predicted", Malformed, "keyframe"),
        first(pair.stream([Some(resilient), None]), "keyframe_resilient", Malformed, "keyframe"),
        // The keyframe has no colour, and that of a GOP before does not count.
        after(pair.stream([None, Some(usual)]), "no_colour_before", Missing, "missing"),
    ];
    for (name, vector) in
        [("vector_129", [129, 0, 0]), ("vector_minus_129", [0, -129, 5]), ("vector_far", [3, 4, 1 << 20])]
    {
        let modes = super::super::raw::segment(|encoder| {
            // Not spatial, a vector of its own; the models are fresh, but for those of a block's depth.
            encoder.encode(&mut BitModel::default(), false);
            encoder.encode(&mut BitModel::default(), true);
            for component in vector {
                IntegerModel::default().encode(encoder, component);
            }
        });
        let stream = pair.changed(|header, segments| {
            (header.kind, header.hash) = (ColourKind::Resilient, None);
            segments[0] = [modes, vec![0; 20]].concat();
        })?;
        cases.push(after(stream, name, Malformed, "vector"));
    }
    let mut two_gops = RawStream::new(&pair.header);
    two_gops.frame_with(true, 0, false, &pair.geometry[0], Some(intra));
    two_gops.frame_with(true, 0, false, &pair.geometry[0], None);
    two_gops.frame_with(false, 0, false, &pair.geometry[1], Some(usual));
    cases.push(case("colour_of_another_gop", two_gops.bytes, 2, Missing, "missing"));
    for case in &cases {
        let (hashes, _, error) = judge_with_colour(&case.bytes);
        case.check(hashes.len(), error)?;
        let (_, error) = super::super::raw::judge(&case.bytes);
        ensure!(error.is_none(), "{}: the volumes decode, but {error:?}", case.name);
    }
    Ok(cases)
}
