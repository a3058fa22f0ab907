//! Decoding of colour at keyframes, where some was lost, and where a frame has too many samples.

use isv_decode::RefusalClass;
use isv_decode::colour::{ColourDecoder, ColourError};
use isv_encode::colour::{ColourEncoder, ColourSettings, EncodedColour};
use isv_format::{ColourHeader, ColourKind, ColourPayload};
use isv_testkit::small_ball;
use isv_volume::{
    BlockCoord, BlockEdge, ColourSample, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelSize,
};

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// Colours of a frame, which change from one to the next.
fn seen(volume: &SparseVolume, frame: usize) -> Vec<ColourSample> {
    let mesh = isv_surface::extract_surface(volume, &isv_surface::SurfaceOptions { normals: true });
    let sample = |(position, normal): (&glam::DVec3, &glam::DVec3)| {
        let wave = |at: f64| (128.0 + 90.0 * (300.0 * at + 2.0 * frame as f64).sin()) as f32;
        let colour = [wave(position.x), wave(position.y), wave(position.z)];
        let (position, normal) = (position.as_vec3().to_array(), normal.as_vec3().to_array());
        ColourSample { position, normal, colour, weight: 1.0 }
    };
    mesh.vertices.iter().zip(&mesh.normals).map(sample).collect()
}

/// Frames of a ball, and their colour parts.
fn take(settings: ColourSettings, frames: usize) -> Vec<(SparseVolume, EncodedColour)> {
    let mut encoder = ColourEncoder::new(ColourSettings { checksums: true, ..settings });
    let frame = |number: usize| {
        let volume = small_ball(grid(), number as f64);
        let coded = encoder.encode(&volume, &seen(&volume, number), number == 0);
        (volume, coded)
    };
    (0..frames).map(frame).collect()
}

#[test]
fn a_keyframe_needs_nothing_before_it() {
    let take = take(ColourSettings::default(), 2);
    let mut decoder = ColourDecoder::new(2);
    decoder.begin_group();
    decoder.decode(&take[0].0, &take[0].1.bytes, 0, true).unwrap();
    let mut other = decoder.clone();
    decoder.decode(&take[1].0, &take[1].1.bytes, 0, true).unwrap();
    // The same part in a keyframe: a decoder that begins there could not decode it.
    other.begin_group();
    let refused = other.decode(&take[1].0, &take[1].1.bytes, 0, true).unwrap_err();
    assert_eq!(refused.class(), Some(RefusalClass::Malformed), "{refused}");
    // A keyframe without a part has no colour, and none comes from it.
    decoder.begin_group();
    assert!(decoder.carry_over(&take[1].0).unwrap().is_none() && decoder.frame().is_none());
    let refused = decoder.decode(&take[1].0, &take[1].1.bytes, 0, true).unwrap_err();
    assert!(matches!(refused, ColourError::NoReference), "{refused}");
}

#[test]
fn a_hash_is_compared_where_colour_is_exact() {
    let take = take(ColourSettings { cycle: Some(3), ..ColourSettings::default() }, 4);
    let mut decoder = ColourDecoder::new(2);
    decoder.begin_group();
    decoder.decode(&take[0].0, &take[0].1.bytes, 0, true).unwrap();
    assert!(decoder.is_exact());
    // Another decoder enters the stream here.
    let mut decoder = ColourDecoder::new(2);
    let found = decoder.decode(&take[1].0, &take[1].1.bytes, 0, true).unwrap().hash();
    let stated = ColourPayload::parse(&take[1].1.bytes, 0, 2).unwrap().header.hash;
    assert!(!decoder.is_exact() && stated != Some(found));
    let mut carried = decoder.clone();
    carried.carry_over(&take[1].0).unwrap();
    assert!(!carried.is_exact(), "what is carried over is no better");
    // The rest of the cycle.
    for (volume, part) in &take[2..] {
        decoder.decode(volume, &part.bytes, 0, true).unwrap();
    }
    assert!(decoder.is_exact());
    decoder.carry_over(&take[3].0).unwrap();
    assert!(decoder.is_exact());
}

/// Blocks of a cube, 17 along an edge, whose voxels inside are those that `inside` says.
fn cube(inside: impl Fn([usize; 3]) -> bool) -> SparseVolume {
    let mut builder = VolumeBuilder::new(grid());
    let code = |v: usize| if inside([v % 8, v / 8 % 8, v / 64]) { -100 } else { 100 };
    let samples: Vec<i16> = (0..512).map(code).collect();
    for block in 0..17i32.pow(3) {
        builder.push(BlockCoord::from([block % 17, block / 17 % 17, block / 289]), samples.clone(), None);
    }
    builder.finish()
}

#[test]
fn too_many_samples_are_beyond_the_limit() {
    // Zeros are decisions of 1: all blocks are as deep as they may be. Ones are decisions of 0.
    let (ones, zeros) = (vec![0; 4096], vec![0xff; 4096]);
    let header =
        ColourHeader { kind: ColourKind::Intra, luma_step: 1, chroma_step: 1, slices: 1, hash: None };
    let layers = vec![vec![&zeros[..]]; 3];
    let part = ColourPayload { header, modes: vec![&ones], layers }.to_bytes();
    let full = cube(|[x, y, z]| (x + y + z) % 2 == 0);
    let mut decoder = ColourDecoder::new(3);
    let refused = decoder.decode(&full, &part, 0, true).unwrap_err();
    assert!(matches!(refused, ColourError::TooManySamples { .. }), "{refused}");
    assert_eq!(refused.class(), Some(RefusalClass::Limit));
    // As many blocks with few cells are no trouble, until they have more of them and no part.
    let sparse = cube(|voxel| voxel == [3; 3]);
    decoder.decode(&sparse, &part, 0, true).unwrap();
    assert!(decoder.carry_over(&sparse).unwrap().is_some());
    let refused = decoder.carry_over(&full).unwrap_err();
    assert!(matches!(refused, ColourError::TooManySamples { .. }), "{refused}");
    assert!(decoder.frame().is_none());
}
