//! Ladders of rates: segments that are aligned, playlists that list them, the player beside, and rates that halve.

mod support;

use isv::raw::format::PacketReader;
use isv::raw::mp4::{GeometryStream, Mp4File};
use std::fs;
use std::io::{Cursor, Read};
use support::Workspace;

const FRAMES: usize = 8;
const GOP: usize = 3;

/// A rung's playlist: frames and seconds of each segment.
fn segments(work: &Workspace, rung: &str) -> Vec<(usize, f64)> {
    let text = fs::read_to_string(work.path(&format!("site/{rung}/stream.m3u8"))).unwrap();
    let numbers = |tag: &str| {
        let lines = text.lines().filter_map(|line| line.strip_prefix(tag));
        lines.map(|number| number.trim_end_matches(',').parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    assert!(text.starts_with("#EXTM3U\n") && text.ends_with("#EXT-X-ENDLIST\n"));
    let frames = numbers("#EXT-X-ISV-FRAMES:").into_iter().map(|frames| frames as usize);
    frames.zip(numbers("#EXTINF:")).collect()
}

/// The stream of a rung, put together as a player does it.
fn stream(work: &Workspace, rung: &str) -> Vec<u8> {
    let mut file = work.read(&format!("site/{rung}/init.mp4"));
    for number in 0..segments(work, rung).len() {
        file.extend(work.read(&format!("site/{rung}/{number:04}.m4s")));
    }
    let mut bytes = Vec::new();
    GeometryStream::open(Cursor::new(file)).unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

fn rates(work: &Workspace) -> Vec<f64> {
    let master = fs::read_to_string(work.path("site/master.m3u8")).unwrap();
    let lines = master.lines().filter_map(|line| line.split_once("AVERAGE-BANDWIDTH=").map(|(_, rest)| rest));
    lines.map(|rest| rest.split(',').next().unwrap().parse().unwrap()).collect()
}

#[test]
fn a_capture_becomes_rates_that_halve_with_keyframes_at_the_same_frames() {
    let work = Workspace::with_figure(FRAMES);
    work.write("click.wav", support::waveform(0.3));
    let run = ["package", "frames", "-o", "site", "--rungs", "2", "--voxel", "20mm", "--gop", "3"];
    work.isv(&[&run[..], &["--audio", "click.wav", "--title", "A walk"]].concat()).done();
    let expected: Vec<_> = [GOP, GOP, FRAMES - 2 * GOP].map(|frames| (frames, frames as f64 / 30.0)).to_vec();
    for rung in ["rung-0", "rung-1"] {
        let listed = segments(&work, rung);
        assert_eq!(listed.len(), expected.len(), "{rung}");
        for ((frames, seconds), (frames_expected, seconds_expected)) in listed.iter().zip(&expected) {
            assert!(
                frames == frames_expected && (seconds - seconds_expected).abs() < 1e-3,
                "{rung}: {listed:?}"
            );
        }
        let bytes = stream(&work, rung);
        let mut reader = PacketReader::new(&bytes[..]).unwrap();
        for frame in 0..FRAMES {
            let packet = reader.next_frame().unwrap().unwrap();
            assert!(packet.is_keyframe() || frame % GOP != 0, "{rung}: frame {frame}");
        }
        assert!(reader.next_frame().unwrap().is_none() && reader.complete());
        work.write("rung.isv", &bytes);
        work.isv(&["verify", "rung.isv"]).done();
        let title = work.isv(&["info", "rung.isv", "--json"]).json();
        assert_eq!(title["metadata"]["title"], "A walk");
    }
    let sound = Mp4File::open(Cursor::new(
        [work.read("site/sound/init.mp4"), work.read("site/sound/0000.m4s")].concat(),
    ))
    .unwrap();
    assert!(
        sound.tracks()[0].end_s() <= 0.3 + 0.02,
        "sound is as long as geometry: {}",
        sound.tracks()[0].end_s()
    );
    let master = fs::read_to_string(work.path("site/master.m3u8")).unwrap();
    assert!(
        master.contains("CODECS=\"isv1.1.2,opus\"") && master.contains("URI=\"sound/stream.m3u8\""),
        "{master}"
    );
    let sizes = ["rung-0", "rung-1"].map(|rung| stream(&work, rung).len() as f64);
    let ratio = sizes[0] / sizes[1];
    assert!((1.6..=2.4).contains(&ratio), "{sizes:?}");
    assert!(rates(&work).windows(2).all(|pair| pair[0] > pair[1]), "the best comes first");
    let page = fs::read_to_string(work.path("site/start.js")).unwrap();
    assert!(page.contains("master.m3u8") && work.path("site/index.html").exists(), "{page}");
}

#[test]
fn a_stream_with_regular_keyframes_is_its_own_best_rate() {
    let (work, bytes) = Workspace::with_stream(FRAMES + 1);
    work.isv(&["package", "take.isv", "-o", "site", "--rungs", "2"]).done();
    assert!(stream(&work, "rung-0") == bytes);
    assert_eq!(segments(&work, "rung-1").iter().map(|(frames, _)| *frames).collect::<Vec<_>>(), [GOP; 3]);
    // What is there of an earlier run is replaced, and nothing else.
    work.isv(&["package", "take.isv", "-o", "site", "--rungs", "1"]).done();
    assert!(!work.path("site/rung-1").exists());
    work.write("site/thesis.txt", "years");
    work.isv(&["package", "take.isv", "-o", "site", "--rungs", "1"])
        .fails(1, &["thesis.txt is from no export"]);
    work.isv(&["package", "take.isv", "-o", "other", "--rungs", "9"]).fails(1, &["--rungs: 1 to 8"]);
    assert!(!work.path("other").exists());
}

#[test]
fn a_bit_rate_is_met_in_two_passes_and_sound_is_looked_at_first() {
    let work = Workspace::with_figure(FRAMES);
    let run = ["package", "frames", "-o", "site", "--rungs", "1", "--voxel", "20mm", "--gop", "3"];
    work.isv(&[&run[..], &["--bitrate", "200k"]].concat()).done();
    assert!(rates(&work)[0] < 250_000.0, "{:?}", rates(&work));
    work.isv(&["encode", "frames", "-o", "take.isv", "--voxel", "20mm", "--gop", "3"]).done();
    // A frame that cannot be read would be met first, if any was.
    work.write("frames/frame_0.ply", "ply");
    work.isv(&[&run[..], &["--audio", "missing.wav"]].concat()).fails(1, &["missing.wav"]);
    // A stream is coded anew where other voxels are asked for.
    work.isv(&["package", "take.isv", "-o", "site", "--rungs", "1", "--voxel", "40mm"]).done();
    let voxel = PacketReader::new(&stream(&work, "rung-0")[..]).unwrap().header().grid.voxel_size;
    assert_eq!(voxel.metres(), 0.04);
}

#[test]
fn lower_rates_have_larger_voxels_as_far_as_that_is_allowed() {
    let (work, _) = Workspace::with_stream(FRAMES + 1);
    let half = std::f64::consts::SQRT_2;
    for (lod, rungs, larger) in [("1", "2", &[1.0, 1.0][..]), ("2", "4", &[1.0, half, 2.0, 2.0])] {
        work.isv(&["package", "take.isv", "-o", "site", "--rungs", rungs, "--lod", lod]).done();
        for (rung, larger) in larger.iter().enumerate() {
            let rung = format!("rung-{rung}");
            work.write("rung.isv", stream(&work, &rung));
            work.isv(&["verify", "rung.isv"]).done();
            let voxel_m = work.isv(&["info", "rung.isv", "--json"]).json()["voxel_size_m"].as_f64().unwrap();
            assert!((voxel_m - 0.02 * larger).abs() < 1e-6, "--lod {lod}, {rung}: {voxel_m} m");
        }
    }
    // The quarter of a rate is reached, for which the voxels of the best are too many.
    let size = |rung: &str| stream(&work, rung).len() as f64;
    let ratio = size("rung-0") / size("rung-2");
    assert!((3.2..=4.8).contains(&ratio), "{ratio}");
    work.isv(&["package", "take.isv", "-o", "site", "--lod", "3"]).fails(2, &["--lod"]);
    // Points get voxels by their distances at first.
    work.isv(&["decode", "take.isv", "-o", "points", "--as", "points", "--format", "ply"]).done();
    work.isv(&["package", "points", "-o", "cloud", "--rungs", "3", "--gop", "3"]).done();
    let voxel_m = |rung: &str| {
        work.write(
            "init.mp4",
            [work.read(&format!("cloud/{rung}/init.mp4")), work.read(&format!("cloud/{rung}/0000.m4s"))]
                .concat(),
        );
        work.isv(&["info", "init.mp4", "--json"]).json()["voxel_size_m"].as_f64().unwrap()
    };
    assert!((voxel_m("rung-2") / voxel_m("rung-0") - 2.0).abs() < 1e-4);
}

#[test]
fn frames_that_are_left_out_leave_segments_aligned() {
    let work = Workspace::with_figure(FRAMES);
    work.write("click.wav", support::waveform(0.3));
    let run = ["package", "frames", "-o", "site", "--rungs", "2", "--voxel", "20mm", "--gop", "3"];
    let run = [&run[..], &["--skip-bad-frames", "--audio", "click.wav"]].concat();
    work.isv(&run).done();
    let whole = work.read("site/sound/0000.m4s");
    for (bad, segments_of) in [(1, [GOP - 1, GOP, FRAMES - 2 * GOP]), (0, [GOP - 2, GOP, FRAMES - 2 * GOP])] {
        work.write(&format!("frames/frame_{bad}.ply"), "no mesh");
        work.isv(&run).done();
        for rung in ["rung-0", "rung-1"] {
            let frames: Vec<usize> = segments(&work, rung).iter().map(|segment| segment.0).collect();
            assert_eq!(frames, segments_of, "{rung}");
        }
        // Sound begins with the first frame that is coded.
        assert_eq!(work.read("site/sound/0000.m4s") == whole, bad == 1);
    }
}

#[test]
fn a_stream_is_not_copied_where_something_else_is_asked_for() {
    let (work, _) = Workspace::with_stream(FRAMES);
    let run = ["package", "take.isv", "-o", "site", "--rungs", "1"];
    work.isv(&run).done();
    let copied = stream(&work, "rung-0");
    for more in [&["--gop", "2"][..], &["--title", "A walk"], &["--fps", "15"]] {
        work.isv(&[&run[..], more].concat()).done();
        assert!(stream(&work, "rung-0") != copied, "{more:?}");
    }
}

#[test]
fn lower_rates_that_cannot_be_are_refused_at_once() {
    let work = Workspace::with_figure(2);
    let run = ["package", "frames", "-o", "site", "--voxel", "20mm", "--profile", "paper"];
    work.isv(&run).fails(1, &["profile paper has no rate control: --rungs 1"]);
    work.isv(&[&run[..], &["--rungs", "1"]].concat()).done();
    work.write("click.wav", support::waveform(0.3));
    let piped = ["package", "-", "-o", "piped", "--voxel", "20mm", "--audio", "click.wav"];
    let frame = work.read("frames/frame_0.ply");
    work.isv_with_input(&piped, &frame).fails(1, &["read once for each rate"]);
    work.isv_with_input(&[&piped[..], &["--rungs", "1"]].concat(), &frame).done();
}
