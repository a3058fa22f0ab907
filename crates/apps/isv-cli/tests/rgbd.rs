//! Depth cameras with colour images beside them.

mod support;

use glam::{DMat3, DVec2, DVec3};
use isv::raw::io::{Colours, Geometry, ReadOptions, Unit, read_geometry_as};
use isv::raw::volume::{Appearance, CameraPose, Intrinsics, TriangleMesh};
use isv_testkit::{render_colours, render_depth};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use support::Workspace;

const DEPTH: Intrinsics =
    Intrinsics { width: 160, height: 120, focal: DVec2::splat(140.0), principal: DVec2::new(79.5, 59.5) };
/// The colour camera has another lens, and stands 6 cm to the right and 2 cm above.
const COLOUR: Intrinsics = Intrinsics {
    width: 320,
    height: 240,
    focal: DVec2::new(250.0, 255.0),
    principal: DVec2::new(150.0, 122.0),
};
const BESIDE: DVec3 = DVec3::new(0.06, -0.02, 0.0);
const RED: [u8; 3] = [220, 30, 30];
const BLUE: [u8; 3] = [30, 30, 220];

/// A red square of 40 cm, 80 cm before a blue wall.
fn scene() -> TriangleMesh {
    let square = |half: f64, z: f64| {
        [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, y]| DVec3::new(x, y, z))
    };
    let mut vertices = square(4.0, 2.0).to_vec();
    vertices.extend(square(0.2, 1.2));
    let vertex_colours = [[BLUE; 4], [RED; 4]].concat();
    TriangleMesh {
        vertices,
        triangles: vec![[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]],
        appearance: Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() })),
        ..TriangleMesh::default()
    }
}

fn save(path: &Path, [width, height]: [u32; 2], kind: png::ColorType, depth: png::BitDepth, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(kind);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
}

/// A take of a camera that moves to the right by `step_m` from frame to frame.
fn record(work: &Workspace, frames: usize, step_m: f64, images: &str) {
    let mut poses = Vec::new();
    for frame in 0..frames {
        let x = step_m * frame as f64;
        let pose = CameraPose { rotation: DMat3::IDENTITY, centre: DVec3::new(x, 0.0, 0.0) };
        let depth = render_depth(&scene(), &DEPTH, &pose);
        let units = depth.depths_m().iter().flat_map(|m| ((m * 1000.0).round() as u16).to_be_bytes());
        let bytes: Vec<u8> = units.collect();
        let path = work.path(&format!("take/depth/{frame}.png"));
        save(&path, [160, 120], png::ColorType::Grayscale, png::BitDepth::Sixteen, &bytes);
        let beside = CameraPose { centre: pose.centre + BESIDE, ..pose };
        let image = render_colours(&scene(), &COLOUR, &beside, [0; 3]);
        let path = work.path(&format!("take/view/{frame}.png"));
        save(&path, [320, 240], png::ColorType::Rgb, png::BitDepth::Eight, image.pixels().as_flattened());
        poses.push(format!("[[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"));
    }
    let json = format!(
        r#"{{"width": 160, "height": 120, "fx": 140, "fy": 140, "cx": 79.5, "cy": 59.5, "poses": [{}],
            "colour": {{"images": {images}, "width": 320, "height": 240, "fx": 250, "fy": 255, "cx": 150, "cy": 122,
                "to_depth": [[1, 0, 0, 0.06], [0, 1, 0, -0.02], [0, 0, 1, 0], [0, 0, 0, 1]]}}}}"#,
        poses.join(", ")
    );
    fs::write(work.path("take/camera.json"), json).unwrap();
}

/// Decodes a stream and checks that what is near is red, and what is far is blue. Returns how many vertices there are of each.
fn check_colours(work: &Workspace, frame: &str) -> [usize; 2] {
    let range = format!("{frame}..{}", frame.parse::<usize>().unwrap() + 1);
    work.isv(&["decode", "out.isv", "-o", "one.ply", "--frames", &range]).done();
    let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
    let Geometry::Mesh(mesh) = read_geometry_as(&work.path("one.ply"), &options).unwrap() else {
        panic!("a mesh")
    };
    let colours = mesh.appearance.as_ref().expect("a coloured mesh").vertex_colours.clone();
    let mut counts = [0; 2];
    for (place, colour) in mesh.vertices.iter().zip(colours) {
        let (side, expected) = if place.z < 1.6 { (0, RED) } else { (1, BLUE) };
        counts[side] += 1;
        let off = (0..3).map(|c| colour[c].abs_diff(expected[c])).max().unwrap();
        assert!(off < 40, "{place}: {colour:?} instead of {expected:?}");
    }
    counts
}

#[test]
fn colours_stay_on_their_side_of_a_jump_in_depth() {
    for fusion in ["per-frame", "accumulate"] {
        let work = Workspace::new();
        record(&work, 3, 0.05, r#""view""#);
        work.isv(&["encode", "take", "-o", "out.isv", "--voxel", "20mm", "--fusion", fusion]).done();
        let counts = check_colours(&work, "2");
        assert!(counts[0] > 200 && counts[1] > 2000, "{fusion}: {counts:?}");
        let first = check_colours(&work, "0");
        assert!(fusion == "per-frame" || counts[1] > first[1], "{first:?} {counts:?}");
    }
}

#[test]
fn colour_images_that_are_not_kept_are_told_of() {
    let work = Workspace::new();
    record(&work, 1, 0.05, r#""view""#);
    let said = |more: &[&str]| {
        let run = ["encode", "take", "-o", "out.isv", "--voxel", "20mm"];
        work.isv(&[&run, more].concat()).done().stderr().contains("take: not kept: colour images")
    };
    assert!(!said(&[]) && said(&["--profile", "paper"]));
    work.isv(&["encode", "take", "-o", "out.isv", "--voxel", "20mm"]).done();
    let again = work.isv(&["encode", "out.isv", "-o", "again.isv", "--profile", "paper"]).done();
    assert!(again.stderr().contains("out.isv: not kept: colour"), "{}", again.stderr());
}

#[test]
fn a_still_room_costs_next_to_nothing() {
    let work = Workspace::new();
    record(&work, 6, 0.0, r#""view""#);
    work.isv(&["encode", "take", "-o", "out.isv", "--voxel", "20mm", "--fusion", "accumulate"]).done();
    let info = work.isv(&["info", "out.isv", "--json"]).json();
    let colour = |frame: usize| info["packets"][frame]["bytes_colour"].as_u64().unwrap();
    let all: Vec<u64> = (0..6).map(colour).collect();
    println!("bytes of colour: {all:?}");
    assert!(all[0] > 20 && all[1..].iter().all(|bytes| *bytes < 200), "{all:?}");
    check_colours(&work, "5");
}

#[test]
fn frames_without_an_image_keep_their_colour() {
    let work = Workspace::new();
    record(&work, 3, 0.02, r#"["view/0.png", null, "view/2.png"]"#);
    let run = work.isv(&["encode", "take", "-o", "out.isv", "--voxel", "20mm"]).done();
    assert!(run.stderr().contains("1 of 3 frames have no colour image"), "{}", run.stderr());
    check_colours(&work, "1");
}

#[test]
fn no_colour_opens_no_colour_image() {
    let work = Workspace::new();
    record(&work, 2, 0.02, r#""view""#);
    fs::write(work.path("take/view/1.png"), "no image").unwrap();
    let encode = ["encode", "take", "-o", "out.isv", "--voxel", "20mm"];
    work.isv(&encode).fails(1, &["1.png: frame 1: not a PNG, JPEG, WebP or KTX2 image"]);
    fs::remove_dir_all(work.path("take/view")).unwrap();
    work.isv(&encode).fails(1, &["view: ", "No such file"]);
    work.isv(&[&encode[..], &["--no-colour"]].concat()).done();
    work.isv(&[&encode[..], &["--profile", "paper"]].concat()).done();
}
