//! Parts of a take that are encoded apart, with `isv encode --fixed-gop`, join to the bytes of the whole.

mod support;

use std::fs;
use support::Workspace;

/// Encodes frames 0..9 at once and in parts of `frames`, and compares the bytes. Every third frame begins a group of pictures.
fn check(work: &Workspace, folder: &str, parts: &[&str], options: &[&str]) -> Vec<u8> {
    let encode = |name: &str, range: &[&str]| {
        let fixed = ["encode", folder, "-o", name, "--voxel", "30mm", "--gop=3", "--fixed-gop"];
        work.isv(&[&fixed[..], range, options].concat()).done();
    };
    encode("whole.isv", &[]);
    let names: Vec<String> = parts.iter().map(|range| format!("{range}.isv")).collect();
    for (range, name) in parts.iter().zip(&names) {
        encode(name, &["--frames", range, "--time-origin=0"]);
    }
    let mut join: Vec<&str> = vec!["join", "-o", "joined.isv", "--keep-times"];
    join.extend(names.iter().map(String::as_str));
    work.isv(&join).done();
    let whole = work.read("whole.isv");
    assert!(work.read("joined.isv") == whole, "{folder} {parts:?} {options:?}");
    work.isv(&["verify", "joined.isv"]).done();
    whole
}

#[test]
fn parts_of_any_length_join_to_the_bytes_of_the_whole() {
    let work = Workspace::with_figure(9);
    for options in [
        &[][..],
        &["--quality=80"],
        &["--max-error=5mm"],
        &["--sign=sheet"],
        &["--profile=paper"],
        &["--checksums"],
    ] {
        check(&work, "frames", &["0..3", "3..6", "6..9"], options);
    }
    check(&work, "frames", &["0..6", "6..9"], &[]);
    let work = Workspace::with_painted_balls(9);
    check(&work, "balls", &["0..3", "3..9"], &["--sign=closed"]);
}

/// Groups that know of one another are other bytes: what the test above holds is not so without the option.
#[test]
fn groups_of_a_usual_stream_lean_on_what_was_coded_before() {
    let work = Workspace::with_figure(9);
    let encode = |name: &str, more: &[&str]| {
        work.isv(&[&["encode", "frames", "-o", name, "--voxel=30mm", "--gop=3"][..], more].concat()).done();
    };
    encode("whole.isv", &[]);
    encode("a.isv", &["--frames=..3"]);
    encode("b.isv", &["--frames=3.."]);
    work.isv(&["join", "a.isv", "b.isv", "-o", "joined.isv"]).done();
    assert!(work.read("joined.isv") != work.read("whole.isv"));
}

/// Frames are missing where two parts meet: between their names, and because they cannot be read.
#[test]
fn pauses_and_bad_frames_between_parts_keep_their_times() {
    let work = Workspace::with_figure(9);
    for frame in (3..9).rev() {
        let place = |number: usize| work.path(&format!("frames/frame_{number}.ply"));
        fs::rename(place(frame), place(frame + 2)).unwrap();
    }
    check(&work, "frames", &["0..3", "3..9"], &[]);
    for bad in [2, 5] {
        work.write(&format!("frames/frame_{bad}.ply"), "ply\nformat ascii 1.0\nelement vertex 1\n");
    }
    check(&work, "frames", &["0..3", "3..9"], &["--skip-bad-frames"]);
    let info: serde_json::Value =
        serde_json::from_slice(work.isv(&["info", "joined.isv", "--json"]).done().stdout()).unwrap();
    let times =
        info["packets"].as_array().unwrap().iter().map(|packet| packet["timestamp_ns"].as_u64().unwrap());
    // Numbers of names: 0 1 (2) (5) 6 7 8 9 10.
    assert!(times.eq([0, 1, 6, 7, 8, 9, 10].map(|frame: u64| frame * 1_000_000_000 / 30)));
}

/// A part of a stream has its times in that stream.
#[test]
fn parts_of_a_stream_keep_its_times() {
    let work = Workspace::with_figure(9);
    work.isv(&["encode", "frames", "-o", "a.isv", "--voxel=30mm", "--frames=0..4", "--gop=2", "--fps=12.5"])
        .done();
    fs::rename(work.path("frames/frame_7.ply"), work.path("frames/frame_70.ply")).unwrap();
    work.isv(&["encode", "frames", "-o", "b.isv", "--voxel=30mm", "--frames=4..", "--gop=2", "--fps=12.5"])
        .done();
    work.isv(&["join", "a.isv", "b.isv", "-o", "take.isv"]).done();
    check(&work, "take.isv", &["0..3", "3..6", "6..9"], &[]);
    // The same from a pipe, which cannot be read from its middle.
    let part = |input, output| {
        ["encode", input, "-o", output, "--voxel=30mm", "--gop=3", "--frames=6..9", "--time-origin=0"]
    };
    work.isv_with_input(&part("-", "piped.isv"), &work.read("take.isv")).done();
    work.isv(&part("take.isv", "part.isv")).done();
    let (piped, part) = (work.read("piped.isv"), work.read("part.isv"));
    assert!(piped == part, "{} and {} bytes", piped.len(), part.len());
}

#[test]
fn the_first_frame_of_a_part_may_be_without_colour() {
    let work = Workspace::with_painted_balls(9);
    let plain = Workspace::with_figure(1);
    fs::copy(plain.path("frames/frame_0.ply"), work.path("balls/3.ply")).unwrap();
    check(&work, "balls", &["0..3", "3..9"], &["--expect-colour", "--mixed-scales"]);
    let part = ["encode", "balls", "-o", "p.isv", "--voxel=30mm", "--frames=3..9", "--mixed-scales"];
    work.isv(&part).done();
    work.isv(&["join", "0..3.isv", "p.isv", "-o", "x.isv"]).fails(1, &["p.isv", "colour layers"]);
}

#[test]
fn what_goes_from_group_to_group_is_refused() {
    let work = Workspace::with_figure(3);
    let encode = ["encode", "frames", "-o", "x.isv", "--fixed-gop"];
    for (options, what) in [
        (&["--refresh=gradual"][..], "gradual refresh"),
        (&["--bitrate=1M"], "bit rate met in one pass"),
        (&["--fusion=accumulate"], "depth that accumulates"),
    ] {
        work.isv(&[&encode[..], options].concat()).fails(2, &["fixed-gop", what]);
    }
    work.isv(&[&encode[..], &["--frames=0..2", "--time-origin=1"]].concat())
        .fails(2, &["time-origin", "no frame behind"]);
    assert!(!work.path("x.isv").exists());
    // Steps for the whole take are found in passes.
    work.isv(&[&encode[..], &["--bitrate=1M", "--passes=2", "--voxel=30mm"]].concat()).done();
}
