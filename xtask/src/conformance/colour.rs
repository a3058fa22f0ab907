//! Streams with colour: parts by our encoder, and parts of symbols that are drawn.

mod refused;
mod symbols;

use super::extremes::{FIRST, LAST};
use super::main_profile::moved;
use super::raw::{RawStream, judge, sorted};
use super::{Stream, header};
use anyhow::{Context, Result, ensure};
use isv::raw::decode::colour::reconstruct::reconstruct;
use isv::raw::decode::colour::syntax::ColourSlices;
use isv::raw::decode::colour::{ColourCells, ColourReference, steps};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings};
use isv::raw::encode::{Encoder, EncoderSettings, MainSettings, Refresh};
use isv::raw::format::{
    ColourHeader, ColourKind, ColourLayers, ColourPayload, PacketReader, Profile, StreamHeader,
};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{ColourSample, SparseVolume, VolumeBuilder};
use isv_testkit::{Random, volume_of};
pub(super) use refused::streams as refused;
use std::sync::Arc;
use symbols::{Frame, LARGEST_LEVEL, Segments, Taste, draw};

/// A stream, and the colour hash of each frame that has colour.
pub(super) struct ColourStream {
    pub(super) stream: Stream,
    pub(super) colours: Vec<Option<u64>>,
}

/// Streams that decode, by name.
pub(super) fn streams() -> Result<Vec<(&'static str, ColourStream)>> {
    let (mixed, still) = (Taste::MIXED, Taste { spatial: 0.0, new: 0.0, ..Taste::MIXED });
    let none = Taste { coded: 0.0, spatial: 0.0, ..Taste::MIXED };
    let far = Taste { spatial: 0.1, new: 0.8, reach: 128, ..mixed };
    let farthest = Taste { reach: -128, ..far };
    let large = Taste { magnitude: LARGEST_LEVEL, coded: 0.35, ..mixed };
    let medium = Taste { magnitude: 900, ..large };
    let flat = Taste { deep: [0.0; 2], ..mixed };
    let deep = Taste { deep: [1.0; 2], ..mixed };
    let passing = [[0; 3], [1, 0, 0], [2, 1, 0], [3, 1, -1]];
    Ok(vec![
        ("colour_encoded", encoded(ColourLayers::HalfVoxels, Refresh::Keyframes, 5)?),
        ("colour_encoded_resilient", encoded(ColourLayers::QuarterVoxels, Refresh::Gradual, 5)?),
        ("colour_refreshed", encoded(ColourLayers::HalfVoxels, Refresh::Gradual, 13)?),
        ("colour_refreshed_noise", refreshed_noise()?),
        ("colour_one_layer", {
            let parts = [intra(mixed), predicted(mixed), predicted(still)];
            balls(ColourLayers::Voxels, 1, &passing, &parts.map(Some))?
        }),
        ("colour_two_layers", {
            let parts = [intra(mixed), predicted(mixed), predicted(none), predicted(mixed)];
            balls(ColourLayers::HalfVoxels, 2, &passing, &parts.map(Some))?
        }),
        ("colour_three_layers", {
            let parts = [intra(deep), predicted(deep), predicted(mixed)];
            balls(ColourLayers::QuarterVoxels, 3, &passing, &parts.map(Some))?
        }),
        ("colour_mixed_depths", {
            let parts = [intra(mixed), predicted(flat), predicted(deep), predicted(mixed)];
            balls(ColourLayers::QuarterVoxels, 4, &passing, &parts.map(Some))?
        }),
        ("colour_slices", {
            let slices = |part: Part, slices| Some(Part { slices, ..part });
            let parts = [
                slices(intra(mixed), 3),
                slices(predicted(mixed), 256),
                slices(predicted(mixed), 2),
                slices(predicted(mixed), 5),
            ];
            balls(ColourLayers::HalfVoxels, 5, &passing, &parts)?
        }),
        ("colour_vectors", {
            let parts = [intra(mixed), predicted(farthest), predicted(far), predicted(mixed)];
            balls(ColourLayers::QuarterVoxels, 6, &passing, &parts.map(Some))?
        }),
        ("colour_levels", {
            let steps = |part: Part, luma_step, chroma_step| Some(Part { luma_step, chroma_step, ..part });
            let parts = [
                steps(intra(large), u16::MAX, 1),
                steps(predicted(large), 1, u16::MAX),
                steps(predicted(medium), 7, 9),
                steps(predicted(large), u16::MAX, u16::MAX),
            ];
            balls(ColourLayers::QuarterVoxels, 7, &passing, &parts)?
        }),
        ("colour_kinds", {
            let parts = [
                intra(mixed),
                resilient(mixed),
                predicted(mixed),
                intra(mixed),
                predicted(far),
                resilient(still),
            ];
            let places = [passing[0], passing[1], passing[2], passing[3], passing[2], passing[2]];
            balls(ColourLayers::HalfVoxels, 8, &places, &parts.map(Some))?
        }),
        ("colour_absent", {
            // None in the keyframe, then one that needs no frame before, one that stays and one that goes on from there.
            let parts =
                [None, Some(resilient(mixed)), None, Some(predicted(mixed)), None, Some(intra(flat)), None];
            let places = [passing[0], passing[0], passing[1], passing[1], passing[2], passing[2], passing[3]];
            balls(ColourLayers::QuarterVoxels, 9, &places, &parts)?
        }),
        ("colour_scene_jumps", {
            let parts = [
                Some(intra(mixed)),
                Some(predicted(mixed)),
                Some(predicted(mixed)),
                None,
                None,
                Some(predicted(far)),
                Some(resilient(mixed)),
            ];
            let near = [(1 << 20) * 8 - 8, 24, -72];
            let places = [[0; 3], NOWHERE, [0; 3], NOWHERE, [8, 0, 0], [FIRST * 8 + 8; 3], near];
            balls(ColourLayers::HalfVoxels, 10, &places, &parts)?
        }),
        ("colour_keyframes", keyframes()?),
        ("colour_masks", masks()?),
        ("colour_thin", thin()?),
        ("colour_noise", noise(11, &[[0; 3], [1, 0, 0], [0, 0, 1], [-4, 2, 0]])?),
        ("colour_ends", {
            let ends = [[FIRST; 3], [LAST; 3], [LAST - 1, LAST, LAST], [FIRST, LAST, 0], [LAST, FIRST, -1]];
            noise(12, &ends)?
        }),
        ("colour_unused_bytes", unused_bytes()?),
    ])
}

/// No ball.
const NOWHERE: [i32; 3] = [i32::MAX; 3];

/// Header fields and taste of a colour part that is drawn.
#[derive(Clone, Copy)]
struct Part {
    kind: ColourKind,
    luma_step: u16,
    chroma_step: u16,
    slices: u16,
    taste: Taste,
}

fn part(kind: ColourKind, taste: Taste) -> Part {
    Part { kind, luma_step: 300, chroma_step: 450, slices: 1, taste }
}

fn intra(taste: Taste) -> Part {
    part(ColourKind::Intra, taste)
}

fn predicted(taste: Taste) -> Part {
    part(ColourKind::Predicted, taste)
}

fn resilient(taste: Taste) -> Part {
    part(ColourKind::Resilient, taste)
}

/// A stream that grows frame by frame.
struct Builder {
    header: StreamHeader,
    stream: RawStream,
    random: Random,
    entropy: ColourSlices,
    reference: Option<ColourReference>,
    frames: u64,
}

impl Builder {
    fn new(layers: ColourLayers, truncation: u32, seed: u64) -> Result<Self> {
        let header = header(Profile::Main, 8, truncation)?.with_colour(layers);
        let (stream, random) = (RawStream::new(&header), Random::new(seed));
        Ok(Self { header, stream, random, entropy: ColourSlices::default(), reference: None, frames: 0 })
    }

    /// Adds a frame whose colour is drawn. `geometry`: its part of the payload; `volume`: what it decodes to.
    fn frame(
        &mut self,
        keyframe: bool,
        (geometry, hashed): (&[u8], bool),
        volume: &SparseVolume,
        part: Option<&Part>,
    ) -> Result<()> {
        if keyframe {
            self.reference = None;
        }
        let bytes = part.map(|part| {
            let (header, segments) = self.drawn(volume, part);
            payload(header, &segments)
        });
        if let (None, Some(reference)) = (part, &self.reference) {
            self.reference = Some(reference.carried_over(volume)?);
        }
        self.add(keyframe, geometry, hashed, bytes.as_deref());
        Ok(())
    }

    fn add(&mut self, keyframe: bool, geometry: &[u8], hashed: bool, colour: Option<&[u8]>) {
        let timestamp = self.header.frame_rate.timestamp_ns(self.frames);
        self.stream.frame_with(keyframe, timestamp, hashed, geometry, colour);
        self.frames += 1;
    }

    /// Draws a part, whose frame is the next one's reference.
    fn drawn(&mut self, volume: &SparseVolume, part: &Part) -> (ColourHeader, Segments) {
        let kind = part.kind;
        if kind != ColourKind::Predicted {
            self.entropy = ColourSlices::default();
        }
        let reference = self.reference.take().filter(|_| kind.predicts());
        let known = reference.as_ref().filter(|_| kind == ColourKind::Predicted);
        let blocks_before = |cells: &ColourCells| match known {
            Some(known) => known.blocks_at(cells.coords()),
            None => vec![None; cells.coords().len()],
        };
        let frame = Frame {
            volume,
            layers: self.header.colour_layers.count(),
            slices: part.slices,
            predicts: kind.predicts(),
            known: &blocks_before,
        };
        let (segments, symbols, shape) = draw(&mut self.random, &part.taste, &mut self.entropy, &frame);
        let (luma_step, chroma_step) = (part.luma_step, part.chroma_step);
        let mut header = ColourHeader { kind, luma_step, chroma_step, slices: part.slices, hash: None };
        let before = reference.unwrap_or_default();
        let decoded = reconstruct(kind, shape, &symbols, &steps(&header), &before.frame);
        header.hash = Some(decoded.hash());
        self.reference = Some(ColourReference::new(Arc::new(decoded), &symbols));
        (header, segments)
    }

    /// The stream, and what our decoder finds in it.
    fn finish(self) -> Result<ColourStream> {
        found_in(self.stream.finish())
    }
}

/// A colour part as bytes.
fn payload(header: ColourHeader, segments: &Segments) -> Vec<u8> {
    let layers = segments.layers.iter().map(|slices| slices.iter().map(Vec::as_slice).collect()).collect();
    ColourPayload { header, modes: segments.modes.iter().map(Vec::as_slice).collect(), layers }.to_bytes()
}

/// Decodes a stream that must decode, with its colour.
fn found_in(bytes: Vec<u8>) -> Result<ColourStream> {
    let (hashes, colours, error) = judge_with_colour(&bytes);
    ensure!(error.is_none(), "{error:?}");
    ensure!(judge(&bytes).0 == hashes, "volumes do not depend on colour");
    Ok(ColourStream { stream: (bytes, hashes), colours })
}

/// Decodes a stream with its colour: hashes, colour hashes, and why our decoder stopped before the end.
fn judge_with_colour(bytes: &[u8]) -> (Vec<u64>, Vec<Option<u64>>, Option<isv::raw::decode::DecodeError>) {
    let (mut hashes, mut colours) = (Vec::new(), Vec::new());
    let mut decode = || {
        let mut reader = PacketReader::new(bytes)?;
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        decoder.keep_colour(true);
        while let Some(packet) = reader.next_frame()? {
            let volume = isv::raw::decode::volume_hash(decoder.decode_and_verify(&packet)?.volume);
            hashes.push(volume);
            colours.push(decoder.colour().map(|frame| frame.hash()));
        }
        Ok(())
    };
    let error = decode().err();
    (hashes, colours, error)
}

/// A ball of some 5 voxels, with its middle near a place in voxels.
fn small_ball(header: &StreamHeader, place: [i32; 3]) -> SparseVolume {
    if place == NOWHERE {
        return volume_of(header.grid, 0, |_| 0.0, |_| false);
    }
    let block = place.map(|p| p.div_euclid(8));
    let within = [0, 1, 2].map(|axis| f64::from(place[axis] - 8 * block[axis]));
    let distance = |[x, y, z]: [f64; 3]| {
        let [x, y, z] = [x - within[0], y - within[1], z - within[2]];
        (x * x + 1.3 * y * y + z * z).sqrt() - 5.2
    };
    moved(&volume_of(header.grid, 2, distance, |_| false), block)
}

/// Settings of a stream whose first frame alone is a keyframe: otherwise a surface that is somewhere else begins a GOP.
fn one_gop() -> EncoderSettings {
    let main = MainSettings { refresh: Refresh::Gradual, ..MainSettings::default() };
    EncoderSettings { checksums: true, main, ..Default::default() }
}

/// One GOP of a small ball at places in voxels, whose colour is drawn.
fn balls(
    layers: ColourLayers,
    seed: u64,
    places: &[[i32; 3]],
    parts: &[Option<Part>],
) -> Result<ColourStream> {
    let mut builder = Builder::new(layers, 4, seed)?;
    let settings = EncoderSettings { checksums: true, ..Default::default() };
    let settings = if places.contains(&NOWHERE) { one_gop() } else { settings };
    let mut encoder = Encoder::new(&builder.header, settings);
    for (place, part) in places.iter().zip(parts) {
        let coded = encoder.encode(&small_ball(&builder.header, *place));
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        ensure!(coded.keyframe == (builder.frames == 0), "one GOP");
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, part.as_ref())?;
    }
    builder.finish()
}

/// Resilient frames whose colour is drawn, of a volume that is refreshed in two frames: some blocks are predicted from exact ones alone.
fn refreshed_noise() -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::QuarterVoxels, 4, 13)?;
    let mut encoder = Encoder::new(&builder.header, EncoderSettings { gop: 2, ..one_gop() });
    let near = Taste { spatial: 0.7, new: 0.5, reach: 6, ..Taste::MIXED };
    for frame in 0..9 {
        let coded = encoder.encode(&small_ball(&builder.header, [frame / 2, 0, -frame / 3]));
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        let part = match frame {
            0 => Some(intra(near)),
            5 => None,
            6 => Some(predicted(near)),
            _ => Some(resilient(near)),
        };
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, part.as_ref())?;
    }
    builder.finish()
}

/// Encodes a painted ball with our encoder.
fn encoded(layers: ColourLayers, refresh: Refresh, frames: i32) -> Result<ColourStream> {
    let mut builder = Builder::new(layers, 4, 0)?;
    let main = MainSettings { refresh, ..MainSettings::default() };
    let settings = EncoderSettings { checksums: true, main, gop: 3, ..Default::default() };
    let mut geometry = Encoder::new(&builder.header, settings);
    let cycle = (refresh == Refresh::Gradual).then_some(3);
    let mut colour = ColourEncoder::new(ColourSettings {
        layers: layers.count(),
        slices: if cycle.is_some() { 2 } else { 1 },
        checksums: true,
        cycle,
        ..ColourSettings::default()
    });
    for frame in 0..frames {
        let place = [frame, 0, -frame / 2];
        let coded = geometry.encode(&small_ball(&builder.header, place));
        let volume = geometry.reconstruction().context("a frame was just encoded")?;
        let part = colour.encode(volume, &painted(volume, place), coded.keyframe);
        builder.add(coded.keyframe, &coded.payload().to_bytes(), true, Some(&part.bytes));
    }
    builder.finish()
}

/// Colours on a surface, which move with a place in voxels.
pub(crate) fn painted(volume: &SparseVolume, place: [i32; 3]) -> Vec<ColourSample> {
    let mesh = extract_surface(volume, &SurfaceOptions { normals: true });
    let voxel_m = volume.grid().voxel_size.metres();
    let of_face = |face: usize| {
        let [a, b, c] = mesh.corners(face);
        let normal = mesh.normals[mesh.triangles[face][0] as usize].as_vec3().to_array();
        let position = (a + b + c) / 3.0;
        let own = [0, 1, 2].map(|axis| position[axis] / voxel_m - f64::from(place[axis]));
        let wave = |at: f64| (128.0 + 90.0 * at.sin()) as f32;
        let colour = [wave(own[0]), wave(0.7 * own[1]), wave(0.4 * (own[0] + own[2]))];
        ColourSample { position: position.as_vec3().to_array(), normal, colour, weight: 1.0 }
    };
    (0..mesh.triangles.len()).map(of_face).collect()
}

/// GOPs with and without colour in their keyframes: none takes over what was before it.
fn keyframes() -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::HalfVoxels, 4, 13)?;
    let settings = EncoderSettings { checksums: true, gop: 2, ..Default::default() };
    let mut encoder = Encoder::new(&builder.header, settings);
    let (intra, predicted) = (intra(Taste::MIXED), predicted(Taste::MIXED));
    for (frame, part) in
        [Some(&intra), Some(&predicted), None, None, Some(&intra), None].into_iter().enumerate()
    {
        let coded = encoder.encode(&small_ball(&builder.header, [frame as i32, 0, 0]));
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        ensure!(coded.keyframe == frame.is_multiple_of(2), "every second frame is a keyframe");
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, part)?;
    }
    builder.finish()
}

/// A ball of which parts were not observed: cells with a masked corner have no colour.
fn masks() -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::HalfVoxels, 4, 14)?;
    let mut encoder = Encoder::new(&builder.header, one_gop());
    for (frame, part) in [intra(Taste::MIXED), predicted(Taste::MIXED)].into_iter().enumerate() {
        let shift = frame as f64;
        let distance = |[x, y, z]: [f64; 3]| ((x - shift).powi(2) + y * y + z * z).sqrt() - 5.5;
        let volume = volume_of(builder.header.grid, 1, distance, |[x, y, _]| y - 0.3 * x < -2.0 + shift);
        let coded = encoder.encode(&volume);
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        ensure!((0..volume.block_count()).any(|block| volume.unobserved(block).is_some()), "masks");
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, Some(&part))?;
    }
    builder.finish()
}

/// A sheet thinner than two voxels, whose sides must not take each other's colour.
fn thin() -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::QuarterVoxels, 2, 15)?;
    let mut encoder = Encoder::new(&builder.header, one_gop());
    let temporal = Taste { spatial: 0.0, reach: 6, coded: 0.1, ..Taste::MIXED };
    for (frame, part) in
        [intra(Taste::MIXED), predicted(temporal), predicted(temporal)].into_iter().enumerate()
    {
        let shift = 0.6 * frame as f64;
        let distance = |[x, y, z]: [f64; 3]| {
            let sheet = (z - 0.2 * x - shift).abs() - 0.7;
            sheet.max(x.abs() - 5.0).max(y.abs() - 4.0)
        };
        let coded = encoder.encode(&volume_of(builder.header.grid, 1, distance, |_| false));
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, Some(&part))?;
    }
    builder.finish()
}

/// Blocks of random fields, which most of their cells cross.
fn noise(seed: u64, coords: &[[i32; 3]]) -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::QuarterVoxels, 2, seed)?;
    let mut encoder = Encoder::new(&builder.header, one_gop());
    let mut random = Random::new(seed + 100);
    let mut code = |most: f64| (random.signed() * most) as i16;
    let mut fields: Vec<Vec<i16>> = coords.iter().map(|_| (0..512).map(|_| code(500.0)).collect()).collect();
    let shallow = Taste { deep: [0.5, 0.3], coded: 0.2, ..Taste::MIXED };
    for part in [intra(shallow), predicted(shallow), predicted(Taste { spatial: 0.0, reach: 8, ..shallow })] {
        let mut volume = VolumeBuilder::new(builder.header.grid);
        for coord in sorted(coords) {
            let place = coords.iter().position(|other| *other == coord.to_array()).context("one of them")?;
            fields[place].iter_mut().for_each(|sample| *sample = (*sample + code(60.0)).clamp(-512, 512));
            volume.push(coord, fields[place].clone(), None);
        }
        let coded = encoder.encode(&volume.finish());
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        builder.frame(coded.keyframe, (&coded.payload().to_bytes(), true), volume, Some(&part))?;
    }
    builder.finish()
}

/// Bytes behind the symbols of each segment, varints of five bytes, and a part without a hash.
fn unused_bytes() -> Result<ColourStream> {
    let mut builder = Builder::new(ColourLayers::HalfVoxels, 4, 16)?;
    let mut encoder =
        Encoder::new(&builder.header, EncoderSettings { checksums: true, ..Default::default() });
    for (frame, part) in [intra(Taste::MIXED), predicted(Taste::MIXED)].into_iter().enumerate() {
        let coded = encoder.encode(&small_ball(&builder.header, [frame as i32, 1, 2]));
        let volume = encoder.reconstruction().context("a frame was just encoded")?;
        let part = Part { slices: 2, ..part };
        let (header, mut segments) = builder.drawn(volume, &part);
        for segment in segments.modes.iter_mut().chain(segments.layers.iter_mut().flatten()) {
            // Up to four zeros were left off.
            segment.extend([0, 0, 0, 0, 0xde, 0xad]);
        }
        let varint = |value: usize| {
            (0..5).map(move |i| (value >> (7 * i) & 0x7f) as u8 | if i < 4 { 0x80 } else { 0 })
        };
        let mut bytes = vec![ColourKind::ALL.iter().position(|kind| *kind == header.kind).unwrap_or(0) as u8];
        for field in [header.luma_step, header.chroma_step, header.slices] {
            bytes.extend(varint(usize::from(field)));
        }
        let all = || segments.modes.iter().chain(segments.layers.iter().flatten());
        all().for_each(|segment| bytes.extend(varint(segment.len())));
        all().for_each(|segment| bytes.extend(segment));
        builder.add(coded.keyframe, &coded.payload().to_bytes(), true, Some(&bytes));
    }
    builder.finish()
}
