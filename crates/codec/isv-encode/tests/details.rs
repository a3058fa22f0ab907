//! What the decoder says of each block is what the frame's bytes hold.

mod support;

use isv_decode::{BlockCoding, BlockDetail, Decoder, Limits};
use isv_encode::{EncoderSettings, MotionMode};
use isv_format::{FramePayload, PacketKind, Prediction, StreamHeader};
use isv_testkit::still_and_moving_ball;
use isv_volume::SparseVolume;
use support::{ball, encode, header, main_header, packets};

/// Details of each frame, its decoded blocks, and the bits of the segments that the details tell of.
fn details(
    header: &StreamHeader,
    settings: EncoderSettings,
    volumes: &[SparseVolume],
) -> Vec<(Vec<BlockDetail>, SparseVolume, f64)> {
    let (bytes, _) = encode(header, settings, volumes);
    let mut decoder = Decoder::new(header, Limits::default());
    decoder.keep_details(true);
    let frames = packets(&bytes).into_iter().map(|packet| {
        let volume = decoder.decode_and_verify(&packet).unwrap().volume.clone();
        let hashed = matches!(packet.header.kind, PacketKind::Frame { hashed: true, .. });
        let payload = FramePayload::parse(&packet.payload, 0, hashed, &header.profile).unwrap();
        let bytes: usize =
            payload.slices.iter().map(|slice| slice.modes.len() + slice.coefficients.len()).sum();
        (decoder.details().to_vec(), volume, 8.0 * bytes as f64)
    });
    frames.collect()
}

fn settings(slices: u16) -> EncoderSettings {
    EncoderSettings { gop: 4, checksums: true, slices: Some(slices), ..EncoderSettings::default() }
}

/// Bits, and the mean motion of predicted blocks in voxels.
fn sums(details: &[BlockDetail]) -> (f64, [f64; 3]) {
    let bits = details.iter().map(|block| f64::from(block.bits)).sum();
    let froms: Vec<[i16; 3]> = details
        .iter()
        .filter_map(|block| match block.coding {
            BlockCoding::Predicted { from } => Some(from),
            _ => None,
        })
        .collect();
    let mean =
        |c: usize| froms.iter().map(|from| -f64::from(from[c]) / 4.0).sum::<f64>() / froms.len() as f64;
    (bits, [0, 1, 2].map(mean))
}

fn assert_details_fit(frames: &[(Vec<BlockDetail>, SparseVolume, f64)], slices: f64) {
    for (number, (details, volume, segments)) in frames.iter().enumerate() {
        let (bits, motion) = sums(details);
        println!(
            "frame {number}: {} blocks, {bits:.1} bits of {segments}, motion {motion:.2?}",
            details.len()
        );
        // Each of a slice's two segments ends at a whole byte, up to four zero bytes left off or a byte more.
        assert!((bits - segments).abs() <= slices * 2.0 * 40.0, "{bits} bits in {segments}");
        assert!(details.iter().all(|block| block.bits >= 0.0));
        assert!(details.is_sorted_by_key(|block| block.coord.morton()));
        assert!(details.iter().all(|block| volume.coords().contains(&block.coord)));
        let alone = details.iter().all(|block| block.coding == BlockCoding::Alone);
        assert_eq!(alone, number % 4 == 0);
        if !alone {
            for (found, moved) in motion.into_iter().zip([1.3, -0.7, 0.4]) {
                assert!((found - moved).abs() < 0.5, "{motion:?}");
            }
        }
    }
}

#[test]
fn bits_and_vectors_of_profile_paper_are_told_by_block() {
    for slices in [1, 3] {
        let header = header(8, 8, 64);
        let volumes: Vec<_> = (0..6).map(|t| ball(header.grid, f64::from(t))).collect();
        let motion = MotionMode::Fixed(Prediction::ThreeDof);
        let frames = details(&header, EncoderSettings { motion, ..settings(slices) }, &volumes);
        assert!(frames.iter().all(|(details, volume, _)| details.len() == volume.block_count()));
        assert_details_fit(&frames, f64::from(slices));
    }
}

#[test]
fn bits_and_vectors_of_profile_main_are_told_by_block() {
    for slices in [1, 3] {
        let header = main_header(8);
        let volumes: Vec<_> = (0..6).map(|t| ball(header.grid, f64::from(t))).collect();
        assert_details_fit(&details(&header, settings(slices), &volumes), f64::from(slices));
    }
}

#[test]
fn blocks_that_stay_are_told_and_take_no_bits() {
    let header = main_header(8);
    let volumes = [0.0, 1.0, 2.0].map(|t| still_and_moving_ball(header.grid, t));
    let frames = details(&header, settings(1), &volumes);
    for (details, ..) in &frames[1..] {
        let is_still = |block: &&BlockDetail| block.coding == BlockCoding::Still;
        let (skipped, coded): (Vec<&BlockDetail>, Vec<&BlockDetail>) = details.iter().partition(is_still);
        assert!(skipped.len() > 20 && coded.len() > 20, "{} stay, {} are coded", skipped.len(), coded.len());
        assert!(skipped.iter().all(|block| block.bits == 0.0));
        assert!(details.is_sorted_by_key(|block| block.coord.morton()));
    }
}

#[test]
fn details_are_kept_only_where_they_are_wanted_and_true() {
    let header = header(8, 8, 64);
    let (bytes, _) = encode(&header, settings(1), &[ball(header.grid, 0.0), ball(header.grid, 1.0)]);
    let packets = packets(&bytes);
    let mut decoder = Decoder::new(&header, Limits::default());
    decoder.decode(&packets[0]).unwrap();
    assert!(decoder.details().is_empty());
    decoder.keep_details(true);
    decoder.decode(&packets[1]).unwrap();
    assert!(!decoder.details().is_empty());
    decoder.decode(&packets[1]).unwrap_err();
    assert!(decoder.details().is_empty());
    decoder.decode(&packets[0]).unwrap();
    decoder.keep_details(false);
    decoder.decode(&packets[1]).unwrap();
    assert!(decoder.details().is_empty());
}
