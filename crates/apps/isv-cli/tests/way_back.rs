//! The way back: coordinates, axes and sizes of what is decoded, and what commands say of their outputs.

mod support;

use isv::raw::io::{Format, Geometry, Unit, read_geometry, read_mesh, write_mesh};
use isv::raw::volume::TriangleMesh;
use serde_json::Value;
use std::fs;
use support::{ENCODE, Workspace};

/// Corners of the bounding box of a file, as its numbers are.
fn bounds(work: &Workspace, name: &str) -> [[f64; 3]; 2] {
    let (low, high) = read_geometry(&work.path(name), Unit::Metre).unwrap().bounds().unwrap();
    [low.to_array(), high.to_array()]
}

fn hausdorff_mm(work: &Workspace, args: &[&str]) -> f64 {
    measured(work, args, "hausdorff_mm")
}

/// Mean distance, for what was coded at voxels of 20 mm.
fn mean_mm(work: &Workspace, args: &[&str]) -> f64 {
    measured(work, args, "p2s_mean_mm")
}

fn measured(work: &Workspace, args: &[&str], key: &str) -> f64 {
    let evaluation: Value = work.isv(&[&["eval", "--json"], args].concat()).json();
    evaluation[key].as_f64().unwrap()
}

#[track_caller]
fn assert_near(found: [[f64; 3]; 2], expected: [[f64; 3]; 2], tolerance: f64) {
    for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() <= tolerance, "{found} for {expected}");
    }
}

#[test]
fn units_and_axes_of_the_output_are_those_asked_for() {
    let (work, _) = Workspace::with_stream(1);
    work.isv(&["decode", "take.isv", "-o", "plain.ply"]).done();
    let [low, high] = bounds(&work, "plain.ply");
    work.isv(&["decode", "take.isv", "-o", "mm.obj", "--units", "mm", "--up", "z"]).done();
    // What is up, y, is z; what is z points to -y.
    let turned = [[low[0], -high[2], low[1]], [high[0], -low[2], high[1]]];
    assert_near(bounds(&work, "mm.obj"), turned.map(|corner| corner.map(|x| 1e3 * x)), 1e-2);
    let eval = ["take.isv", "mm.obj", "--test-units", "mm", "--test-up", "z"];
    assert!(hausdorff_mm(&work, &eval) < 1e-3);
    // Normals turn too: those of points on a turned file fit its surface.
    let points = ["decode", "take.isv", "-o", "p.xyz", "--as=points", "--points=500"];
    work.isv(&points).done();
    let plain = read_geometry(&work.path("p.xyz"), Unit::Metre).unwrap();
    work.isv(&[&points[..], &["--up=-y"]].concat()).done();
    let turned = read_geometry(&work.path("p.xyz"), Unit::Metre).unwrap();
    let (Geometry::Points(plain), Geometry::Points(turned)) = (plain, turned) else { panic!("points") };
    for (a, b) in plain.normals.iter().zip(&turned.normals) {
        assert!((a.x - b.x).abs() + (a.y + b.y).abs() + (a.z + b.z).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn survey_coordinates_come_back_to_the_millimetre() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "plain.ply", "--frames", "0..1"]).done();
    let origin = [512_000.125, 5_403_000.5, -12.25];
    let moved =
        bounds(&work, "plain.ply").map(|corner| std::array::from_fn(|axis| corner[axis] + origin[axis]));
    let flag = "--origin=512000.125,5403000.5,-12.25";
    for name in ["far.ply", "far.obj", "far.glb"] {
        work.isv(&["decode", "take.isv", "-o", name, flag, "--frames", "0..1"]).done();
        assert_near(bounds(&work, name), moved, 1e-4);
        work.isv(&["encode", name, "-o", "again.isv", flag, "--voxel=20mm"]).done();
        assert!(mean_mm(&work, &["plain.ply", "again.isv"]) < 4.0, "{name}");
        let eval = ["take.isv", name, "--frames=0..1", "--test-origin=512000.125,5403000.5,-12.25"];
        assert!(hausdorff_mm(&work, &eval) < 0.1, "{name}");
    }
    for name in ["far.pcd", "far.xyz", "far_points.ply"] {
        let near = name.replace("far", "near");
        for (output, more) in [(near.as_str(), &[][..]), (name, &[flag])] {
            let decode = ["decode", "take.isv", "-o", output, "--as=points", "--frames", "0..1"];
            work.isv(&[&decode[..], more].concat()).done();
        }
        let moved =
            bounds(&work, &near).map(|corner| std::array::from_fn(|axis| corner[axis] + origin[axis]));
        assert_near(bounds(&work, name), moved, 1e-4);
    }
    // Animated too, in which every node is moved.
    work.isv(&["decode", "take.isv", "-o", "film.glb", flag]).done();
    assert_near(bounds(&work, "film.glb"), moved, 1e-4);
    let stl = work.isv(&["decode", "take.isv", "-o", "far.stl", flag, "--frames", "0..1"]).done();
    assert!(stl.stderr().contains("STL holds single precision"), "{}", stl.stderr());
    // Near the origin nothing changes.
    work.isv(&["decode", "take.isv", "-o", "near.ply", "--origin=0,0,0", "--frames", "0..1"]).done();
    assert_eq!(work.read("near.ply"), work.read("plain.ply"));
}

#[test]
fn formats_of_single_precision_say_what_they_round() {
    let work = Workspace::new();
    let mut ball = isv_testkit::sphere(0.1, 16);
    ball.vertices.iter_mut().for_each(|vertex| vertex.x += 3000.0);
    write_mesh(&work.path("far.ply"), &ball, Format::Ply).unwrap();
    work.isv(&["encode", "far.ply", "-o", "far.isv", "--voxel=10mm"]).done();
    for (name, format) in [("a.glb", "plain glTF"), ("a.usda", "USD"), ("a.stl", "STL")] {
        let said = work.isv(&["decode", "far.isv", "-o", name]).done().stderr();
        assert!(said.contains(&format!("{format} holds single precision, which is good for ")), "{said}");
    }
    for more in [&["a.ply"][..], &["b.glb", "--glb=quantized"]] {
        let said = work.isv(&[&["decode", "far.isv", "-o"], more].concat()).done().stderr();
        assert!(!said.contains("single precision"), "{said}");
    }
}

#[test]
fn volumes_keep_what_their_formats_cannot_say() {
    let (work, _) = Workspace::with_stream(1);
    for flag in ["--units=mm", "--origin=1,2,3", "--up=z"] {
        work.isv(&["decode", "take.isv", "-o", "out", "--as=volume", flag]).fails(2, &["NumPy", "vdb"]);
    }
    work.isv(&["decode", "take.isv", "-o", "v.vdb", "--up=z"]).fails(2, &["--up", "keeps its axes"]);
    work.isv(&["decode", "take.isv", "-o", "v.vdb", "--units=mm", "--origin=1000,2,3"]).done();
    let bytes = work.read("v.vdb");
    let name = b"UniformScaleTranslateMap";
    let at = bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len();
    let number = |index: usize| f64::from_le_bytes(bytes[at + 8 * index..][..8].try_into().unwrap());
    assert_eq!([0, 1, 2, 3].map(number), [1010.0, 12.0, 13.0, 20.0]);
}

#[test]
fn an_input_is_turned_to_y_up_and_back() {
    let work = Workspace::with_figure(1);
    let mesh = read_mesh(&work.path("frames/frame_0.ply"), Unit::Metre).unwrap();
    let mut turned = mesh.clone();
    turned.vertices.iter_mut().chain(&mut turned.normals).for_each(|v| (v.y, v.z) = (-v.z, v.y));
    write_mesh(&work.path("z_up.ply"), &turned, Format::Ply).unwrap();
    work.isv(&["encode", "z_up.ply", "-o", "z.isv", "--up", "z", "--voxel=20mm"]).done();
    assert!(mean_mm(&work, &["frames", "z.isv"]) < 4.0);
    assert!(mean_mm(&work, &["z_up.ply", "z.isv", "--up=z"]) < 4.0);
    work.isv(&["decode", "z.isv", "-o", "back.ply", "--up", "z"]).done();
    assert!(mean_mm(&work, &["z_up.ply", "back.ply"]) < 4.0);
    let again = work.isv(&["encode", "z.isv", "-o", "again.isv", "--up=z"]).done();
    assert!(again.stderr().contains("without effect on volumes: --up"), "{}", again.stderr());
    // A picture of what is turned is that of what never was.
    work.isv(&["render", "frames/frame_0.ply", "-o", "a.png", "--size=64"]).done();
    work.isv(&["render", "z_up.ply", "-o", "b.png", "--size=64", "--up=z"]).done();
    assert!(work.read("a.png") == work.read("b.png"));
}

fn open_edges(mesh: &TriangleMesh) -> usize {
    let mut edges = std::collections::HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
        }
    }
    edges.values().filter(|balance| **balance != 0).count()
}

#[test]
fn meshes_keep_to_their_budget() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "full"]).done();
    let full = read_mesh(&work.path("full/frame_0000.ply"), Unit::Metre).unwrap();
    let run = work.isv(&["decode", "take.isv", "-o", "few", "--target-faces=1000", "--normals"]).done();
    assert!(run.stderr().contains("faces a frame left, largest error found"), "{}", run.stderr());
    for frame in ["few/frame_0000.ply", "few/frame_0001.ply"] {
        let mesh = read_mesh(&work.path(frame), Unit::Metre).unwrap();
        assert!(mesh.triangles.len() <= 1000 && mesh.triangles.len() > 900, "{}", mesh.triangles.len());
        assert!(work.read(frame).windows(17).any(|window| window == b"property float nx"));
        assert_eq!(open_edges(&mesh), 0);
    }
    work.isv(&["decode", "take.isv", "-o", "near", "--simplify=3mm"]).done();
    let near = read_mesh(&work.path("near/frame_0000.ply"), Unit::Metre).unwrap();
    assert!(near.triangles.len() * 2 < full.triangles.len(), "{}", near.triangles.len());
    assert!(hausdorff_mm(&work, &["full", "near"]) <= 3.0);
    // The same with one thread, and in an animation.
    work.isv(&["decode", "take.isv", "-o", "one", "--target-faces=1000", "--normals", "--threads=1"]).done();
    assert_eq!(work.read("few/frame_0001.ply"), work.read("one/frame_0001.ply"));
    work.isv(&["decode", "take.isv", "-o", "few.glb", "--target-faces=1000"]).done();
    assert!(hausdorff_mm(&work, &["few", "few.glb"]) < 1e-3);
    let missed =
        work.isv(&["decode", "take.isv", "-o", "m", "--target-faces=10", "--simplify=1mm"]).done().stderr();
    assert_eq!(missed.matches("2 frames have more than the 10 faces").count(), 1, "{missed}");
    work.isv(&["decode", "take.isv", "-o", "p", "--as=points", "--target-faces=9"]).fails(2, &["for meshes"]);
}

#[test]
fn glb_files_have_normals_unless_told_otherwise() {
    let (work, _) = Workspace::with_stream(1);
    for (more, has) in [(&[][..], true), (&["--no-normals"], false), (&["--normals"], true)] {
        work.isv(&[&["decode", "take.isv", "-o", "a.glb"], more].concat()).done();
        let bytes = work.read("a.glb");
        assert_eq!(bytes.windows(8).any(|window| window == b"\"NORMAL\""), has, "{more:?}");
    }
    work.isv(&["decode", "take.isv", "-o", "a.xyz", "--no-normals"]).fails(2, &["--no-normals"]);
}

#[test]
fn encode_ends_with_name_ratio_and_thickness() {
    let work = Workspace::with_figure(2);
    let last = |args: &[&str]| work.isv(args).done().stderr().lines().last().unwrap().to_owned();
    let line = last(&ENCODE);
    assert!(line.starts_with("take.isv: 2 frames, ") && line.contains(" bytes, "), "{line}");
    let input: u64 = (0..2).map(|i| work.read(&format!("frames/frame_{i}.ply")).len() as u64).sum();
    let ratio = input as f64 / work.read("take.isv").len() as f64;
    assert!(line.contains(&format!("1/{ratio:.0} of the input's ")) && !line.contains("shell"), "{line}");
    let line = last(&["encode", "frames", "-o", "s.isv", "--voxel=20mm", "--sign=offset"]);
    assert!(line.ends_with(", shell 60 mm thick"), "{line}");
    let line = last(&["encode", "take.isv", "-o", "t.isv", "--frames=0..1"]);
    assert!(line.contains("of the input's") || line.contains("times the input's"), "{line}");
}

#[test]
fn verify_and_info_take_several_files() {
    let (work, bytes) = Workspace::with_stream(3);
    fs::copy(work.path("take.isv"), work.path("b.isv")).unwrap();
    let mut damaged = bytes.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x55;
    work.write("bad.isv", &damaged);
    let good = work.isv(&["verify", "take.isv", "b.isv"]).done();
    assert_eq!(String::from_utf8_lossy(good.stdout()).lines().count(), 2);
    let mixed = work.isv(&["verify", "bad.isv", "gone.isv", "b.isv", "--json"]);
    assert_eq!(mixed.status(), Some(1));
    let list: Value = serde_json::from_slice(mixed.stdout()).unwrap();
    let ok: Vec<_> = list.as_array().unwrap().iter().map(|verdict| verdict["ok"].as_bool()).collect();
    assert_eq!(ok, [Some(false), Some(false), Some(true)]);
    assert_eq!(list[2]["file"], "b.isv");
    assert_eq!((&list[2]["frames"], &list[2]["error"]), (&3.into(), &Value::Null));
    assert!(list[0]["error"].as_str().unwrap().starts_with("bad.isv: "));
    assert!(mixed.stderr().contains("2 of 3 streams failed: bad.isv, gone.isv"), "{}", mixed.stderr());
    let one = work.isv(&["verify", "take.isv", "--json"]).json();
    assert_eq!(one[0]["frames"], 3);
    assert_eq!(work.isv(&["info", "take.isv", "--json"]).json()["frames"], 3);
    let several = work.isv(&["info", "take.isv", "b.isv", "--json"]).json();
    assert_eq!((&several[1]["file"], &several[1]["frames"]), (&"b.isv".into(), &3.into()));
    let mixed = work.isv(&["info", "gone.isv", "b.isv", "--json"]);
    assert_eq!(mixed.status(), Some(1));
    let list: Value = serde_json::from_slice(mixed.stdout()).unwrap();
    assert!(list[0]["error"].is_string() && list[1]["frames"] == 3);
}
