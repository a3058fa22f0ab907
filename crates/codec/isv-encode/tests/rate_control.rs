//! Profile `main`: rates are met, buffers and errors are kept, cuts become keyframes.

mod support;

use glam::DVec3;
use isv_encode::{
    Bitrate, EncodedFrame, Encoder, EncoderSettings, FrameQuality, MainSettings, Preset, RateTarget,
    surface_distance_voxels,
};
use isv_format::{PacketHeader, Profile, StreamHeader};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::volume_of;
use isv_volume::SparseVolume;
use support::ball;

const FPS: f64 = 30.0;

fn main_header() -> StreamHeader {
    StreamHeader { profile: Profile::Main, ..support::header(8, 8, 64) }
}

fn settings(main: MainSettings) -> EncoderSettings {
    EncoderSettings { gop: 30, main, ..EncoderSettings::default() }
}

/// Bytes of each frame with its entry in the index, its surface error, and whether it is a keyframe.
fn encode<'a>(
    settings: EncoderSettings,
    volumes: impl IntoIterator<Item = &'a SparseVolume>,
) -> Vec<(usize, f64, bool)> {
    let mut encoder = Encoder::new(&main_header(), settings);
    let mut one = |volume: &SparseVolume| {
        let frame = encoder.encode(volume);
        let error = surface_distance_voxels(volume, encoder.reconstruction().unwrap());
        (stream_bytes(&frame), error, frame.keyframe)
    };
    volumes.into_iter().map(&mut one).collect()
}

fn stream_bytes(frame: &EncodedFrame) -> usize {
    PacketHeader::BYTES + frame.payload().to_bytes().len() + 8
}

/// A ball that rolls to and fro.
fn rolling(frames: usize) -> Vec<SparseVolume> {
    (0..frames).map(|t| ball(main_header().grid, 4.0 * (t as f64 / 7.0).sin())).collect()
}

/// A box that has nothing in common with the ball.
fn block() -> SparseVolume {
    let distance = |[x, y, z]: [f64; 3]| {
        let q = [x.abs() - 19.0, (y + 3.0).abs() - 5.0, z.abs() - 12.0];
        let outside = q.map(|d| d.max(0.0));
        outside.iter().map(|d| d * d).sum::<f64>().sqrt()
            + q[0].max(q[1]).max(q[2]).min(0.0)
            + 0.6 * (0.7 * x).sin() * (0.9 * z).cos()
    };
    volume_of(main_header().grid, 5, distance, |_| false)
}

#[test]
fn rates_are_met_within_5_percent_over_10_seconds_and_the_buffer_is_never_overrun() {
    let cycle = rolling(44);
    let constant = |step| {
        let main = MainSettings { quality: FrameQuality::of_step(step), ..MainSettings::default() };
        let frames = encode(settings(main), cycle.iter().take(30));
        frames.iter().map(|f| 8.0 * f.0 as f64).sum::<f64>()
    };
    let (most, least) = (constant(0.8), constant(5.0));
    assert!(most > 1.5 * least);
    for share in [0.2, 0.5, 0.8] {
        let rate = least.powf(1.0 - share) * most.powf(share);
        let target = RateTarget::Bitrate(Bitrate::new(rate, FPS));
        let main = MainSettings { target, ..MainSettings::default() };
        let frames = encode(settings(main), cycle.iter().cycle().take(300));
        let (mut level, mut fullest, mut total) = (0.0_f64, 0.0_f64, 0.0);
        for (bytes, ..) in &frames {
            let bits = 8.0 * *bytes as f64;
            total += bits;
            level += bits;
            fullest = fullest.max(level);
            level = (level - rate / FPS).max(0.0);
        }
        let accuracy = total / (10.0 * rate) - 1.0;
        println!(
            "{:.0} kbps: {:+.2} %, buffer at most {:.3} s",
            rate / 1e3,
            100.0 * accuracy,
            fullest / rate
        );
        assert!(accuracy.abs() <= 0.05 && fullest <= rate, "{rate}: {accuracy}, {}", fullest / rate);
    }
}

#[test]
fn a_rate_is_kept_through_a_cut() {
    let volumes: Vec<_> = rolling(40).into_iter().chain(std::iter::repeat_n(block(), 40)).collect();
    let rate = 120e3;
    let target = RateTarget::Bitrate(Bitrate { buffer_s: 0.4, ..Bitrate::new(rate, FPS) });
    let frames = encode(settings(MainSettings { target, ..MainSettings::default() }), &volumes);
    let mut level = 0.0_f64;
    for (frame, (bytes, ..)) in frames.iter().enumerate() {
        level += 8.0 * *bytes as f64;
        assert!(level <= 0.4 * rate, "frame {frame}: {level}");
        level = (level - rate / FPS).max(0.0);
    }
}

/// What has gone before a pause is as good as what comes after it: an empty stage, or a person who stands still.
#[test]
fn a_pause_costs_what_comes_after_it_nothing() {
    const PAUSE: usize = 45;
    let moving = rolling(60);
    let empty = SparseVolume::empty(main_header().grid);
    let main = MainSettings { quality: FrameQuality::of_step(2.0), ..MainSettings::default() };
    let plain = encode(settings(main), &moving);
    for pause in [&empty, &moving[14]] {
        let paused = moving[..15].iter().chain(std::iter::repeat_n(pause, PAUSE)).chain(&moving[15..]);
        let paused = encode(settings(main), paused);
        // The next keyframe but one begins where another would have.
        let [after, before] = [&paused[PAUSE + 30..], &plain[30..]];
        let bytes = |frames: &[(usize, f64, bool)]| frames.iter().map(|f| f.0).sum::<usize>() as f64;
        let keyframes = |frames: &[(usize, f64, bool)]| frames.iter().filter(|f| f.2).count();
        assert!(bytes(after) < 1.1 * bytes(before), "{} and {}", bytes(after), bytes(before));
        assert!(keyframes(after) <= 2, "{after:?}");
        let first = paused[PAUSE + 15].0 as f64;
        assert!(first < 1.6 * plain[0].0 as f64, "{first} and {}", plain[0].0);
    }
}

#[test]
fn empty_frames_say_nothing_of_steps() {
    let empty = SparseVolume::empty(main_header().grid);
    let moving = rolling(60);
    let target = RateTarget::Bitrate(Bitrate::new(100e3, FPS));
    let of_mean =
        |frames: &[(usize, f64, bool)]| frames.iter().map(|f| f.1).sum::<f64>() / frames.len() as f64;
    let target = MainSettings { target, ..MainSettings::default() };
    let plain = encode(settings(target), &moving);
    let begun = encode(settings(target), std::iter::repeat_n(&empty, 3).chain(&moving));
    let (first, usual) = (begun[3].0 as f64, plain[0].0 as f64);
    assert!(first < 1.5 * usual, "{first} and {usual} bytes");
    let (error, usual) = (of_mean(&begun[13..]), of_mean(&plain[10..]));
    assert!(error < 1.2 * usual, "{error} and {usual} voxels");
}

#[test]
fn no_frame_exceeds_the_error_asked_for() {
    let volumes = rolling(20);
    for bound in [0.05, 0.12, 0.25] {
        let main = MainSettings { target: RateTarget::MaxError(bound), ..MainSettings::default() };
        let frames = encode(settings(main), &volumes);
        let errors: Vec<f64> = frames.iter().map(|f| f.1).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        println!("{bound}: mean {mean:.4}, {errors:.3?}");
        assert!(errors.iter().all(|error| *error <= bound));
        assert!(mean > 0.6 * bound, "{bound}: {mean} is better than was asked for");
    }
    let main = MainSettings { target: RateTarget::MaxError(1e-9), ..MainSettings::default() };
    assert!(encode(settings(main), &volumes[..2])[1].1 > 1e-9, "the finest step is the end");
}

#[test]
fn the_error_asked_for_is_kept_where_what_stands_still_is_what_is_left() {
    let rough = |x: f64, y: f64, z: f64| {
        let q =
            [(x - 36.0).abs() - 14.0, y.abs() - 15.0, z.abs() - 13.0].map(|d| d + (0.9 * (x + y + z)).sin());
        q[0].max(q[1]).max(q[2])
    };
    let smooth = |x: f64, y: f64, z: f64| ((x + 34.0).powi(2) + y * y + z * z).sqrt() - 22.0;
    let both = volume_of(main_header().grid, 9, |[x, y, z]| rough(x, y, z).min(smooth(x, y, z)), |_| false);
    let alone = volume_of(main_header().grid, 9, |[x, y, z]| rough(x, y, z), |_| false);
    let bound = 0.2;
    let main = MainSettings { target: RateTarget::MaxError(bound), ..MainSettings::default() };
    let frames = encode(settings(main), [&both, &alone, &alone]);
    println!("{frames:.3?}");
    assert!(frames.iter().all(|(_, error, _)| *error <= bound), "{frames:?}");
    // Not by the finest step there is.
    assert!(frames[1].1 > 0.5 * bound, "{frames:?}");
}

/// Balls beside a large one that hardly count by their area, and are the first to be lost where a step is coarse.
#[test]
fn the_error_asked_for_is_kept_by_keeping_small_bodies() {
    let bodies = |t: f64| {
        volume_of(
            main_header().grid,
            6,
            |[x, y, z]| {
                let large = (x * x + y * y + z * z).sqrt() - 20.0;
                let small = |n: i32| {
                    let side = |bit: i32| if n >> bit & 1 == 0 { -30.0 } else { 30.0 };
                    let from = [x - side(0), y - side(1) - t, z - side(2)];
                    from.iter().map(|c| c * c).sum::<f64>().sqrt() - 1.2 - 0.2 * f64::from(n)
                };
                (0..8).map(small).fold(large, f64::min)
            },
            |_| false,
        )
    };
    let volumes: Vec<_> = (0..4).map(|t| bodies(0.6 * f64::from(t))).collect();
    for bound in [0.2, 0.5] {
        let main = MainSettings { target: RateTarget::MaxError(bound), ..MainSettings::default() };
        let mut encoder = Encoder::new(&main_header(), settings(main));
        for volume in &volumes {
            let frame = encoder.encode(volume);
            let decoded = encoder.reconstruction().unwrap();
            let distance = surface_distance_voxels(volume, decoded);
            assert!(distance <= bound);
            assert_eq!(frame.surface_distance_voxels, Some(distance));
            let surface = extract_surface(decoded, &SurfaceOptions::default());
            let voxel_m = volume.grid().voxel_size.metres();
            for n in 0..8 {
                let octant = |v: &DVec3| (0..3).all(|axis| (v[axis] > 0.0) == (n >> axis & 1 == 1));
                let is_there = |v: &DVec3| v.length() > 30.0 * voxel_m && octant(v);
                assert!(surface.vertices.iter().any(is_there), "{bound}: body {n} is lost");
            }
        }
    }
}

#[test]
fn quality_is_monotone_in_bytes_and_error() {
    let volumes = rolling(6);
    let mut before: Option<(usize, f64)> = None;
    for quality in [0.0, 20.0, 40.0, 60.0, 80.0, 100.0] {
        let main = MainSettings { quality: FrameQuality::of_quality(quality), ..MainSettings::default() };
        let frames = encode(settings(main), &volumes);
        let bytes = frames.iter().map(|f| f.0).sum();
        let error = frames.iter().map(|f| f.1).sum::<f64>() / frames.len() as f64;
        println!("quality {quality}: {bytes} bytes, {error:.4} voxels");
        assert!(before.is_none_or(|(b, e)| bytes > b && error < e), "{quality}");
        before = Some((bytes, error));
    }
    assert_eq!(FrameQuality::of_quality(-5.0), FrameQuality::of_quality(0.0));
}

#[test]
fn a_cut_becomes_a_keyframe_and_begins_a_gop() {
    let mut volumes = rolling(5);
    volumes.extend(std::iter::repeat_n(block(), 9));
    let settings = EncoderSettings { gop: 8, ..settings(MainSettings::default()) };
    let keyframes: Vec<usize> =
        encode(settings, &volumes).iter().enumerate().filter(|(_, f)| f.2).map(|(n, _)| n).collect();
    assert_eq!(keyframes, [0, 5, 13]);
    // After frames that stand still as well.
    let still: Vec<_> = std::iter::repeat_n(volumes[0].clone(), 3).chain(volumes[5..].to_vec()).collect();
    assert!(encode(settings, &still)[3].2, "a cut after what stood still");
}

#[test]
fn more_work_makes_no_larger_frames_at_no_larger_error() {
    let volumes = rolling(8);
    let results = Preset::ALL.map(|preset| {
        let frames = encode(settings(preset.settings()), &volumes);
        (frames.iter().map(|f| f.0).sum::<usize>(), frames.iter().map(|f| f.1).sum::<f64>())
    });
    println!("{results:?}");
    assert!(results[2].0 < results[1].0 && results[1].0 < results[0].0);
}

#[test]
fn archive_is_smaller_than_balanced_at_equal_error() {
    let volumes = rolling(6);
    let point = |main: MainSettings, step| {
        let main = MainSettings { quality: FrameQuality::of_step(step), ..main };
        let frames = encode(settings(main), &volumes);
        let bytes = frames.iter().map(|f| f.0 as f64).sum::<f64>();
        (bytes.ln(), (frames.iter().map(|f| f.1).sum::<f64>()).ln())
    };
    let [fine, coarse] = [1.4, 2.8].map(|step| point(Preset::Balanced.settings(), step));
    let archive = point(Preset::Archive.settings(), 2.0);
    assert!((coarse.1 - archive.1) * (archive.1 - fine.1) > 0.0, "{fine:?} {archive:?} {coarse:?}");
    let share = (archive.1 - fine.1) / (coarse.1 - fine.1);
    let balanced = fine.0 + share * (coarse.0 - fine.0);
    let saved = 1.0 - (archive.0 - balanced).exp();
    println!("archive saves {:.1} % at equal error", 100.0 * saved);
    assert!(saved > 0.015, "{saved}");
}

#[test]
fn the_refined_search_does_not_depend_on_the_number_of_threads() {
    let volumes = rolling(3);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let main = MainSettings { slices: 3, ..Preset::Archive.settings() };
        pool.install(|| support::encode(&main_header(), settings(main), &volumes))
    };
    let (one, hashes) = with_threads(1);
    assert!(one == with_threads(3).0, "streams differ");
    let decoded = support::decode(&one).0;
    assert!(decoded.iter().map(isv_decode::volume_hash).eq(hashes));
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads_under_rate_control() {
    let volumes = rolling(8);
    for target in [RateTarget::Bitrate(Bitrate::new(200e3, FPS)), RateTarget::MaxError(0.05)] {
        let main = MainSettings { target, ..Preset::Realtime.settings() };
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| support::encode(&main_header(), settings(main), &volumes).0)
        };
        let one = with_threads(1);
        assert!(one == with_threads(2) && one == with_threads(5), "{target:?}: streams differ");
        support::decode(&one).1.unwrap();
    }
}
