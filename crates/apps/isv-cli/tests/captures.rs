//! Every kind of capture goes in, every form comes out.

mod support;

use isv::raw::io::{Animation, Unit};
use isv_testfiles::gltf::{of_animations_from, of_several_animations};
use isv_testkit::capture;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::time::Duration;
use support::{ENCODE, Workspace};

/// Mean distance between two inputs of `isv eval`, in millimetres.
fn distance_mm(work: &Workspace, reference: &str, test: &str) -> f64 {
    work.isv(&["eval", reference, test, "--json"]).json()["p2s_mean_mm"].as_f64().unwrap()
}

fn frames_in(work: &Workspace, stream: &str) -> Value {
    work.isv(&["info", stream, "--json"]).json()["frames"].clone()
}

#[test]
fn every_mesh_format_comes_out_and_goes_in_again() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "ply"]).done();
    for format in ["obj", "stl", "glb"] {
        work.isv(&["decode", "take.isv", "-o", format, "--format", format, "--normals"]).done();
        assert_eq!(work.names(format), [format!("frame_0000.{format}"), format!("frame_0001.{format}")]);
        let distance = distance_mm(&work, "ply", format);
        assert!(distance < 1e-3, "{format}: {distance} mm");
        let output = format!("{format}.isv");
        work.isv(&["encode", format, "-o", &output, "--voxel", "20mm"]).done();
        assert_eq!(frames_in(&work, &output), 2);
    }
}

#[test]
fn one_glb_holds_an_animation() {
    let (work, _) = Workspace::with_stream(4);
    work.isv(&["decode", "take.isv", "-o", "take.glb"]).done();
    let run = work.isv(&["encode", "take.glb", "-o", "again.isv", "--voxel", "20mm", "--fps", "30"]).done();
    assert!(run.stderr().contains("4 frames"), "{}", run.stderr());
    work.isv(&["decode", "again.isv", "-o", "again"]).done();
    work.isv(&["decode", "take.isv", "-o", "first"]).done();
    let distance = distance_mm(&work, "first", "again");
    assert!(distance < 3.0, "{distance} mm after being coded twice");
}

/// Many programs count the frames of a scene from 1001, and leave the time before in the file.
#[test]
fn an_animation_that_begins_late_is_said_to_stand_still_until_then() {
    let work = Workspace::new();
    fs::write(work.path("film.glb"), of_animations_from(40.0)).unwrap();
    let encode =
        ["encode", "film.glb", "-o", "film.isv", "--voxel", "20mm", "--fps", "25", "--frames", "0..3"];
    let run = work.isv(&encode).done();
    let words = "nothing moves in the first 40.0 s, which are 1000 frames; --frames 1000.. leaves them out";
    assert!(run.stderr().contains(words), "{}", run.stderr());
}

#[test]
fn an_animation_of_a_file_is_chosen_by_name_or_number() {
    let work = Workspace::new();
    fs::write(work.path("film.glb"), of_several_animations()).unwrap();
    // Up to the tenth of a second the first that moves goes up by 0.3 m, the other by 0.6 m.
    let encode = |output: &str, animation: &[&str]| {
        let usual = ["encode", "film.glb", "-o", output, "--voxel", "20mm", "--frames", "0..4"];
        work.isv(&[&usual[..], animation].concat()).done()
    };
    let first = encode("first.isv", &[]);
    assert!(first.stderr().contains("animation walk is taken; the others are 0, jump"), "{}", first.stderr());
    let run = encode("jump.isv", &["--animation", "jump"]);
    assert!(run.stderr().contains("animation jump is taken; the others are 0, walk"), "{}", run.stderr());
    assert!(!run.stderr().contains("nothing moves"), "{}", run.stderr());
    encode("walk.isv", &["--animation", "walk"]);
    encode("second.isv", &["--animation", "1"]);
    let [first, walk, second, jump] =
        ["first.isv", "walk.isv", "second.isv", "jump.isv"].map(|name| work.read(name));
    assert!(first == walk && walk == second && walk != jump);
    // One that moves nothing is a frame.
    work.isv(&["encode", "film.glb", "-o", "rest.isv", "--voxel", "20mm", "--animation", "0"]).done();
    assert_eq!(frames_in(&work, "rest.isv"), 1);

    let error_mm = |stream: &str, animation: &str| {
        let range = ["--frames", "3..4"];
        let usual = ["eval", "film.glb", stream, "--json", "--animation", animation];
        work.isv(&[&usual[..], &range].concat()).json()["p2s_mean_mm"].as_f64().unwrap()
    };
    assert!(error_mm("jump.isv", "jump") < 5.0 && error_mm("walk.isv", "walk") < 5.0);
    assert!(error_mm("jump.isv", "walk") > 200.0);
    let options = ["--against", "film.glb", "--against-animation", "jump", "--frame", "3", "--size", "64"];
    work.isv(&[&["render", "jump.isv", "-o", "error.png"][..], &options].concat()).done();
    work.isv(&["render", "film.glb", "-o", "film.png", "--animation", "jump", "--size", "64"]).done();
}

#[test]
fn an_animation_that_is_not_there_is_refused() {
    let (work, _) = Workspace::with_stream(1);
    fs::write(work.path("film.glb"), of_several_animations()).unwrap();
    let refused = |input: &str, animation: &str, parts: &[&str]| {
        work.isv(&["encode", input, "-o", "out.isv", "--animation", animation]).fails(1, parts);
    };
    refused("film.glb", "run", &["film.glb: no animation run: it has 0, walk, jump"]);
    refused("film.glb", "3", &["no animation 3"]);
    refused("frames", "run", &["frames: has no animations to choose from"]);
    refused("take.isv", "run", &["take.isv: has no animations to choose from"]);
}

#[test]
fn points_come_out_and_go_in_again() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "meshes"]).done();
    for format in ["ply", "pcd", "xyz"] {
        let more = ["--as", "points", "--format", format, "--spacing", "8mm"];
        work.isv(&[&["decode", "take.isv", "-o", format], &more[..]].concat()).done();
        let output = format!("{format}.isv");
        let run = work.isv(&["encode", format, "-o", &output, "--voxel", "20mm"]).done();
        assert!(run.stderr().contains("oriented points"), "{}", run.stderr());
        let distance = distance_mm(&work, "meshes", &output);
        assert!(distance < 4.0, "{format}: {distance} mm");
    }
    work.isv(&["decode", "take.isv", "-o", "few.xyz", "--points", "100", "--frames", "0..1"]).done();
    assert_eq!(String::from_utf8(work.read("few.xyz")).unwrap().lines().count(), 100);
}

#[test]
fn volumes_come_out_and_go_in_again_as_they_are() {
    let work = Workspace::with_figure(2);
    work.isv(&[&support::ENCODE[..], &["--profile=paper"]].concat()).done();
    work.isv(&["decode", "take.isv", "-o", "arrays", "--as", "volume"]).done();
    assert_eq!(work.names("arrays"), ["frame_0000", "frame_0001"]);
    assert_eq!(work.names("arrays/frame_0000"), ["coords.npy", "grid.json", "tsdf.npy", "weight.npy"]);
    // Voxel size, block edge and truncation come from the arrays; steps as fine as these change next to nothing.
    let fine = ["--profile=paper", "--dc-step", "0.1mm", "--ac-step", "0.1mm", "--coefficients", "512"];
    work.isv(&[&["encode", "arrays", "-o", "arrays.isv"], &fine[..]].concat()).done();
    assert!(distance_mm(&work, "take.isv", "arrays.isv") < 0.05);

    // One frame alone, and nobody says how large a voxel is.
    fs::remove_file(work.path("arrays/frame_0000/grid.json")).unwrap();
    let run = work.isv(&["encode", "arrays/frame_0000", "-o", "one.isv", "--truncation", "4"]).done();
    assert!(run.stderr().contains("arrays/frame_0000: does not say how large a voxel is: taken as 5mm"));
    let info = work.isv(&["info", "one.isv", "--json"]).json();
    assert_eq!((&info["voxel_size_m"], &info["truncation_voxels"]), (&0.005.into(), &4.into()));

    work.isv(&["decode", "take.isv", "-o", "one.vdb", "--frames", "0..1"]).done();
    work.isv(&["decode", "take.isv", "-o", "vdb", "--format", "vdb"]).done();
    assert_eq!(work.read("one.vdb"), work.read("vdb/frame_0000.vdb"));
}

#[test]
fn a_stream_can_be_coded_anew() {
    let (work, _) = Workspace::with_stream(3);
    let sixdof = ["--profile=paper", "--motion", "6dof", "--frames", "1..3"];
    work.isv(&[&["encode", "take.isv", "-o", "again.isv"], &sixdof[..]].concat()).done();
    let info = work.isv(&["info", "again.isv", "--json"]).json();
    assert_eq!((&info["frames"], &info["voxel_size_m"]), (&2.into(), &0.02.into()));
    assert_eq!(info["packets"][1]["prediction"], "6dof");
    work.isv(&["encode", "take.isv", "-o", "coarse.isv", "--voxel", "30mm"]).done();
    assert_eq!(work.isv(&["info", "coarse.isv", "--json"]).json()["voxel_size_m"], 0.03);
    assert!(distance_mm(&work, "take.isv", "coarse.isv") < 5.0);
}

#[test]
fn lower_levels_of_detail_are_coarser_and_close() {
    let work = Workspace::with_figure(3);
    work.isv(&[&support::ENCODE[..], &["--profile=paper"]].concat()).done();
    work.isv(&["decode", "take.isv", "-o", "1"]).done();
    let mut size = work.read("1/frame_0002.ply").len();
    for lod in ["2", "4"] {
        work.isv(&["decode", "take.isv", "-o", lod, "--lod", lod]).done();
        let smaller = work.read(&format!("{lod}/frame_0002.ply")).len();
        assert!(smaller * 2 < size, "{lod}: {smaller} bytes after {size}");
        size = smaller;
    }
    let distance = distance_mm(&work, "1", "2");
    assert!(distance < 10.0, "{distance} mm at twice a voxel of 20 mm");
}

#[test]
fn the_surface_needs_only_a_part_of_the_band() {
    let work = Workspace::with_figure(1);
    let encode = |band: &str| {
        let more = ["--band", band, "--stats", "stats.json"];
        work.isv(&[&ENCODE[..], &more].concat()).done();
        let stats: Value = serde_json::from_slice(&work.read("stats.json")).unwrap();
        let [band, coded] =
            ["blocks_band", "blocks_coded"].map(|key| stats["frames"][0][key].as_u64().unwrap());
        (band, coded)
    };
    let (full, surface) = (encode("full"), encode("surface"));
    assert_eq!(full.0, full.1);
    assert!(surface.1 <= surface.0 && surface.0 < full.0, "{surface:?} of {full:?}");
    assert!(surface.1 * 3 < full.0 * 2, "{surface:?} of {full:?}");
    assert!(distance_mm(&work, "frames", "take.isv") < 4.0);
}

/// A PLY file without a vertex could be one of points. Nobody was on the stage.
#[test]
fn an_empty_frame_among_meshes_is_one() {
    let work = Workspace::with_figure(3);
    work.write("frames/frame_1.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n");
    work.isv(&["encode", "frames", "-o", "auto.isv", "--voxel", "auto"]).done();
    assert_eq!(work.isv(&["info", "auto.isv", "--json"]).json()["frames"], 3);
    work.isv(&["decode", "auto.isv", "-o", "decoded"]).done();
    work.isv(&["render", "decoded", "-o", "film.gif", "--size", "64"]).done();
}

#[test]
fn bad_frames_can_be_skipped() {
    let work = Workspace::with_figure(4);
    let whole = work.read("frames/frame_1.ply");
    work.write("frames/frame_1.ply", &whole[..whole.len() / 2]);
    let run = work.isv(&ENCODE);
    assert_eq!(run.status(), Some(1));
    let stderr = run.stderr();
    // The first frame was good, and its sign had been announced.
    assert!(stderr.lines().last().unwrap().starts_with("isv: frames/frame_1.ply: truncated"), "{stderr}");
    // Nor does a voxel size that is chosen by samples depend on them.
    let mut auto = ENCODE;
    auto[3..6].copy_from_slice(&["auto.isv", "--voxel", "auto"]);
    assert!(work.isv(&auto).stderr().starts_with("isv: frames/frame_1.ply: truncated"));
    let run = work.isv(&[&auto[..], &["--skip-bad-frames"]].concat()).done();
    assert!(run.stderr().contains("by 2 sample frames"), "{}", run.stderr());
    fs::remove_file(work.path("auto.isv")).unwrap();
    let run = work.isv(&[&ENCODE[..], &["--skip-bad-frames"]].concat()).done();
    assert!(run.stderr().contains("skipped: frames/frame_1.ply: truncated"), "{}", run.stderr());
    assert!(run.stderr().contains("frames: 1 frame skipped"), "{}", run.stderr());
    let info = work.isv(&["info", "take.isv", "--json"]).json();
    assert_eq!(info["frames"], 3);
    assert_eq!(info["packets"][1]["timestamp_ns"], 66_666_666, "the frame keeps its time");
    let duration_s = info["duration_s"].as_f64().unwrap();
    assert!((duration_s - 4.0 / 30.0).abs() < 1e-6, "{duration_s}");
    // In an animation, the frame before it is seen until then.
    work.isv(&["decode", "take.isv", "-o", "take.glb"]).done();
    let film = Animation::open(&work.path("take.glb"), Unit::Metre).unwrap();
    let vertices = [0.0, 1.0, 2.0, 3.0].map(|frame| film.mesh_at((frame + 0.5) / 30.0).unwrap().vertices);
    assert_eq!(film.frame_count(30.0), 4);
    assert!(vertices[0] == vertices[1] && vertices[1] != vertices[2] && vertices[2] != vertices[3]);
    for frame in 0..4 {
        work.write(&format!("frames/frame_{frame}.ply"), "ply\n");
    }
    for made in ["take.isv", "take.glb"] {
        fs::remove_file(work.path(made)).unwrap();
    }
    let run = work.isv(&[&ENCODE[..], &["--skip-bad-frames"]].concat());
    assert_eq!(run.status(), Some(1));
    assert!(
        run.stderr().ends_with("isv: frames: no frame could be used, 4 frames skipped\n"),
        "{}",
        run.stderr()
    );
    assert_eq!(work.names(""), ["frames"]);
}

#[test]
fn frames_come_through_a_pipe() {
    let (work, bytes) = Workspace::with_stream(3);
    let mut from_pipe = ENCODE;
    from_pipe[1] = "-";
    from_pipe[3] = "piped.isv";
    let all: Vec<u8> =
        work.names("frames").iter().flat_map(|name| work.read(&format!("frames/{name}"))).collect();
    work.isv_with_input(&from_pipe, &all).done();
    assert_eq!(work.read("piped.isv"), bytes);

    // And out again, one PLY after the other.
    let meshes = work.isv_with_input(&["decode", "-", "-o", "-"], &bytes).done();
    work.isv_with_input(&["encode", "-", "-o", "again.isv", "--voxel", "20mm"], meshes.stdout()).done();
    assert_eq!(frames_in(&work, "again.isv"), 3);
    work.isv_with_input(&["encode", "-", "-o", "coded.isv"], &bytes).done();
    assert_eq!(frames_in(&work, "coded.isv"), 3);

    work.isv_with_input(&from_pipe, b"what is this?").fails(1, &["standard input"]);
}

#[test]
fn a_packet_leaves_before_the_next_frame_comes() {
    let work = Workspace::with_figure(2);
    let mut child = work.command(&["encode", "-", "-o", "-", "--voxel", "20mm"]).spawn().unwrap();
    let (mut stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    let frames: Vec<_> =
        work.names("frames").iter().map(|name| work.read(&format!("frames/{name}"))).collect();
    // Each read would wait for ever if the encoder waited for the frame after.
    stdin.write_all(&frames[0]).unwrap();
    let mut packets = isv::raw::format::PacketReader::new(stdout).unwrap();
    assert!(packets.next_frame().unwrap().unwrap().is_keyframe());
    stdin.write_all(&frames[1]).unwrap();
    assert!(!packets.next_frame().unwrap().unwrap().is_keyframe());
    drop(stdin);
    assert!(packets.next_frame().unwrap().is_none());
    assert!(child.wait().unwrap().success());
}

#[test]
fn what_is_open_beside_a_body_is_lost_but_not_without_a_word() {
    let work = Workspace::with_figure(1);
    let mut mesh =
        isv::raw::io::read_mesh(&work.path("frames/frame_0.ply"), isv::raw::io::Unit::Metre).unwrap();
    let first = mesh.vertices.len() as u32;
    // A sheet of a square metre, 2 m beside the figure and 500 km from the origin, as surveys have it.
    for corner in [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [2.0, 1.0, 0.0]] {
        mesh.vertices.push(corner.into());
    }
    mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| i + first)));
    mesh.vertices.iter_mut().for_each(|v| v.x += 500_000.0);
    mesh.normals.clear();
    let mut text: String = mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
    text.extend(mesh.triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)));
    work.write("far.obj", text);
    let encode = |more: &[&str]| {
        work.isv(
            &[&["encode", "far.obj", "-o", "far.isv", "--voxel", "20mm", "--sign", "closed"], more].concat(),
        )
    };
    encode(&[]).fails(1, &["far.obj: the surface reaches 500003", "--origin"]);
    let run = encode(&["--origin", "500000,0,0"]).done();
    assert!(
        run.stderr().contains("% of the surface is open, or thinner than a voxel, and is lost"),
        "{}",
        run.stderr()
    );
    assert!(distance_mm(&work, "frames", "far.isv") < 4.0);
    // What is measured against the capture as it came is told the same origin.
    let near = work.isv(&["eval", "far.obj", "far.isv", "--origin", "500000,0,0", "--json"]).json();
    assert!(near["test_to_ref_mean_mm"].as_f64().unwrap() < 4.0, "{near}");
    let picture = ["render", "far.isv", "-o", "error.png", "--size", "64", "--against", "far.obj"];
    let run = work.isv(&[&picture[..], &["--against-origin", "500000,0,0"]].concat()).done();
    assert!(!run.stderr().contains("00000"), "{}", run.stderr());
    work.isv(&["render", "far.isv", "-o", "e.png", "--against-origin", "1,2,3"]).fails(2, &["--against"]);

    // Unless told otherwise isv keeps it, also if it comes after a frame without it.
    let sheet = ["--voxel", "20mm", "--origin", "500000,0,0"];
    let run = work.isv(&[&["encode", "far.obj", "-o", "sheet.isv"], &sheet[..]].concat()).done();
    assert!(run.stderr().contains("open surface: single sheets") && !run.stderr().contains("lost"));
    let near = work.isv(&["eval", "far.obj", "sheet.isv", "--origin", "500000,0,0", "--json"]).json();
    assert!(near["ref_to_test_mean_mm"].as_f64().unwrap() < 4.0, "{near}");
    fs::create_dir(work.path("later")).unwrap();
    let body = String::from_utf8(work.read("far.obj")).unwrap();
    let faces: Vec<&str> = body.lines().collect();
    work.write("later/a.obj", faces[..faces.len() - 2].join("\n"));
    work.write("later/b.obj", &body);
    let run = work.isv(&[&["encode", "later", "-o", "later.isv"], &sheet[..]].concat()).done();
    assert!(run.stderr().contains("closed surface"), "{}", run.stderr());
    assert!(run.stderr().contains("single sheets from here on"), "{}", run.stderr());
    let near = work.isv(&["eval", "later", "later.isv", "--origin", "500000,0,0", "--json"]).json();
    assert!(near["ref_to_test_mean_mm"].as_f64().unwrap() < 4.0, "{near}");
}

/// A name need not be text.
#[cfg(target_os = "linux")]
#[test]
fn inputs_have_any_name() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let work = Workspace::with_figure(1);
    let name = OsStr::from_bytes(b"take \xff");
    std::fs::rename(work.path("frames"), work.path("").join(name)).unwrap();
    let run = |args: [&OsStr; 4]| {
        let output = work.command(&[]).args(args).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let stream = OsStr::from_bytes(b"\xfe.isv");
    run(["encode".as_ref(), name, "-o".as_ref(), stream]);
    run(["eval".as_ref(), name, stream, "--json".as_ref()]);
    run(["render".as_ref(), name, "-o".as_ref(), "out.png".as_ref()]);
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_a_whole_shorter_stream() {
    let work = Workspace::with_figure(2);
    let mut child = work.command(&["encode", "-", "-o", "live.isv", "--voxel", "20mm"]).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    for name in work.names("frames") {
        stdin.write_all(&work.read(&format!("frames/{name}"))).unwrap();
    }
    stdin.flush().unwrap();
    // The pipe stays open, as that of a live capture does. A frame is some hundred bytes, the header of a stream less.
    let part = work.path("live.isv.part");
    while std::fs::metadata(&part).map_or(0, |part| part.len()) < 300 {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::sleep(Duration::from_millis(10));
    }
    // GNU `timeout` signals its child, and at once all of its group.
    interrupt(&child, 2);
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("interrupted: live.isv is whole and holds the first "), "{stderr}");
    assert_eq!(work.names(""), ["frames", "live.isv"]);
    work.isv(&["verify", "live.isv"]).done();
}

/// The frames of the figure, one after the other.
fn piped_frames(work: &Workspace) -> Vec<u8> {
    work.names("frames").iter().flat_map(|name| work.read(&format!("frames/{name}"))).collect()
}

/// What came through a pipe cannot be had again.
#[test]
fn frames_before_a_failure_on_a_pipe_are_kept() {
    let (work, before) = Workspace::with_stream(3);
    let frames = piped_frames(&work);
    let encode = ["encode", "-", "-o", "take.isv", "--voxel", "20mm"];
    let run = work.isv_with_input(&encode, &frames[..frames.len() - 9]);
    assert_eq!(run.status(), Some(1));
    assert!(run.stderr().contains("take.isv.part holds the first 2 frames"), "{}", run.stderr());
    assert!(work.read("take.isv") == before, "the stream that was there stays");
    work.isv(&["verify", "take.isv.part"]).done();
    assert_eq!(frames_in(&work, "take.isv.part"), 2);
}

#[test]
fn a_pipe_is_read_once() {
    let work = Workspace::with_figure(1);
    let frames = piped_frames(&work);
    for more in [&["--voxel", "auto"][..], &["--bitrate", "1M", "--passes", "2"]] {
        let encode = [&["encode", "-", "-o", "take.isv"], more].concat();
        work.isv_with_input(&encode, &frames).fails(1, &["a pipe cannot be used here"]);
    }
    assert_eq!(work.names(""), ["frames"]);
}

#[cfg(unix)]
#[test]
fn an_archive_that_is_out_of_order_is_pointed_out() {
    let work = Workspace::with_figure(3);
    let archive = |numbers: [usize; 3]| {
        let names = numbers.map(|number| format!("frames/frame_{number}.ply"));
        let mut tar = std::process::Command::new("tar");
        tar.current_dir(work.path("")).args(["-cf", "-"]).args(names).output().unwrap().stdout
    };
    let encode = ["encode", "-", "-o", "take.isv", "--voxel", "20mm"];
    let stderr = |numbers| work.isv_with_input(&encode, &archive(numbers)).done().stderr();
    assert!(!stderr([0, 1, 2]).contains("comes after"));
    let shuffled = stderr([2, 1, 0]);
    assert!(shuffled.contains("frame_1.ply comes after frames/frame_2.ply"), "{shuffled}");
    assert_eq!(shuffled.matches("comes after").count(), 1, "{shuffled}");
}

/// Asks a program to end, so many times at once. It does what Ctrl-C does, but by a signal that shells do not
/// have their background commands ignore.
#[cfg(unix)]
fn interrupt(child: &std::process::Child, times: usize) {
    let ids = vec![child.id().to_string(); times];
    let kill = std::process::Command::new("kill").arg("-TERM").args(ids).status();
    assert!(kill.unwrap().success());
}

/// Waits until a program listens for that signal.
#[cfg(target_os = "linux")]
fn wait_until_listening(child: &std::process::Child) {
    let caught = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim().to_owned();
        u64::from_str_radix(&mask, 16).unwrap()
    };
    while caught() & 1 << 14 == 0 {
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// While it waits for a pipe, Ctrl-C and its like end a command the first time.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_is_heard_by_who_waits() {
    let (work, bytes) = Workspace::with_stream(1);
    let interrupted = |args: &[&str], input: &[u8]| {
        let mut child = work.command(args).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(input).unwrap();
        stdin.flush().unwrap();
        if !input.is_empty() {
            wait_until_listening(&child);
        }
        interrupt(&child, 1);
        let output = child.wait_with_output().unwrap();
        drop(stdin);
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for args in [&["decode", "-", "-o", "meshes"][..], &["render", "-", "-o", "picture.png"]] {
        // Before the header there is nothing to bring to an end.
        assert_eq!(interrupted(args, &[]), (None, String::new()), "{args:?}");
        let (status, said) = interrupted(args, &bytes[..48]);
        assert_eq!(status, Some(1), "{said}");
        assert!(
            said.starts_with("isv: ") && said.contains("interrupted") && said.lines().count() == 1,
            "{said}"
        );
    }
    assert_eq!(work.names(""), ["frames", "take.isv"]);
}

#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_number_of_frames() {
    let work = Workspace::with_figure(10);
    let peak = |frames: usize| {
        let folder = format!("take_{frames}");
        fs::create_dir(work.path(&folder)).unwrap();
        for frame in 0..frames {
            let source = work.path(&format!("frames/frame_{}.ply", frame % 10));
            std::os::unix::fs::symlink(source, work.path(&format!("{folder}/frame_{frame}.ply"))).unwrap();
        }
        let more = ["--voxel", "30mm", "--stats", "stats.json"];
        let mut command = work.command(&[&["encode", &folder, "-o", "long.isv"], &more[..]].concat());
        // With an arena a thread, what glibc's allocator keeps depends on which thread freed what.
        let output = command.env("MALLOC_ARENA_MAX", "1").output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let stats: Value = serde_json::from_slice(&work.read("stats.json")).unwrap();
        stats["peak_memory_bytes"].as_f64().unwrap()
    };
    let (short, long) = (peak(30), peak(300));
    println!("30 frames: {short} bytes, 300 frames: {long} bytes");
    assert!(long <= 1.1 * short, "{short} bytes for 30 frames, {long} for 300");
}

#[test]
fn a_real_depth_camera_goes_in_both_ways() {
    let Some(room) = capture("room_rgbd") else { return };
    let room = room.to_str().unwrap();
    let work = Workspace::new();
    let mut area = Vec::new();
    for mode in ["per-frame", "accumulate"] {
        let output = format!("{mode}.isv");
        let more = ["--voxel", "2cm", "--frames", "0..3", "--fusion", mode];
        work.isv(&[&["encode", room, "-o", &output], &more[..]].concat()).done();
        let info = work.isv(&["info", &output, "--json"]).json();
        assert_eq!((&info["frames"], &info["fps"]), (&3.into(), &30.0.into()));
        area.push(info["packets"][2]["blocks"].as_u64().unwrap());
    }
    let run = work.isv(&["encode", room, "-o", "fitting.isv", "--frames", "0..1"]).done();
    assert!(
        run.stderr().contains("voxels of 10mm, as a pixel covers 3.2 mm and depths are noisy by 5.0 mm"),
        "{}",
        run.stderr()
    );
    assert_eq!(work.isv(&["info", "fitting.isv", "--json"]).json()["voxel_size_m"], 0.01);
    assert!(area[1] > area[0], "what is accumulated is more than one frame: {area:?}");
}

/// Text of a PLY or XYZ file of a square lattice of points with normals up, `edge` apart, its corner at `x`.
fn lattice(format: &str, count: usize, edge: f64, x: f64, normals: bool) -> String {
    let mut text = String::new();
    if format == "ply" {
        let names: String =
            ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
        text = format!("ply\nformat ascii 1.0\nelement vertex {}\n{names}end_header\n", count * count);
    }
    for i in 0..count * count {
        let (row, column) = (i / count, i % count);
        text += &format!("{} {} 0", x + edge * column as f64, edge * row as f64);
        text += if normals { " 0 0 1\n" } else { "\n" };
    }
    text
}

#[test]
fn points_get_a_voxel_that_fits_their_spacing() {
    let work = Workspace::new();
    work.write("sparse.ply", lattice("ply", 40, 0.084, 0.0, true));
    work.write("dense.ply", lattice("ply", 60, 0.003, 0.0, true));
    let voxel = || work.isv(&["info", "out.isv", "--json"]).json()["voxel_size_m"].as_f64().unwrap();
    let sparse = ["encode", "sparse.ply", "-o", "out.isv"];
    for more in [&[][..], &["--voxel", "auto"], &["--profile", "paper"]] {
        let run = work.isv(&[&sparse[..], more].concat()).done();
        assert!(run.stderr().contains("voxels of 100mm, as points are 8"), "{}", run.stderr());
        assert!(run.stderr().contains("--voxel overrules"), "{}", run.stderr());
        assert_eq!(voxel(), 0.1, "{more:?}");
    }
    let bytes = work.read("sparse.ply");
    let run =
        work.isv_with_input(&["encode", "-", "-o", "out.isv"], &[&bytes[..], &bytes[..]].concat()).done();
    assert!(run.stderr().contains("voxels of 100mm"), "{}", run.stderr());
    assert_eq!(voxel(), 0.1);
    assert_eq!(frames_in(&work, "out.isv"), 2, "a pipe loses no frame");
    let run = work.isv(&[&sparse[..], &["--voxel", "60mm"]].concat()).done();
    assert!(!run.stderr().contains("overrules"), "{}", run.stderr());
    assert_eq!(voxel(), 0.06);
    work.isv(&["encode", "dense.ply", "-o", "out.isv"]).done();
    assert_eq!(voxel(), 0.005);
    // Nor are there more blocks than allowed.
    let run = work.isv(&[&sparse[..], &["--max-blocks", "60"]].concat()).done();
    assert!(run.stderr().contains("need more blocks than --max-blocks"), "{}", run.stderr());
    assert!(voxel() > 0.1);
}

#[test]
fn a_capture_of_several_spacings_gets_the_middle_one() {
    let work = Workspace::new();
    fs::create_dir(work.path("take")).unwrap();
    for (frame, edge) in [0.5, 0.02, 0.02, 0.02, 0.021].into_iter().enumerate() {
        work.write(&format!("take/frame_{frame}.ply"), lattice("ply", 30, edge, 0.0, true));
    }
    let run = work.isv(&["encode", "take", "-o", "out.isv", "--mixed-scales", "--skip-bad-frames"]).done();
    assert!(run.stderr().contains("voxels of 25mm, as points are 21 mm apart"), "{}", run.stderr());
}

#[test]
fn estimated_normals_face_the_viewpoint_in_the_inputs_coordinates() {
    let work = Workspace::new();
    work.write("floor.xyz", lattice("xyz", 40, 10.0, 5000.0, false));
    for (height, side) in [("2000", 1.0), ("-2000", -1.0)] {
        let viewpoint = format!("5200,200,{height}");
        let place = ["--units", "mm", "--origin", "5000,0,0", "--viewpoint", &viewpoint];
        let encode = ["encode", "floor.xyz", "-o", "out.isv"];
        // Without normals of their own, points that were seen from somewhere get some.
        for (more, axis) in [(&["--normals", "estimate"][..], 5), (&[], 5), (&["--up", "z"], 4)] {
            let run = work.isv(&[&encode[..], &place, more].concat()).done();
            assert!(
                run.stderr().contains("100 % of the sides follow from where the scanner stood"),
                "{}",
                run.stderr()
            );
            work.isv(&["decode", "out.isv", "-o", "out.xyz", "--as", "points", "--points", "500"]).done();
            let text = String::from_utf8(work.read("out.xyz")).unwrap();
            let up: Vec<f64> =
                text.lines().map(|line| line.split(' ').nth(axis).unwrap().parse().unwrap()).collect();
            let mean = up.iter().sum::<f64>() / up.len() as f64;
            assert!(side * mean > 0.9, "{mean} from {height}");
        }
    }
}

#[test]
fn sides_that_are_a_guess_are_said_to_be() {
    let work = Workspace::new();
    // Floors of different heights beside each other, which hang together nowhere.
    let floors: String = (0..4)
        .flat_map(|floor| {
            let text = lattice("xyz", 25, 0.01, 0.4 * f64::from(floor), false);
            text.lines()
                .map(|line| format!("{}{}\n", line.strip_suffix('0').unwrap(), 0.1 * f64::from(floor)))
                .collect::<Vec<_>>()
        })
        .collect();
    work.write("floors.xyz", floors);
    let encode = ["encode", "floors.xyz", "-o", "out.isv", "--normals", "estimate"];
    let run = work.isv(&encode).done();
    assert!(
        run.stderr().contains("sides are a guess for 100 % of the points, in 4 patches: give --viewpoint"),
        "{}",
        run.stderr()
    );
    assert!(run.stderr().contains("offset shell"), "{}", run.stderr());
    let run = work.isv(&[&encode[..], &["--viewpoint", "0.5,0.1,3"]].concat()).done();
    assert!(!run.stderr().contains("guess") && run.stderr().contains("oriented points"), "{}", run.stderr());
    work.write("given.xyz", lattice("xyz", 60, 0.01, 0.0, true));
    let run = work.isv(&["encode", "given.xyz", "-o", "out.isv", "--viewpoint", "0,0,-9"]).done();
    assert!(run.stderr().contains("--viewpoint is without effect"), "{}", run.stderr());
}

#[test]
fn an_mp4_file_comes_through_a_pipe() {
    let (work, _) = Workspace::with_stream(3);
    work.isv(&["mux", "take.isv", "-o", "take.mp4"]).done();
    work.isv_with_input(&["encode", "-", "-o", "piped.isv"], &work.read("take.mp4")).done();
    work.isv(&["encode", "take.isv", "-o", "again.isv"]).done();
    assert!(work.read("piped.isv") == work.read("again.isv"));
}
