//! Streams made, read, measured and drawn by the program itself.

mod support;

use isv_testkit::capture;
use serde_json::Value;
use std::fs;
use support::{ENCODE, Workspace};

#[track_caller]
fn assert_keys(object: &Value, keys: &[&str]) {
    for key in keys {
        assert!(object.get(key).is_some_and(|v| !v.is_null()), "{key} in {object}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_sequence_comes_back_through_every_command() {
    let (work, bytes) = Workspace::with_stream(4);

    let info = work.isv(&["info", "take.isv", "--json"]).json();
    assert_eq!(info["frames"], 4);
    assert_eq!(info["profile"], "main");
    assert_eq!(info["bytes"], bytes.len());
    assert_eq!(info["keyframes"], serde_json::json!([0, 3]));
    assert_eq!(info["complete"], true);
    let keys = ["format_version", "fps", "voxel_size_m", "truncation_voxels", "bitrate_mbps", "block_edge"];
    assert_keys(&info, &keys);
    assert_keys(&info["packets"][2], &["bytes", "keyframe", "blocks", "prediction", "timestamp_ns"]);
    assert_eq!(info["packets"][2]["prediction"], "3dof");
    let table = work.isv(&["info", "take.isv"]).done();
    assert!(String::from_utf8_lossy(table.stdout()).contains("voxels of 20mm"));

    let verified = work.isv(&["verify", "take.isv"]).done();
    assert_eq!(verified.stdout(), b"take.isv: 4 frames verified, 4 of them by hash\n");

    work.isv(&["decode", "take.isv", "-o", "out", "--normals"]).done();
    let files = ["frame_0000.ply", "frame_0001.ply", "frame_0002.ply", "frame_0003.ply"];
    assert_eq!(work.names("out"), files);

    let from_files = work.isv(&["eval", "frames", "out", "--json"]).json();
    let from_stream = work.isv(&["eval", "frames", "take.isv", "--json"]).json();
    for evaluation in [&from_files, &from_stream] {
        let keys =
            ["chamfer_mm", "chamfer_floor_mm", "p2s_mean_mm", "p2s_rms_mm", "p2s_p99_mm", "hausdorff_mm"];
        assert_keys(evaluation, &keys);
        assert_keys(&evaluation["frames"][3], &keys);
        assert_eq!(evaluation["frames"].as_array().unwrap().len(), 4);
        assert!(number(&evaluation["p2s_mean_mm"]) < 4.0, "{}", evaluation["p2s_mean_mm"]);
    }
    let difference = number(&from_files["p2s_mean_mm"]) - number(&from_stream["p2s_mean_mm"]);
    assert!(difference.abs() < 1e-4, "files are rounded to f32, no more: {difference}");
    let table = work.isv(&["eval", "frames", "take.isv"]).done();
    assert_eq!(String::from_utf8_lossy(table.stdout()).lines().count(), 2 + 4 + 1);
}

/// Decoders of profile `main` make up blocks around the coded ones; encoded again, these are no surface.
#[test]
fn a_stream_encoded_again_has_the_same_parts() {
    let (work, _) = Workspace::with_stream(3);
    work.isv(&["decode", "take.isv", "-o", "volumes", "--as", "volume"]).done();
    work.isv(&["decode", "take.isv", "-o", "half", "--as", "volume", "--lod", "2"]).done();
    for (input, more) in [("take.isv", &[][..]), ("take.isv", &["--profile=paper"]), ("volumes", &[])] {
        work.isv(&[&["encode", input, "-o", "again.isv"], more].concat()).done();
        let evaluation = work.isv(&["eval", "take.isv", "again.isv", "--json"]).json();
        let case = format!("{input} {more:?}: {evaluation}");
        let more_parts = number(&evaluation["components_test"]) - number(&evaluation["components_ref"]);
        assert!(more_parts < 1.0, "{case}");
        assert!(number(&evaluation["p2s_mean_mm"]) < 3.0, "{case}");
        assert!(number(&evaluation["test_to_ref_max_mm"]) < 100.0, "{case}");
    }
    work.isv(&["encode", "half", "-o", "half.isv"]).done();
}

#[test]
fn the_option_goes_before_the_environment_and_both_are_obeyed() {
    let (work, bytes) = Workspace::with_stream(2);
    let used = || serde_json::from_slice::<Value>(&work.read("encode.json")).unwrap()["simd"].clone();
    let args = [&ENCODE[..], &["--stats", "encode.json"]].concat();
    let mut command = work.command(&args);
    assert!(command.env("ISV_SIMD", "scalar").output().unwrap().status.success());
    assert_eq!((used(), work.read("take.isv") == bytes), ("scalar".into(), true));
    let mut command = work.command(&[&args[..], &["--simd", "auto"]].concat());
    assert!(command.env("ISV_SIMD", "scalar").output().unwrap().status.success());
    assert_eq!(work.read("take.isv"), bytes);
    let vectors = cfg!(any(target_arch = "x86_64", target_arch = "aarch64"));
    assert_eq!(used() != "scalar", vectors, "{}", used());
}

#[test]
fn statistics_have_their_keys() {
    let work = Workspace::with_figure(2);
    work.isv(&[&ENCODE[..], &["--stats", "encode.json"]].concat()).done();
    let stats: Value = serde_json::from_slice(&work.read("encode.json")).unwrap();
    assert_keys(&stats, &["frames", "simd", "stages_ms", "wall_ms"]);
    assert_keys(&stats["stages_ms"], &["targets", "slices", "block set", "extension"]);
    assert_eq!(stats["peak_memory_bytes"].is_u64(), cfg!(target_os = "linux"));
    let keys = ["ingest_ms", "encode_ms", "bytes", "bytes_blocks", "bytes_motion", "bytes_coefficients"];
    assert_keys(&stats["frames"][1], &keys);
    assert_keys(&stats["frames"][1], &["blocks_band", "blocks_coded", "keyframe", "surface_rms_mm"]);
    assert!(number(&stats["frames"][1]["surface_rms_mm"]) > 0.0);
    let info = work.isv(&["info", "take.isv", "--json"]).json();
    for frame in 0..2 {
        assert_eq!(stats["frames"][frame]["bytes"], info["packets"][frame]["bytes"]);
        assert_eq!(stats["frames"][frame]["blocks_coded"], info["packets"][frame]["blocks"]);
    }

    work.isv(&["decode", "take.isv", "-o", "out", "--stats", "decode.json"]).done();
    let stats: Value = serde_json::from_slice(&work.read("decode.json")).unwrap();
    assert_keys(&stats, &["frames", "wall_ms"]);
    assert_keys(&stats["frames"][1], &["decode_ms", "surface_ms", "write_ms"]);
    assert_eq!(stats["frames"].as_array().unwrap().len(), 2);
}

#[test]
fn threads_do_not_change_bytes() {
    let (work, bytes) = Workspace::with_stream(2);
    for threads in ["1", "2"] {
        work.isv(&[&ENCODE[..], &["--threads", threads]].concat()).done();
        assert_eq!(work.read("take.isv"), bytes, "{threads} threads");
        work.isv(&["decode", "take.isv", "-o", threads, "--threads", threads]).done();
    }
    assert_eq!(work.read("1/frame_0001.ply"), work.read("2/frame_0001.ply"));
}

#[test]
fn pipes_carry_the_same_bytes() {
    let (work, bytes) = Workspace::with_stream(2);
    let mut to_pipe = ENCODE;
    to_pipe[3] = "-";
    assert_eq!(work.isv(&to_pipe).done().stdout(), bytes);

    work.isv(&["decode", "take.isv", "-o", "out"]).done();
    work.isv_with_input(&["decode", "-", "-o", "piped"], &bytes).done();
    assert_eq!(work.read("piped/frame_0001.ply"), work.read("out/frame_0001.ply"));
    let one = work.isv_with_input(&["decode", "-", "-o", "-", "--frames", "1..2"], &bytes).done();
    assert_eq!(one.stdout(), work.read("out/frame_0001.ply"));
    work.isv_with_input(&["verify", "-"], &bytes).done();
}

#[test]
fn seeking_gives_what_decoding_from_the_start_gives() {
    let (work, bytes) = Workspace::with_stream(8);
    work.isv(&["decode", "take.isv", "-o", "all"]).done();
    work.isv(&["decode", "take.isv", "-o", "some", "--frames", "4..6"]).done();
    assert_eq!(work.names("some"), ["frame_0004.ply", "frame_0005.ply"]);
    work.isv_with_input(&["decode", "-", "-o", "piped", "--frames", "4..6"], &bytes).done();
    for name in work.names("some") {
        let expected = work.read(&format!("all/{name}"));
        assert_eq!(work.read(&format!("some/{name}")), expected);
        assert_eq!(work.read(&format!("piped/{name}")), expected);
    }
    work.isv(&["decode", "take.isv", "-o", "one.obj", "--frames", "7..8"]).done();
    assert!(work.read("one.obj").starts_with(b"v ") || work.read("one.obj").starts_with(b"#"));

    // A decoded part is measured against the same part of the reference.
    let part = work.isv(&["eval", "all", "some", "--frames", "4..6", "--json"]).json();
    assert!(number(&part["p2s_mean_mm"]) < 1e-3, "{part}");
}

#[test]
fn every_motion_mode_verifies() {
    let work = Workspace::with_figure(2);
    for motion in ["none", "zero", "3dof", "6dof", "auto"] {
        work.isv(&[&ENCODE[..], &["--profile=paper", "--motion", motion]].concat()).done();
        work.isv(&["verify", "take.isv"]).done();
        let info = work.isv(&["info", "take.isv", "--json"]).json();
        if motion != "auto" {
            assert_eq!(info["packets"][1]["prediction"], motion);
        }
    }
}

#[test]
fn the_knobs_reach_the_stream() {
    let work = Workspace::with_figure(3);
    let knobs = [
        "--profile=paper",
        "--block",
        "4",
        "--truncation=4",
        "--coefficients=20",
        "--ac-step=2cm",
        "--fps",
        "29.97",
    ];
    let more = ["--frames", "1..3", "--units", "dm", "--sign", "offset", "--voxel", "2mm"];
    let run = work.isv(&[&["encode", "frames", "-o", "knobs.isv"], &knobs[..], &more].concat()).done();
    assert!(run.stderr().contains("offset shell (as --sign asks)"), "{}", run.stderr());
    let info = work.isv(&["info", "knobs.isv", "--json"]).json();
    assert_eq!((&info["block_edge"], &info["truncation_voxels"]), (&4.into(), &4.into()));
    assert_eq!((&info["coefficients"], &info["frames"]), (&20.into(), &2.into()));
    assert_eq!((number(&info["fps"]), number(&info["ac_step_mm"])), (29.97, 20.0));
}

#[test]
fn a_unit_that_makes_frames_tiny_is_pointed_out() {
    let (work, before) = Workspace::with_stream(1);
    let run = work.isv(&[&ENCODE[..], &["--units", "mm"]].concat());
    assert!(run.stderr().contains("frame_0.ply: only "), "{}", run.stderr());
    assert!(run.stderr().contains("less than a block: check --units"), "{}", run.stderr());
    // Nothing is left of it, which is no reason to give up what was there.
    assert_eq!(run.status(), Some(1));
    assert!(run.stderr().contains("isv: frames: no surface in any frame"), "{}", run.stderr());
    assert!(work.read("take.isv") == before);
}

#[test]
fn pictures_have_the_size_asked_for() {
    let (work, _) = Workspace::with_stream(3);
    let size = |name: &str| {
        let png = work.read(name);
        assert!(png.starts_with(b"\x89PNG"));
        [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
    };
    work.isv(&["render", "take.isv", "-o", "one.png", "--frame", "2", "--size", "64", "--yaw", "-30"]).done();
    assert_eq!(size("one.png"), [64, 64]);
    let sheet = ["--frames", "0..3", "--size", "64", "--columns", "3", "--pitch=20"];
    work.isv(&[&["render", "frames", "-o", "sheet.png"], &sheet[..]].concat()).done();
    let [width, height] = size("sheet.png");
    assert!(width > 3 * 64 && width > 2 * height, "{width} x {height}");
}

#[test]
fn the_demo_needs_nothing() {
    let work = Workspace::new();
    let run = work.isv(&["demo", "-o", "shown", "--frames", "2"]).done();
    let text = String::from_utf8_lossy(run.stdout()).into_owned();
    for word in [
        "geometry Mbps",
        "colour Mbps",
        "Y dB",
        "3dof",
        "realtime",
        "balanced",
        "archive",
        "shown/comparison.png",
    ] {
        assert!(text.contains(word), "{text}");
    }
    assert_eq!(work.names("shown"), ["comparison.png", "decoded", "figure.isv"]);
    assert_eq!(work.names("shown/decoded").len(), 2);
    work.isv(&["verify", "shown/figure.isv"]).done();
    let info = work.isv(&["info", "shown/figure.isv"]).done();
    assert!(String::from_utf8_lossy(info.stdout()).contains("colour       2 layers"));
    let mesh = work.read("shown/decoded/frame_0000.ply");
    assert!(String::from_utf8_lossy(&mesh[..400]).contains("property uchar red"), "vertices have colours");
    // Again it takes the place of what it wrote, and of nothing else.
    let again = work.isv(&["demo", "-o", "shown", "--frames", "1"]).done();
    assert!(String::from_utf8_lossy(again.stdout()).contains(" triangles with a texture, 1 frame, "));
    for name in ["figure.isv", "comparison.png", "decoded/frame_0000.ply"] {
        let own = work.read(&format!("shown/{name}"));
        work.write(&format!("shown/{name}"), "my own");
        work.isv(&["demo", "-o", "shown", "--frames", "1"]).fails(2, &[name, "so it is not overwritten"]);
        assert_eq!(work.read(&format!("shown/{name}")), b"my own");
        work.write(&format!("shown/{name}"), own);
    }
}

#[test]
fn help_lists_the_commands_and_goes_to_stdout() {
    let work = Workspace::new();
    let help = work.isv(&["--help"]).done();
    let text = String::from_utf8_lossy(help.stdout()).into_owned();
    for command in ["demo", "encode", "decode", "info", "verify", "eval", "render"] {
        assert!(text.contains(&format!("\n  {command} ")), "{text}");
    }
    work.isv(&["--version"]).done();
    fs::remove_dir(work.path("")).unwrap();
}

#[test]
fn a_real_dancer_survives() {
    let Some(dancer) = capture("dancer") else { return };
    let dancer = dancer.to_str().unwrap();
    let work = Workspace::new();
    work.isv(&["encode", dancer, "-o", "dancer.isv", "--frames", "0..4", "--checksums"]).done();
    work.isv(&["verify", "dancer.isv"]).done();
    work.isv(&["decode", "dancer.isv", "-o", "out"]).done();
    let evaluation = work.isv(&["eval", dancer, "out", "--frames", "0..4", "--json"]).json();
    let p2s_mean_mm = number(&evaluation["p2s_mean_mm"]);
    assert!(p2s_mean_mm <= 0.60, "{p2s_mean_mm}");
}
