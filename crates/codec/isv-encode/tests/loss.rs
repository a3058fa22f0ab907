//! Streams that lose packets: a decoder says what it does not have, goes on where it can, and what it says to be exact is.

mod support;

use isv_decode::main::ExactBlocks;
use isv_decode::{DecodeError, Decoder, Limits, volume_hash};
use isv_encode::{EncoderSettings, MainSettings, Refresh};
use isv_format::{FrameCoding, FramePayload, MaskCoding, Packet, Profile, StreamHeader};
use isv_testkit::{Random, still_and_moving_ball};
use isv_volume::{SparseVolume, VolumeBuilder};
use std::sync::OnceLock;
use support::{ball, decode, encode, forged, main_header, packets};

/// Frames in which a volume is refreshed.
const CYCLE: usize = 5;
const FRAMES: usize = 20;
const LIMITS: Limits = Limits { frame_voxels: 1 << 24, voxels_per_byte: usize::MAX };

fn header() -> StreamHeader {
    main_header(8).with_mask_coding(MaskCoding::Cells)
}

fn settings(slices: u16) -> EncoderSettings {
    let main = MainSettings { refresh: Refresh::Gradual, ..Default::default() };
    EncoderSettings { gop: CYCLE as u32, checksums: true, slices: Some(slices), main, ..Default::default() }
}

/// A ball with a hole, which moves.
fn volumes() -> Vec<SparseVolume> {
    (0..FRAMES).map(|t| ball(header().grid, t as f64 / 2.0)).collect()
}

/// The packets of a stream with gradual refresh in two slices, and what is decoded from all of them.
fn stream() -> &'static (Vec<Packet>, Vec<SparseVolume>) {
    static STREAM: OnceLock<(Vec<Packet>, Vec<SparseVolume>)> = OnceLock::new();
    STREAM.get_or_init(|| {
        let (bytes, hashes) = encode(&header(), settings(2), &volumes());
        let (decoded, end) = decode(&bytes);
        end.unwrap();
        assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes);
        (packets(&bytes), decoded)
    })
}

/// Decodes the packets that are not lost; for each frame, how many blocks are not exact, or `None` where nothing was decoded. Holds
/// every block that is said to be exact against the volume `whole` of the frame.
fn decode_with_losses(
    packets: &[Packet],
    whole: &[SparseVolume],
    lost: impl Fn(usize) -> bool,
) -> Vec<Option<usize>> {
    let mut decoder = Decoder::new(&header(), LIMITS);
    decoder.recover(true);
    let mut found = Vec::new();
    for (frame, packet) in packets.iter().enumerate() {
        if lost(frame) {
            found.push(None);
            continue;
        }
        let Ok(decoded) = decoder.decode_and_verify(packet) else {
            found.push(None);
            continue;
        };
        let (volume, inexact) = (decoded.volume.clone(), decoded.inexact_blocks);
        found.push(Some(inexact));
        assert_eq!(volume.coords(), whole[frame].coords(), "frame {frame}: the block set is always exact");
        let exact = decoder.exact_blocks();
        assert_eq!(exact.map_or(0, ExactBlocks::inexact), inexact);
        for block in 0..volume.block_count() {
            if exact.is_none_or(|exact| exact.contains(block)) {
                assert_eq!(volume.block(block), whole[frame].block(block), "frame {frame}, block {block}");
            }
        }
        if inexact == 0 {
            assert_eq!(volume_hash(&volume), volume_hash(&whole[frame]), "frame {frame}: masks too");
        }
    }
    found
}

#[test]
fn only_the_first_frame_is_a_keyframe_and_slices_do_not_matter() {
    for slices in [1, 3] {
        let (bytes, hashes) = encode(&header(), settings(slices), &volumes()[..8]);
        let (decoded, end) = decode(&bytes);
        end.unwrap();
        assert_eq!(decoded.iter().map(volume_hash).collect::<Vec<_>>(), hashes, "{slices} slices");
        let keyframes = packets(&bytes).iter().filter(|packet| packet.is_keyframe()).count();
        assert_eq!(keyframes, 1, "{slices} slices");
    }
}

/// A decoder that begins between keyframes does not have the bytes of those: what it refuses for that counts for the next frame.
#[test]
fn bytes_of_refused_frames_count() {
    // A floor, of more blocks with those around it than a stream may have without bytes for them.
    let mut floor = VolumeBuilder::new(header().grid);
    for place in 0..64 * 64 {
        let samples = (0..512).map(|voxel| 256 * (voxel / 64) - 1000).collect();
        floor.push([place % 64, place / 64, 0].into(), samples, None);
    }
    let (bytes, _) = encode(&header(), settings(1), &vec![floor.finish(); 3]);
    let packets = packets(&bytes);
    let size = |frame: usize| packets[frame].total_bytes();
    let needed = 66 * 66 * 3 * 512 - Limits::FREE_VOXELS;
    let voxels_per_byte = needed.div_ceil(size(1) + size(2));
    let mut decoder = Decoder::new(&header(), Limits { voxels_per_byte, ..LIMITS });
    decoder.recover(true);
    let refused = decoder.decode(&packets[1]).unwrap_err();
    assert!(matches!(refused, DecodeError::TooFewBytes { .. }), "{refused}");
    assert_eq!(decoder.decode(&packets[2]).unwrap().volume.block_count(), 66 * 66 * 3);
}

/// After any single loss all is exact again when the next cycle ends, and the part of it that is not falls meanwhile.
#[test]
fn one_lost_packet_is_made_good_within_two_cycles() {
    let (packets, whole) = stream();
    for lost in 1..CYCLE + 1 {
        let found = decode_with_losses(packets, whole, |frame| frame == lost);
        println!("lost {lost}: {found:?}");
        assert!(found[..lost].iter().all(|inexact| *inexact == Some(0)));
        assert!(
            found[lost + 1].is_some_and(|inexact| inexact > 0),
            "frame {} is decoded, not exact",
            lost + 1
        );
        // The keyframe is frame 0, so cycles begin at frames 1, 6, 11.
        let whole_again = (lost.div_ceil(CYCLE) + 1) * CYCLE;
        assert!(found[whole_again..].iter().all(|inexact| *inexact == Some(0)), "from {whole_again} on");
    }
}

#[test]
fn what_is_said_to_be_exact_is_under_random_losses() {
    let (packets, whole) = stream();
    let mut random = Random::new(5);
    let (mut exact, mut inexact) = (0, 0);
    for share in [0.05, 0.2, 0.5] {
        for _ in 0..6 {
            let lost: Vec<bool> = packets.iter().map(|_| random.signed().abs() < share).collect();
            for found in decode_with_losses(packets, whole, |frame| lost[frame]).into_iter().flatten() {
                if found == 0 { exact += 1 } else { inexact += 1 }
            }
        }
    }
    println!("{exact} frames exact, {inexact} not");
    assert!(exact > 30 && inexact > 30);
}

/// With an in-loop filter, which our encoder does not use here, errors go over the faces of blocks.
#[test]
fn what_is_said_to_be_exact_is_whatever_the_filter_and_the_prediction_of_spatial_blocks() {
    for (filter, no_spatial_prediction) in [(20, false), (0, true), (7, true)] {
        let changed: Vec<Packet> = stream()
            .0
            .iter()
            .map(|packet| {
                let mut payload = FramePayload::parse(&packet.payload, 0, true, &Profile::Main).unwrap();
                let FrameCoding::Main(main) = &mut payload.header.coding else { panic!("profile main") };
                (main.filter, main.filter_limit) = (filter, if filter > 0 { 90 } else { 0 });
                main.no_spatial_prediction = no_spatial_prediction;
                // Where masks can be depends on samples, which are others now: none.
                payload.masks = &[0xff];
                payload.header.volume_hash = Some(0);
                forged(packet, payload.to_bytes())
            })
            .collect();
        let mut decoder = Decoder::new(&header(), LIMITS);
        let whole: Vec<SparseVolume> =
            changed.iter().map(|packet| decoder.decode(packet).unwrap().volume.clone()).collect();
        let mut decoder = Decoder::new(&header(), LIMITS);
        decoder.recover(true);
        let mut exact_blocks = 0;
        for (frame, packet) in changed.iter().enumerate().filter(|(frame, _)| *frame != 2) {
            let volume = decoder.decode(packet).unwrap().volume.clone();
            let exact = decoder.exact_blocks();
            for block in (0..volume.block_count()).filter(|b| exact.is_none_or(|e| e.contains(*b))) {
                exact_blocks += usize::from(frame > 2);
                assert_eq!(volume.block(block), whole[frame].block(block), "frame {frame}, filter {filter}");
            }
        }
        println!("filter {filter}: {exact_blocks} blocks exact");
        assert!(exact_blocks > if filter > 0 { 5 } else { 100 });
    }
}

/// A ball that moves evenly, and a frame of it that is lost. The frame behind the loss is nearer to where it should be than the
/// last one before. Over the frames of a cycle it is half as far at most; single ones scatter.
#[test]
fn what_is_not_exact_yet_is_near() {
    let (packets, whole) = stream();
    let (mut all_near, mut all_old) = (0.0, 0.0);
    for lost in CYCLE..2 * CYCLE {
        let mut decoder = Decoder::new(&header(), LIMITS);
        decoder.recover(true);
        for packet in &packets[..lost] {
            decoder.decode(packet).unwrap();
        }
        let held = decoder.volume().unwrap().clone();
        let shown = decoder.decode(&packets[lost + 1]).unwrap();
        assert!(shown.inexact_blocks > 0);
        let (near, old) = (difference(shown.volume, &whole[lost + 1]), difference(&held, &whole[lost + 1]));
        println!("frame {}: {near:.0} codes off, {old:.0} if the last one were held", lost + 1);
        assert!(near < old);
        all_near += near;
        all_old += old;
    }
    assert!(all_near < 0.5 * all_old, "{all_near} codes off, {all_old} if the last ones were held");
}

/// Mean difference of the samples of blocks that both volumes have.
fn difference(a: &SparseVolume, b: &SparseVolume) -> f64 {
    let index = b.index();
    let (mut sum, mut count) = (0.0, 0.0);
    for (block, coord) in a.coords().iter().enumerate() {
        let Some(there) = index.get(*coord) else { continue };
        for (a, b) in a.block(block).iter().zip(b.block(there as usize)) {
            sum += f64::from(i32::from(*a) - i32::from(*b)).abs();
            count += 1.0;
        }
    }
    sum / count
}

/// What comes into a room late has nothing at first, and all in the end.
#[test]
fn a_stream_can_be_entered_at_any_resilient_frame() {
    let (packets, whole) = stream();
    for first in 1..CYCLE + 1 {
        let found = decode_with_losses(packets, whole, |frame| frame < first);
        assert!(found[first].is_some_and(|inexact| inexact > 0));
        let whole_at = (first.saturating_sub(1).div_ceil(CYCLE) + 1) * CYCLE;
        assert!(found[whole_at..].iter().all(|inexact| *inexact == Some(0)), "from {first}: {found:?}");
    }
}

#[test]
fn who_does_not_ask_for_it_waits_for_a_keyframe() {
    let (packets, _) = stream();
    let mut decoder = Decoder::new(&header(), LIMITS);
    decoder.decode(&packets[0]).unwrap();
    assert!(matches!(
        decoder.decode(&packets[2]),
        Err(DecodeError::MissingFrame { expected: 1, found: 2, .. })
    ));
    assert!(decoder.volume().is_none());
    assert!(matches!(decoder.decode(&packets[3]), Err(DecodeError::NoReference { .. })));
}

/// Frames that are not resilient are refused after a loss, and the last volume before it stays; after the next keyframe all is exact.
#[test]
fn other_frames_wait_for_a_keyframe() {
    let volumes: Vec<_> = (0..8).map(|t| still_and_moving_ball(header().grid, f64::from(t))).collect();
    let settings = EncoderSettings { gop: 4, checksums: true, ..Default::default() };
    let (bytes, hashes) = encode(&header(), settings, &volumes);
    let packets = packets(&bytes);
    let mut decoder = Decoder::new(&header(), LIMITS);
    decoder.recover(true);
    let keyframe = |frame: &usize| packets[*frame].is_keyframe();
    let next = (2..8).find(keyframe).expect("one every four frames");
    decoder.decode(&packets[0]).unwrap();
    for packet in &packets[2..next] {
        assert!(decoder.decode(packet).is_err());
        assert_eq!(volume_hash(decoder.volume().expect("the last one stays")), hashes[0]);
    }
    for frame in next..8 {
        let decoded = decoder.decode_and_verify(&packets[frame]).unwrap();
        assert_eq!((volume_hash(decoded.volume), decoded.inexact_blocks), (hashes[frame], 0));
    }
}
