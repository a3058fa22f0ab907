//! Colour: what the encoder reconstructs is what the decoder decodes, near what was seen; and nothing from outside does harm.

use isv_decode::colour::Reader;
use isv_decode::colour::{ColourDecoder, ColourError, ColourFrame, surface_colours};
use isv_encode::colour::{ColourEncoder, ColourSettings, EncodedColour, locate};
use isv_encode::{
    Bitrate, ColourShare, EncoderSettings, FrameCoder, FrameWriter, MainSettings, Preset, RateTarget,
};
use isv_format::{ColourKind, ColourPayload, PacketHeader, Profile, StreamHeader};
use isv_testkit::{Random, ball, still_and_moving_ball};
use isv_volume::{BlockEdge, ColourSample, Grid, SparseVolume, Truncation, VoxelSize, ycbcr_from_rgb};

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// A smooth colour with edges, of places in metres.
fn painted([x, y, z]: [f32; 3]) -> [f32; 3] {
    let stripes = if (x * 60.0).sin() > 0.3 { 60.0 } else { 0.0 };
    [140.0 + 60.0 * (40.0 * y).sin() + stripes / 2.0, 110.0 + stripes, 120.0 + 80.0 * (25.0 * (z + x)).cos()]
}

/// Colours of a ball, as seen on its surface. `shift_m`: of the ball, which takes its colours with it.
fn seen(volume: &SparseVolume, shift_m: f32) -> Vec<ColourSample> {
    let mesh = isv_surface::extract_surface(volume, &isv_surface::SurfaceOptions { normals: true });
    let mut random = Random::new(3);
    let mut samples = Vec::new();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(face);
        for _ in 0..3 {
            let (mut u, mut v) = (random.signed().abs(), random.signed().abs());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let position = (a + (b - a) * u + (c - a) * v).as_vec3().to_array();
            let own = [position[0] - shift_m, position[1], position[2]];
            let normal = mesh.normals[triangle[0] as usize].as_vec3().to_array();
            samples.push(ColourSample { position, normal, colour: painted(own), weight: 1.0 });
        }
    }
    samples
}

/// Peak signal to noise of luma at points where colours were seen (dB).
fn luma_psnr_db(frame: &ColourFrame, samples: &[ColourSample]) -> f64 {
    let mut reader = Reader::new(frame);
    let mut squares = 0.0;
    for sample in samples {
        let (onto, normal, _) = locate(&mut reader, &grid(), sample).unwrap();
        let found = reader.read(onto, normal, 2).unwrap();
        squares += (f64::from(found[0]) / 64.0 - ycbcr_from_rgb(sample.colour)[0]).powi(2);
    }
    10.0 * (255.0f64.powi(2) * samples.len() as f64 / squares).log10()
}

/// Frames of a ball that moves and takes its colours with it.
fn take(frames: u32) -> Vec<(SparseVolume, Vec<ColourSample>)> {
    let frame = |t| {
        let volume = ball(grid(), f64::from(t));
        let samples = seen(&volume, 0.0);
        (volume, samples)
    };
    (0..frames).map(frame).collect()
}

fn settings(layers: u8) -> ColourSettings {
    ColourSettings { layers, checksums: true, ..ColourSettings::default() }
}

#[test]
fn decoder_agrees_with_the_encoders_reconstruction() {
    let take = take(5);
    let usual = settings(2);
    let variants = [
        usual,
        settings(1),
        settings(3),
        ColourSettings { slices: 3, step: 4.0, key_step: 2.0, ..usual },
        ColourSettings { cycle: Some(3), ..usual },
        ColourSettings { step: 4000.0, key_step: 4000.0, ..usual },
        ColourSettings { step: 0.01, key_step: 0.01, rounds: 0, ..usual },
    ];
    for settings in variants {
        let (mut encoder, mut decoder) = (ColourEncoder::new(settings), ColourDecoder::new(settings.layers));
        for (number, (volume, samples)) in take.iter().enumerate() {
            let coded = encoder.encode(volume, samples, number == 0);
            let decoded = decoder.decode(volume, &coded.bytes, 0, true).unwrap();
            assert_eq!(decoded.hash(), encoder.reconstruction().unwrap().hash(), "{settings:?}");
        }
    }
}

#[test]
fn finer_steps_and_more_layers_come_nearer() {
    let (volume, samples) = &take(1)[0];
    let psnr = |settings: ColourSettings| {
        let mut encoder = ColourEncoder::new(settings);
        let bytes = encoder.encode(volume, samples, true).bytes.len();
        (luma_psnr_db(encoder.reconstruction().unwrap(), samples), bytes)
    };
    let coarse = psnr(ColourSettings { key_step: 60.0, ..settings(2) });
    let fine = psnr(ColourSettings { key_step: 6.0, ..settings(2) });
    let flat = psnr(ColourSettings { key_step: 6.0, ..settings(1) });
    println!("coarse {coarse:?}, fine {fine:?}, one layer {flat:?} (dB, bytes)");
    assert!(fine.0 > coarse.0 + 4.0 && coarse.1 < fine.1 / 3);
    assert!(fine.0 > flat.0 + 2.0);
    assert!(fine.0 > 38.0);
}

#[test]
fn what_stands_still_costs_next_to_nothing() {
    let volume = ball(grid(), 0.0);
    let samples = seen(&volume, 0.0);
    let mut encoder = ColourEncoder::new(settings(2));
    let key = encoder.encode(&volume, &samples, true).bytes.len();
    let first = encoder.reconstruction().unwrap().hash();
    for _ in 0..3 {
        let bytes = encoder.encode(&volume, &[], false).bytes.len();
        println!("keyframe {key} bytes, then {bytes}");
        assert!(bytes < 40);
        assert_eq!(encoder.reconstruction().unwrap().hash(), first, "nothing is blurred");
    }
    let again = encoder.encode(&volume, &samples, false).bytes.len();
    assert!(10 * again < key, "{again} bytes");
}

#[test]
fn frames_without_a_colour_part_keep_their_colour() {
    let take = take(2);
    let mut encoder = ColourEncoder::new(settings(2));
    let key = encoder.encode(&take[0].0, &take[0].1, true);
    let mut decoder = ColourDecoder::new(2);
    assert!(decoder.carry_over(&take[0].0).unwrap().is_none(), "there is no colour yet");
    decoder.decode(&take[0].0, &key.bytes, 0, true).unwrap();
    let carried = decoder.carry_over(&take[1].0).unwrap().unwrap();
    let psnr = luma_psnr_db(carried, &take[1].1);
    assert!(psnr > 15.0, "{psnr} dB");
}

#[test]
fn frames_that_need_others_are_refused_without_them() {
    let take = take(4);
    let coded = |settings: ColourSettings| -> Vec<EncodedColour> {
        let mut encoder = ColourEncoder::new(settings);
        take.iter()
            .enumerate()
            .map(|(n, (volume, samples))| encoder.encode(volume, samples, n == 0))
            .collect()
    };
    let frames = coded(settings(2));
    let mut decoder = ColourDecoder::new(2);
    let refused = decoder.decode(&take[1].0, &frames[1].bytes, 0, true);
    assert!(matches!(refused, Err(ColourError::NoReference)));
    decoder.decode(&take[0].0, &frames[0].bytes, 0, true).unwrap();
    decoder.lose();
    assert!(matches!(decoder.decode(&take[2].0, &frames[2].bytes, 0, true), Err(ColourError::NoReference)));

    // Resilient frames can be entered anywhere.
    let frames = coded(ColourSettings { cycle: Some(3), ..settings(2) });
    let kinds = frames.iter().map(|frame| ColourPayload::parse(&frame.bytes, 0, 2).unwrap().header.kind);
    let [intra, resilient] = [ColourKind::Intra, ColourKind::Resilient];
    assert_eq!(kinds.collect::<Vec<_>>(), [intra, resilient, resilient, resilient]);
    let mut decoder = ColourDecoder::new(2);
    decoder.decode(&take[2].0, &frames[2].bytes, 0, false).unwrap();
    decoder.decode(&take[3].0, &frames[3].bytes, 0, true).unwrap();
}

/// Damaged bytes decode to something or to an error, without a panic.
#[test]
fn damaged_parts_do_no_harm() {
    let take = take(2);
    let mut encoder = ColourEncoder::new(ColourSettings { checksums: false, ..settings(3) });
    let key = encoder.encode(&take[0].0, &take[0].1, true).bytes;
    let next = encoder.encode(&take[1].0, &take[1].1, false).bytes;
    let mut whole = ColourDecoder::new(3);
    whole.decode(&take[0].0, &key, 0, true).unwrap();
    for length in (0..next.len()).step_by(7) {
        assert!(whole.clone().decode(&take[1].0, &next[..length], 0, true).is_err(), "{length} bytes");
    }
    let mut random = Random::new(17);
    for _ in 0..40 {
        let mut damaged = next.clone();
        for _ in 0..4 {
            let at = (random.signed().abs() * damaged.len() as f64) as usize;
            damaged[at.min(next.len() - 1)] ^= 1 << ((random.signed().abs() * 8.0) as u32 & 7);
        }
        let _ = whole.clone().decode(&take[1].0, &damaged, 0, true);
        // The colour of one frame on the surface of another.
        let _ = whole.clone().decode(&take[0].0, &damaged, 0, true);
        let _ = ColourDecoder::new(3).decode(&take[1].0, &damaged, 0, true);
    }
}

#[test]
fn colours_of_vertices_are_those_seen() {
    let volume = still_and_moving_ball(grid(), 0.0);
    let samples = seen(&volume, 0.0);
    let mut encoder = ColourEncoder::new(ColourSettings { key_step: 4.0, ..settings(2) });
    encoder.encode(&volume, &samples, true);
    let frame = encoder.reconstruction().unwrap();
    let points: Vec<[f64; 3]> = samples.iter().map(|sample| sample.position.map(f64::from)).collect();
    let colours = surface_colours(frame, &grid(), &points);
    let off = |(colour, sample): (&[u8; 3], &ColourSample)| {
        (0..3)
            .map(|c| (f64::from(colour[c]) - f64::from(sample.colour[c].clamp(0.0, 255.0))).abs())
            .sum::<f64>()
            / 3.0
    };
    let mean = colours.iter().zip(&samples).map(off).sum::<f64>() / samples.len() as f64;
    assert!(mean < 6.0, "{mean} of 255 off on average");
    assert_eq!(surface_colours(frame, &grid(), &[[1e12, 0.0, 0.0], [5.0; 3]]), [[128; 3]; 2], "far away");
    // Coding what was decoded again gives it again, nearly.
    let mut again = ColourEncoder::new(ColourSettings { key_step: 4.0, ..settings(2) });
    again.encode(&volume, &frame.to_samples(&grid()), true);
    let psnr = luma_psnr_db(again.reconstruction().unwrap(), &frame.to_samples(&grid()));
    assert!(psnr > 38.0, "{psnr} dB");
}

/// Bits of geometry and of colour of ten seconds of a ball that rolls to and fro, coded at a rate.
fn at_rate(
    bitrate: Bitrate,
    cycle: &[(SparseVolume, Vec<ColourSample>)],
    settings: ColourSettings,
) -> Vec<[f64; 2]> {
    let main = MainSettings { target: RateTarget::Bitrate(bitrate), ..MainSettings::default() };
    let header = StreamHeader::new(Profile::Main, grid(), isv_format::FrameRate::DEFAULT);
    let mut coder = FrameCoder::on_cpu(&header, EncoderSettings { main, ..EncoderSettings::default() });
    let (mut writer, mut colours) = (FrameWriter::default(), ColourEncoder::new(settings));
    let code = |(volume, samples): &(SparseVolume, Vec<ColourSample>)| {
        let frame = coder.code(volume).unwrap();
        let decoded = coder.reconstruction().unwrap().clone();
        let colour = colours.encode_at_rate(&decoded, samples, frame.is_keyframe(), coder.colour_rate());
        let geometry = PacketHeader::BYTES + writer.write(frame).payload().to_bytes().len() + 8;
        [geometry, colour.bytes.len()].map(|bytes| 8.0 * bytes as f64)
    };
    cycle.iter().cycle().take(300).map(code).collect()
}

#[test]
fn a_rate_pays_for_geometry_and_colour() {
    let frame = |t: u32| {
        let shift = 2.0 * (f64::from(t) / 7.0).sin();
        let volume = ball(grid(), shift);
        let samples = seen(&volume, (shift * 0.005) as f32);
        (volume, samples)
    };
    let cycle: Vec<_> = (0..44).map(frame).collect();
    let usual = ColourSettings { rounds: 1, ..ColourSettings::default() }.with_preset(Preset::Realtime);
    let mut shares = Vec::new();
    for (rate, colour) in
        [(60e3, ColourShare::Joint), (150e3, ColourShare::Joint), (100e3, ColourShare::Fixed)]
    {
        let bits = at_rate(Bitrate { colour, ..Bitrate::new(rate, 30.0) }, &cycle, usual);
        let (mut level, mut fullest) = (0.0f64, 0.0f64);
        for [geometry, colour] in &bits {
            level += geometry + colour;
            fullest = fullest.max(level);
            level = (level - rate / 30.0).max(0.0);
        }
        let sums = [0, 1].map(|part| bits.iter().map(|own| own[part]).sum::<f64>());
        let accuracy = (sums[0] + sums[1]) / (10.0 * rate) - 1.0;
        let share = sums[1] / (sums[0] + sums[1]);
        println!(
            "{rate}, {colour:?}: {:+.2} %, buffer at most {:.3} s, colour {share:.2} of it",
            100.0 * accuracy,
            fullest / rate
        );
        assert!(accuracy.abs() <= 0.05 && fullest <= rate, "{rate}: {accuracy}, {}", fullest / rate);
        shares.push(share);
    }
    assert!(shares[..2].iter().all(|share| (0.2..0.9).contains(share)), "{shares:?}");
}
