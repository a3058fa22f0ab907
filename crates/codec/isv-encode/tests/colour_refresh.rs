//! Gradual refresh of colour: after a loss all is exact again within the documented number of frames, and no frame is large.

use isv_decode::colour::{ColourDecoder, ColourFrame, ExactColour};
use isv_decode::{Decoder, Limits};
use isv_encode::colour::{ColourEncoder, ColourSettings};
use isv_encode::{Encoder, EncoderSettings, MainSettings, Refresh};
use isv_format::{
    ColourKind, ColourLayers, ColourPayload, FrameRate, PacketReader, PacketWriter, Profile, StreamHeader,
};
use isv_testkit::volume_of;
use isv_volume::{BlockEdge, ColourSample, Grid, SparseVolume, Truncation, VoxelSize};

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// Way of the figure up to a frame (voxels): it walks, and stands for every other four frames.
fn way(frame: usize) -> f64 {
    let steps = (0..frame).filter(|step| step / 4 % 2 == 0).count();
    0.7 * steps as f64
}

/// A figure with an arm. `size`: of its body (voxels).
fn figure(frame: usize, size: f64) -> SparseVolume {
    let way = way(frame);
    let distance = |[x, y, z]: [f64; 3]| {
        let x = x - way;
        let body = (1.6 * x * x + 0.8 * y * y + 1.6 * z * z).sqrt() - size;
        let (along, across) = (z + 0.6 * x, y - 0.2 * size);
        let arm = (along * along + across * across).sqrt().max(x.abs() - 1.2 * size) - 3.5;
        body.min(arm)
    };
    volume_of(grid(), (1.4 * size / 8.0).ceil() as i32 + 1, distance, |_| false)
}

/// Colours on the surface of the figure, which it takes along. `negative`: of the opposite brightness.
fn seen(volume: &SparseVolume, frame: usize, negative: bool) -> Vec<ColourSample> {
    let mesh = isv_surface::extract_surface(volume, &isv_surface::SurfaceOptions { normals: true });
    let way_m = (0.005 * way(frame)) as f32;
    let of_face = |face: usize| {
        let [a, b, c] = mesh.corners(face);
        let normal = mesh.normals[mesh.triangles[face][0] as usize].as_vec3().to_array();
        let position = ((a + b + c) / 3.0).as_vec3().to_array();
        let wave = |at: f32| 128.0 + 90.0 * (250.0 * at).sin();
        let [x, y, z] = [position[0] - way_m, position[1], position[2]];
        let colour = [wave(x + 0.5 * y), wave(y), wave(z - x)];
        let colour = if negative { colour.map(|value| 255.0 - value) } else { colour };
        ColourSample { position, normal, colour, weight: 1.0 }
    };
    (0..mesh.triangles.len()).map(of_face).collect()
}

fn settings(layers: u8, cycle: u32) -> ColourSettings {
    ColourSettings { layers, cycle: Some(cycle), checksums: true, ..ColourSettings::default() }
}

/// Frames of a figure, and their colour parts.
fn take(settings: ColourSettings, frames: usize, size: f64) -> Vec<(SparseVolume, Vec<u8>)> {
    let mut encoder = ColourEncoder::new(settings);
    let frame = |number: usize| {
        let volume = figure(number, size);
        let part = encoder.encode(&volume, &seen(&volume, number, false), number == 0).bytes;
        (volume, part)
    };
    (0..frames).map(frame).collect()
}

/// The samples of a block.
fn block(frame: &ColourFrame, block: usize) -> &[[i16; 4]] {
    let depth = frame.shape.depths()[block];
    &frame.layers[usize::from(depth)][frame.shape.block_samples(block, depth)]
}

#[test]
fn what_is_said_to_be_exact_is_whatever_it_was_before() {
    const CYCLE: usize = 5;
    for layers in 1..=3 {
        let take = take(settings(layers, CYCLE as u32), 3 * CYCLE + 1, 14.0);
        let mut decoder = ColourDecoder::new(layers);
        decoder.begin_group();
        // The same surface in other colours stands for any damage.
        let mut damaged = decoder.clone();
        let first =
            ColourEncoder::new(settings(layers, 1)).encode(&take[0].0, &seen(&take[0].0, 0, true), true);
        decoder.decode(&take[0].0, &take[0].1, 0, true).unwrap();
        damaged.decode(&take[0].0, &first.bytes, 0, true).unwrap();
        damaged.lose();
        let (mut exact_blocks, mut wrong_blocks) = (0, 0);
        for (number, (volume, part)) in take.iter().enumerate().skip(1) {
            let kind = ColourPayload::parse(part, 0, layers).unwrap().header.kind;
            assert_eq!(kind, ColourKind::Resilient, "no frame after the first is intra");
            let whole = decoder.decode(volume, part, 0, true).unwrap().clone();
            let found = damaged.decode(volume, part, 0, true).unwrap().clone();
            let blocks = whole.shape.depths().len();
            let due = if number > CYCLE { blocks } else { (number * blocks).div_ceil(CYCLE) };
            for number_of_block in 0..blocks {
                let is_exact = damaged.exact().contains(number_of_block);
                let is_equal = block(&whole, number_of_block) == block(&found, number_of_block);
                assert!(is_equal || !is_exact, "frame {number}, block {number_of_block}");
                assert!(is_exact || number_of_block >= due, "frame {number}: {number_of_block} of {due}");
                exact_blocks += usize::from(is_exact && !damaged.is_exact());
                wrong_blocks += usize::from(!is_equal);
            }
            assert_eq!(damaged.is_exact(), number >= CYCLE, "frame {number}");
            assert!(decoder.is_exact());
        }
        assert!(exact_blocks > 50 && wrong_blocks > 50, "{layers}: {exact_blocks} {wrong_blocks}");
    }
}

#[test]
fn no_frame_is_much_larger_than_the_mean() {
    const CYCLE: usize = 8;
    let take = take(settings(2, CYCLE as u32), 3 * CYCLE + 1, 34.0);
    let bytes: Vec<usize> = take.iter().map(|(_, part)| part.len()).collect();
    for cycle in bytes[1..].chunks(CYCLE) {
        let mean = cycle.iter().sum::<usize>() / CYCLE;
        let largest = *cycle.iter().max().unwrap();
        assert!(largest < 2 * mean, "{bytes:?}");
        assert!(bytes[0] > 2 * largest, "an intra frame is far larger: {bytes:?}");
    }
}

#[test]
fn colour_that_is_carried_over_is_as_exact_as_it_was() {
    let take = take(settings(2, 4), 9, 12.0);
    let mut decoder = ColourDecoder::new(2);
    decoder.lose();
    for (volume, part) in &take[1..3] {
        decoder.decode(volume, part, 0, true).unwrap();
    }
    let of_blocks = |exact: &ExactColour| match exact {
        ExactColour::Blocks(exact) => exact.iter().filter(|exact| **exact).count(),
        _ => panic!("some blocks are exact: {exact:?}"),
    };
    let before = of_blocks(decoder.exact());
    // What stands still is read where it is.
    decoder.carry_over(&take[2].0).unwrap();
    assert_eq!(of_blocks(decoder.exact()), before);
    // On another surface, some are read from what is not exact.
    decoder.carry_over(&take[3].0).unwrap();
    assert!(of_blocks(decoder.exact()) > 0);
    decoder.lose();
    decoder.carry_over(&take[3].0).unwrap();
    assert_eq!(*decoder.exact(), ExactColour::Nothing, "depths come from what was lost");
}

/// A stream of a painted figure with gradual refresh of geometry and colour.
fn stream(frames: usize, cycle: u32) -> Vec<u8> {
    let header = StreamHeader::new(Profile::Main, grid(), FrameRate::DEFAULT);
    let header = header.with_colour(ColourLayers::HalfVoxels);
    let main = MainSettings { refresh: Refresh::Gradual, ..MainSettings::default() };
    let encoder = EncoderSettings { checksums: true, gop: cycle, main, ..EncoderSettings::default() };
    let mut geometry = Encoder::new(&header, encoder);
    let mut colour = ColourEncoder::new(ColourSettings { slices: 2, ..settings(2, cycle) });
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for frame in 0..frames {
        let coded = geometry.encode(&figure(frame, 12.0));
        let volume = geometry.reconstruction().unwrap();
        // Now and then nothing is seen, and what was is refreshed.
        let seen = if frame % 7 == 5 { Vec::new() } else { seen(volume, frame, false) };
        let part = colour.encode(volume, &seen, coded.keyframe).bytes;
        writer.write_coloured_frame(coded.keyframe, 0, &coded.payload(), Some(&part)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn lost_packets_are_made_good_within_three_cycles() {
    const CYCLE: usize = 3;
    const FRAMES: usize = 5 * CYCLE + 1;
    let bytes = stream(FRAMES, CYCLE as u32);
    let decode = |lost: &[usize]| {
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        let mut decoder = Decoder::new(reader.header(), Limits::default());
        decoder.keep_colour(true);
        decoder.recover(true);
        let mut found = vec![None; FRAMES];
        for (frame, found) in found.iter_mut().enumerate() {
            let packet = reader.next_frame().unwrap().unwrap();
            if !lost.contains(&frame) {
                // Hashes of exact volumes and exact colour are compared.
                let inexact = decoder.decode_and_verify(&packet).unwrap().inexact_blocks;
                let exact = decoder.exact_colour().unwrap().clone();
                *found = Some((inexact, exact, decoder.colour().cloned()));
            }
        }
        found
    };
    let whole = decode(&[]);
    assert!(whole.iter().flatten().all(|(inexact, exact, _)| *inexact == 0 && exact.is_whole()));
    for lost in [&[0][..], &[1], &[2], &[3], &[4], &[5], &[2, 3]] {
        let found = decode(lost);
        let last = lost.last().unwrap();
        let mut partly = 0;
        for (frame, (found, whole)) in found.iter().zip(&whole).enumerate() {
            let (Some((inexact, exact, Some(colour))), Some((_, _, Some(before)))) = (found, whole) else {
                continue;
            };
            assert!(*inexact == 0 || *exact == ExactColour::Nothing, "{lost:?}, {frame}");
            assert!(exact.is_whole() || frame < last + 3 * CYCLE, "{lost:?}: {frame} is exact again");
            if let ExactColour::Blocks(exact) = exact {
                partly += 1;
                assert_eq!(colour.shape.depths(), before.shape.depths());
                for (number, _) in exact.iter().enumerate().filter(|(_, exact)| **exact) {
                    assert_eq!(block(colour, number), block(before, number), "{lost:?}, {frame}");
                }
            }
            assert!(!exact.is_whole() || colour.hash() == before.hash(), "{lost:?}, {frame}");
        }
        assert!(partly > 0, "{lost:?}: some frames are exact in part");
    }
}
