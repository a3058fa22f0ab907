//! `isv eval`: what it measures, what it prints, and what it refuses.

mod support;

use isv::raw::encode::{Encoder, EncoderSettings};
use isv::raw::format::{FrameRate, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, Truncation, VoxelSize};
use isv_testkit::ball;
use serde_json::Value;
use std::fs;
use support::Workspace;

/// A unit square at a height, as an OBJ file.
fn square(z: f64) -> String {
    format!("v 0 0 {z}\nv 1 0 {z}\nv 1 1 {z}\nv 0 1 {z}\nf 1 2 3\nf 1 3 4\n")
}

fn grid() -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.02).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

fn stream_of(volumes: &[SparseVolume]) -> Vec<u8> {
    let header = StreamHeader::new(
        Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 }),
        grid(),
        FrameRate::DEFAULT,
    );
    let mut encoder = Encoder::new(&header, EncoderSettings::default());
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for (frame, volume) in (0..).zip(volumes) {
        let encoded = encoder.encode(volume);
        writer.write_frame(encoded.keyframe, frame, &encoded.payload()).unwrap();
    }
    writer.finish().unwrap()
}

/// A stream of frames in which nothing is.
fn empty_stream(frames: usize) -> Vec<u8> {
    stream_of(&vec![SparseVolume::empty(grid()); frames])
}

#[track_caller]
fn assert_near(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() < 1e-6 * expected.abs(), "{value}, expected {expected}");
}

fn table_of(work: &Workspace, reference: &str, test: &str) -> Vec<String> {
    let run = work.isv(&["eval", reference, test]).done();
    String::from_utf8(run.stdout().to_vec()).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn surfaces_have_every_figure() {
    let work = Workspace::new();
    work.write("a.obj", square(0.0));
    work.write("b.obj", square(0.25));
    let error = work.isv(&["eval", "a.obj", "b.obj", "--json"]).json();
    for of in [&error, &error["frames"][0]] {
        for (key, value) in of.as_object().unwrap() {
            let is_colour = key.starts_with("colour_") || key.starts_with("render_");
            assert!(
                if is_colour { value.is_null() } else { value.is_f64() || key == "frames" },
                "{key}: {value}"
            );
        }
        for key in ["p2s_mean_mm", "p2s_rms_mm", "p2s_p99_mm", "hausdorff_mm"] {
            assert_near(&of[key], 250.0);
        }
        for key in ["colour_y_psnr_db", "colour_ycc_psnr_db", "render_y_psnr_db", "render_ssim"] {
            assert!(of.as_object().unwrap()[key].is_null(), "{key}");
        }
        for direction in ["ref_to_test", "test_to_ref"] {
            for statistic in ["mean", "rms", "p99", "max"] {
                assert_near(&of[format!("{direction}_{statistic}_mm")], 250.0);
            }
        }
        assert_eq!((&of["normal_error_deg"], &of["area_ratio"]), (&0.0.into(), &1.0.into()));
        assert_eq!((&of["components_ref"], &of["component_ratio"]), (&1.0.into(), &1.0.into()));
        assert_near(&of["d2_psnr_db"], 10.0 * 48f64.log10());
        assert_near(&of["psnr_peak_m"], 1.0);
    }
    let table = table_of(&work, "a.obj", "b.obj");
    assert!(table[0].contains("p2s mm") && table[0].chars().count() <= 120, "{}", table[0]);
    assert!(table[2].contains("250.000") && table[2].ends_with("1 / 1"), "{}", table[2]);
}

#[test]
fn points_are_measured_on_either_side() {
    let work = Workspace::new();
    work.write("mesh.obj", square(0.0));
    work.write("points.xyz", "0.2 0.2 0.1 0 0 1\n0.5 0.7 0.3 0 0 -1\n");
    work.write("bare.xyz", "0.2 0.2 0.1\n0.5 0.7 0.3\n");
    let error = work.isv(&["eval", "mesh.obj", "points.xyz", "--json"]).json();
    assert_near(&error["test_to_ref_mean_mm"], 200.0);
    for key in ["p2s_mean_mm", "ref_to_test_mean_mm", "area_ratio", "components_test", "component_ratio"] {
        assert_eq!(error[key], Value::Null, "{key}");
    }
    assert!(error["normal_error_deg"].is_f64() && error["d2_psnr_db"].is_f64(), "{error}");
    let table = table_of(&work, "mesh.obj", "points.xyz");
    assert!(table[0].contains("to ref mm") && table[2].contains("200.000"), "{table:?}");
    assert!(table[2].ends_with("- / 1") || table[2].ends_with(" 1 / -"), "{}", table[2]);

    let error = work.isv(&["eval", "points.xyz", "mesh.obj", "--json"]).json();
    assert_near(&error["ref_to_test_max_mm"], 300.0);
    assert_eq!((&error["test_to_ref_mean_mm"], &error["chamfer_floor_mm"]), (&Value::Null, &Value::Null));
    assert!(table_of(&work, "points.xyz", "mesh.obj")[0].contains("to test mm"));

    let error = work.isv(&["eval", "bare.xyz", "points.xyz", "--json"]).json();
    assert_eq!((&error["chamfer_mm"], &error["d1_psnr_db"]), (&0.0.into(), &999.99.into()));
    assert_eq!((&error["d2_psnr_db"], &error["normal_error_deg"]), (&Value::Null, &Value::Null));
    let table = table_of(&work, "bare.xyz", "points.xyz");
    assert!(table[2].ends_with('-') && table[2].contains("999.99"), "{}", table[2]);
}

#[test]
fn points_of_a_stream_lie_on_its_surface() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "points", "--as", "points", "--spacing", "10mm"]).done();
    let error = work.isv(&["eval", "take.isv", "points", "--json"]).json();
    let mean_mm = error["test_to_ref_mean_mm"].as_f64().unwrap();
    assert!(mean_mm < 0.5, "{mean_mm}");
    let degrees = error["normal_error_deg"].as_f64().unwrap();
    assert!(degrees < 15.0, "{degrees}");
}

#[test]
fn one_point_has_no_peak() {
    let work = Workspace::new();
    work.write("one.xyz", "0 0 0\n");
    work.write("other.xyz", "0 0 0.5\n");
    let error = work.isv(&["eval", "one.xyz", "other.xyz", "--json"]).json();
    assert_near(&error["chamfer_mm"], 500.0);
    assert_eq!((&error["psnr_peak_m"], &error["d1_psnr_db"]), (&0.0.into(), &Value::Null));
}

#[test]
fn threads_do_not_change_figures() {
    let (work, _) = Workspace::with_stream(2);
    let run = |threads| {
        let args = ["eval", "frames", "take.isv", "--json"];
        work.command(&args).env("RAYON_NUM_THREADS", threads).output().unwrap().stdout
    };
    assert!(!run("1").is_empty());
    assert_eq!(run("1"), run("3"));
}

#[test]
fn empty_sides_are_named() {
    let work = Workspace::with_figure(2);
    work.write("empty.isv", empty_stream(2));
    work.isv(&["eval", "frames", "empty.isv"])
        .fails(1, &["frame 0 of empty.isv against frames: the test mesh has no surface to measure"]);
    work.isv(&["eval", "empty.isv", "frames", "--frames", "1..2"])
        .fails(1, &["frame 1 of frames against empty.isv: the reference mesh has no surface to measure"]);
    work.isv(&["eval", "empty.isv", "empty.isv"]).fails(1, &["empty.isv: no frame has anything to measure"]);
    work.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    work.write("good.obj", square(0.0));
    work.isv(&["eval", "good.obj", "flat.obj"])
        .fails(1, &["frame 0 of flat.obj", "the test mesh has no surface"]);
    work.write("no_faces.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n");
    work.isv(&["eval", "good.obj", "no_faces.obj"]).fails(1, &["no_faces.obj: "]);
    work.write("nothing.xyz", "");
    work.isv(&["eval", "good.obj", "nothing.xyz"]).fails(1, &["nothing.xyz: "]);
}

#[test]
fn frames_that_are_empty_on_both_sides_are_in_no_mean() {
    let work = Workspace::new();
    work.write("take.isv", stream_of(&[ball(grid(), 0.0), SparseVolume::empty(grid())]));
    let error = work.isv(&["eval", "take.isv", "take.isv", "--json"]).json();
    assert_eq!(error["frames"][1], Value::Null);
    assert!(error["chamfer_mm"].is_f64());
    assert_eq!(error["chamfer_mm"], error["frames"][0]["chamfer_mm"]);
    let rows = table_of(&work, "take.isv", "take.isv");
    let empty: Vec<&str> = rows[rows.len() - 2].split_whitespace().collect();
    assert_eq!(empty[0], "1");
    assert!(empty.len() > 10 && empty[1..].iter().all(|cell| *cell == "-"), "{empty:?}");
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let work = Workspace::new();
    work.write("good.obj", square(0.0));
    work.write("broken.xyz", "0 0 0\n0 nan 0\n");
    work.isv(&["eval", "good.obj", "broken.xyz"]).fails(1, &["broken.xyz: point 1 is not finite"]);
    work.isv(&["eval", "good.obj", "good.obj", "--spacing", "0.0001mm"])
        .fails(1, &["frame 0 of good.obj", "takes 100000000000000 samples", "take a larger spacing"]);
    assert_eq!(work.isv(&["eval", "good.obj", "good.obj", "--spacing", "0mm"]).status(), Some(2));

    fs::create_dir_all(work.path("room/depth")).unwrap();
    let camera = r#"{"width": 3, "height": 1, "fx": 9, "fy": 9, "cx": 1, "cy": 0, "fps": 30, "depth_scale_m": 0.001,
        "poses": [[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]}"#;
    work.write("room/camera.json", camera);
    let mut image = Vec::new();
    let mut encoder = png::Encoder::new(&mut image, 3, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_image_data(&[3, 132, 3, 132, 3, 132]).unwrap();
    work.write("room/depth/0.png", image);
    work.isv(&["eval", "good.obj", "room"]).fails(1, &["room", "depth images have no surface to measure"]);
}
