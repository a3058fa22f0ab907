//! Folders of depth images: what is read from them, and what is said of those that are broken.

use ::exr::prelude::{Blocks, Encoding, FlatSamples, Vec2, f16};
use isv_io::{DepthFileError, DepthSequence, TUM_INTRINSICS, is_depth_folder};
use isv_testfiles::{exr, png};
use isv_testkit::capture;
use isv_volume::DepthImage;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const CAMERA: &str = r#""width": 4, "height": 2, "fx": 5, "fy": 6, "cx": 1.5, "cy": 0.5"#;
const STANDING: &str = "[[1, 0, 0, 0.25], [0, 1, 0, 0], [0, 0, 1, -2], [0, 0, 0, 1]]";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        write(folder.path(), name, text.as_bytes());
    }
    folder
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// A grey PNG of 4 x 2 pixels of 8 bits.
fn eight_bits() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, 4, 2);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[9; 8]).unwrap();
    bytes
}

fn room(frames: usize) -> TempDir {
    let poses = vec![STANDING; frames].join(", ");
    let json = format!(
        r#"{{{CAMERA}, "fps": 15, "depth_scale_m": 0.001, "invalid_values": [0, 65535], "poses": [{poses}], "note": ""}}"#
    );
    let room = folder(&[("camera.json", &json), ("depth/read.me", "not an image")]);
    for frame in 0..frames {
        let depth = 1000 + frame as u16;
        write(
            room.path(),
            &format!("depth/frame_{frame}.png"),
            &png::depths(4, &[0, depth, 2 * depth, 65535, 1, 1, 1, 1]),
        );
    }
    room
}

fn open(folder: &TempDir) -> Result<DepthSequence, DepthFileError> {
    DepthSequence::open(folder.path())
}

/// The message, which must be one line that names a file in the folder.
fn message(folder: &TempDir, error: &DepthFileError) -> String {
    let text = error.to_string();
    assert!(text.starts_with(folder.path().to_str().unwrap()) && !text.contains('\n'), "{text}");
    text[folder.path().to_str().unwrap().len()..].trim_start_matches('/').to_owned()
}

fn refused(folder: &TempDir) -> String {
    match open(folder).and_then(|sequence| sequence.read(0)) {
        Ok(_) => panic!("accepted"),
        Err(error) => message(folder, &error),
    }
}

fn depths(images: &[DepthImage]) -> Vec<&[f32]> {
    images.iter().map(DepthImage::depths_m).collect()
}

#[test]
fn a_moving_camera_is_read_frame_by_frame_in_natural_order() {
    let room = room(12);
    assert!(is_depth_folder(room.path()) && !is_depth_folder(&room.path().join("depth")));
    let sequence = open(&room).unwrap();
    assert_eq!((sequence.frames(), sequence.cameras(), sequence.fps()), (12, 1, Some(15.0)));
    let images = sequence.read(11).unwrap();
    assert_eq!(depths(&images), [[0.0, 1.011, 2.022, 0.0, 0.001, 0.001, 0.001, 0.001]]);
    assert_eq!(images[0].pose().centre.to_array(), [0.25, 0.0, -2.0]);
    assert_eq!(images[0].intrinsics().focal.to_array(), [5.0, 6.0]);
    let part = sequence.select(3..12).unwrap().select(7..9).unwrap();
    assert_eq!((part.frames(), part.read(1).unwrap()), (2, images));
    assert!(part.paths(1)[0].ends_with("depth/frame_11.png"));
    let beyond = sequence.select(3..13).unwrap_err();
    assert!(message(&room, &beyond).contains("frames 3..13 asked for, but there are 12"), "{beyond}");
    assert!(sequence.select(4..4).is_err());
}

#[test]
fn a_rig_gives_one_image_a_camera() {
    let camera = |name: &str, images: &str| {
        format!(r#"{{"name": "{name}", {CAMERA}, "camera_to_world": {STANDING}, "images": "{images}"}}"#)
    };
    let json = format!(
        r#"{{"fps": 25, "cameras": [{}, {}]}}"#,
        camera("left", "l"),
        camera("right", "shared/r_*.exr")
    );
    let rig = folder(&[("rig.json", &json)]);
    for frame in 0..2 {
        write(rig.path(), &format!("l/{frame}.png"), &png::depths(4, &[0, 1500, 0, 0, 0, 0, 0, 65535]));
        let metres = [2.5, f32::NAN, 0.0, f32::INFINITY, -1.0, 1.0, 2.0, 3.0];
        let samples = FlatSamples::F32(metres.to_vec());
        let other = FlatSamples::F32(vec![7.0; 8]);
        write(
            rig.path(),
            &format!("shared/r_{frame}.exr"),
            &exr::image([4, 2], vec![("A", other), ("view.Z", samples)]),
        );
    }
    let sequence = open(&rig).unwrap();
    assert_eq!((sequence.frames(), sequence.cameras(), sequence.fps()), (2, 2, Some(25.0)));
    assert_eq!(
        depths(&sequence.read(1).unwrap()),
        [[0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [2.5, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]]
    );
    fs::remove_file(rig.path().join("shared/r_1.exr")).unwrap();
    assert_eq!(
        message(&rig, &open(&rig).unwrap_err()),
        "shared/r_*.exr: 1 images, but 2 of camera left; all cameras of a rig must have equally many"
    );
}

#[test]
fn halves_and_single_channels_of_any_name_are_depths() {
    let room = room(1);
    fs::remove_file(room.path().join("depth/frame_0.png")).unwrap();
    let halves = FlatSamples::F16([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0].map(f16::from_f32).to_vec());
    write(room.path(), "depth/0.exr", &exr::image([4, 2], vec![("distance", halves.clone())]));
    let images = open(&room).unwrap().read(0).unwrap();
    assert_eq!(depths(&images), [[0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]]);
    write(room.path(), "depth/0.exr", &exr::image([4, 2], vec![("distance", halves.clone()), ("B", halves)]));
    let text = refused(&room);
    assert_eq!(text, "depth/0.exr: frame 0: no channel of depths: none is called Z, R, Y, depth or D");
    write(room.path(), "depth/0.exr", &exr::image([4, 2], vec![("Z", FlatSamples::U32(vec![1; 8]))]));
    assert!(refused(&room).ends_with("EXR must hold metres"));
}

/// A folder of an image of 8 x 6 pixels, whose units are sixteenths of a metre.
fn one_image(name: &str, bytes: &[u8]) -> TempDir {
    let lens = CAMERA.replace("4, \"height\": 2", "8, \"height\": 6");
    let json = format!(r#"{{{lens}, "depth_scale_m": 0.0625, "poses": [{STANDING}]}}"#);
    let folder = folder(&[("camera.json", &json)]);
    write(folder.path(), &format!("depth/{name}"), bytes);
    folder
}

#[test]
fn every_compression_gives_the_same_depths() {
    let expected = exr::steps(48);
    for (name, image) in exr::all_kinds([8, 6]) {
        let images = open(&one_image("0.exr", &image)).unwrap().read(0);
        assert_eq!(
            depths(&images.unwrap_or_else(|error| panic!("{name}: {error}"))),
            [&expected[..]],
            "{name}"
        );
    }
    for image in exr::DWA {
        let images = open(&one_image("0.exr", image)).unwrap().read(0).unwrap();
        assert_eq!(depths(&images), [&expected[..]], "floats are kept exactly");
    }
    let steps: Vec<u16> = expected.iter().map(|depth| (depth * 16.0) as u16).collect();
    for image in png::all_kinds(8, &steps) {
        assert_eq!(depths(&open(&one_image("0.png", &image)).unwrap().read(0).unwrap()), [&expected[..]]);
    }
}

#[test]
fn damaged_pixels_of_any_compression_never_panic() {
    let image = include_bytes!("../../../../fuzz/regressions/depth_exr/b44_differences_below_nothing");
    let _ = open(&one_image("0.exr", image)).unwrap().read(0);
    for (_, image) in exr::all_kinds([8, 6]) {
        let folder = one_image("0.exr", &image);
        let sequence = open(&folder).unwrap();
        for at in (0..image.len()).step_by(5) {
            let mut bytes = image.clone();
            bytes[at] ^= 0xff;
            write(folder.path(), "depth/0.exr", &bytes);
            let _ = sequence.read(0);
        }
    }
}

#[test]
fn memory_is_not_taken_for_what_a_block_claims() {
    let image = include_bytes!("../../../../fuzz/regressions/depth_exr/dwa_count_of_33_petabytes");
    let refusal = open(&one_image("0.exr", image)).unwrap().read(0).unwrap_err().to_string();
    assert!(refusal.ends_with("a block claims more than its pixels"), "{refusal}");
}

#[test]
fn memory_is_not_taken_for_tiles_that_the_image_cannot_fill() {
    let room = room(1);
    fs::remove_file(room.path().join("depth/frame_0.png")).unwrap();
    let tiles = Encoding { blocks: Blocks::Tiles(Vec2(64, 64)), ..Encoding::UNCOMPRESSED };
    let mut bytes = exr::encoded([4, 2], vec![("Z", FlatSamples::F32(vec![1.5; 8]))], tiles);
    write(room.path(), "depth/0.exr", &bytes);
    assert_eq!(depths(&open(&room).unwrap().read(0).unwrap()), [[1.5; 8]]);
    // Tiles of 34 gigabytes, and a chunk that claims one of them.
    let rows = bytes.windows(9).position(|kind| kind == b"tiledesc\0").unwrap() + 9 + 4 + 4;
    assert_eq!(bytes[rows..rows + 4], [64, 0, 0, 0]);
    bytes[rows..rows + 4].copy_from_slice(&0x0800_0040_u32.to_le_bytes());
    let chunk = bytes.len() - 4 * 8 - 4;
    assert_eq!(bytes[chunk..chunk + 4], [32, 0, 0, 0]);
    bytes[chunk..chunk + 4].copy_from_slice(&0x4000_0000_u32.to_le_bytes());
    write(room.path(), "depth/0.exr", &bytes);
    assert_eq!(refused(&room), "depth/0.exr: frame 0: tiles of 64 x 134217792 pixels");
}

#[test]
fn poses_between_time_stamps_are_interpolated() {
    let half_turn = std::f64::consts::FRAC_1_SQRT_2;
    let trajectory = format!(
        "# time tx ty tz qx qy qz qw\n10.00 0 0 0 0 0 0 1\n10.04 4 0 0 0 {half_turn} 0 {half_turn}\n"
    );
    let tum = folder(&[
        ("depth.txt", "# time file\n10.03 d/b.png\n10.01 d/a.png\n\n10.50 d/late.png\n9.97 d/early.png\n"),
        ("groundtruth.txt", &trajectory),
        ("camera.json", &format!("{{{CAMERA}, \"depth_scale_m\": 0.0002}}")),
    ]);
    for name in ["a", "b", "early"] {
        write(tum.path(), &format!("d/{name}.png"), &png::depths(4, &[5000; 8]));
    }
    let sequence = open(&tum).unwrap();
    assert_eq!((sequence.frames(), sequence.skipped()), (3, 1));
    let rate = sequence.fps().unwrap();
    assert!((rate - 1.0 / 0.04).abs() < 1e-6 || (rate - 1.0 / 0.02).abs() < 1e-6, "{rate}");
    let pose = *sequence.read(2).unwrap()[0].pose();
    assert!((pose.centre.x - 3.0).abs() < 1e-6, "{pose:?}");
    let angle = pose.rotation.x_axis.z.atan2(pose.rotation.x_axis.x).to_degrees().abs();
    assert!((angle - 67.5).abs() < 1e-4, "three quarters of a right angle, not {angle}");
    assert_eq!(sequence.read(0).unwrap()[0].pose().centre.x, 0.0, "before the first pose, that pose");
    assert_eq!(sequence.read(1).unwrap()[0].depths_m(), [1.0; 8]);

    fs::remove_file(tum.path().join("camera.json")).unwrap();
    let text = refused(&tum);
    assert_eq!(text, "d/early.png: frame 0: an image of 4 x 2 pixels for a camera of 640 x 480");
    write(tum.path(), "calibration.txt", b"500 510 1.5 0.5 4 2\n");
    let lens = *open(&tum).unwrap().read(0).unwrap()[0].intrinsics();
    assert_eq!((lens.focal.to_array(), lens.width), ([500.0, 510.0], 4));
    assert_eq!(TUM_INTRINSICS.principal.to_array(), [319.5, 239.5]);

    for (file, text, expected) in [
        ("calibration.txt", "500 x 1 2", "calibration.txt: `x` is not a number (line 1)"),
        (
            "calibration.txt",
            "500 500 1 2 4",
            "calibration.txt: fx fy cx cy and possibly width height are expected",
        ),
        ("groundtruth.txt", "x 0 0 0 0 0 0 1", "groundtruth.txt: `x` is not a time (line 1)"),
        ("groundtruth.txt", "1 0 nan 0 0 0 0 1", "groundtruth.txt: a number is not finite (line 1)"),
        (
            "groundtruth.txt",
            "#\n1 2 3",
            "groundtruth.txt: a time stamp, tx ty tz and qx qy qz qw are expected (line 2)",
        ),
        (
            "groundtruth.txt",
            "1 0 0 0 0 0 0 2",
            "groundtruth.txt: the quaternion has length 2, not 1 (line 1)",
        ),
        ("calibration.txt", "-1 1 1 1", "calibration.txt: fx is -1: give 1 and turn"),
        (
            "groundtruth.txt",
            "1 0 0 0 0 0 0 1",
            "groundtruth.txt: none of 4 depth images has a pose within 0.05 s",
        ),
        ("depth.txt", "1 2 3", "depth.txt: a time stamp and a file name are expected (line 1)"),
        ("depth.txt", "# nothing", "depth.txt: no depth images here"),
    ] {
        let before = fs::read(tum.path().join(file)).unwrap();
        write(tum.path(), file, text.as_bytes());
        let found = refused(&tum);
        assert!(found.starts_with(expected), "{found}");
        write(tum.path(), file, &before);
    }
    fs::remove_file(tum.path().join("groundtruth.txt")).unwrap();
    assert!(refused(&tum).starts_with("groundtruth.txt: No such file"));
}

/// What a frame without a pose says, after the name of its folder; the frames before and after it must be read.
fn lost_frame(folder: &TempDir, lost: usize) -> String {
    let sequence = open(folder).unwrap();
    assert_eq!(sequence.frames_without_pose(), [lost]);
    for frame in 0..sequence.frames() {
        assert_eq!(sequence.read(frame).is_ok(), frame != lost, "frame {frame}");
    }
    message(folder, &sequence.read(lost).unwrap_err())
}

#[test]
fn one_bad_matrix_costs_its_frame_alone() {
    let with_x = |x: &str| STANDING.replace("[1, 0, 0,", &format!("[{x}, 0, 0,"));
    for (bad, why) in [
        (with_x("-Infinity"), "a number is not finite"),
        (with_x("NaN"), "a number is not finite"),
        (with_x("-nan"), "a number is not finite"),
        (with_x("inf"), "a number is not finite"),
        (with_x("-1.#IND"), "a number is not finite"),
        (with_x("1e999"), "a number is not finite"),
        (with_x("null"), "a number is not finite"),
        (with_x("\"nan\""), "a number is not finite"),
        (with_x("2"), "the axes are not of unit length and square to each other"),
        (with_x("-1"), "it mirrors"),
        (STANDING.replace("[0, 0, 0, 1]", "[0, 0, 0, 2]"), "the last row is not 0 0 0 1"),
        (STANDING.replace(", [0, 0, 0, 1]", ""), "it is not 4 rows of 4 numbers"),
        ("null".to_owned(), "it is not 4 rows of 4 numbers"),
        ("NaN".to_owned(), "it is not 4 rows of 4 numbers"),
        ("[]".to_owned(), "it is not 4 rows of 4 numbers"),
        ("{}".to_owned(), "it is not 4 rows of 4 numbers"),
        ("\"lost\"".to_owned(), "it is not 4 rows of 4 numbers"),
    ] {
        let room = room(4);
        let json = format!(
            r#"{{"NaN": "-Infinity", {CAMERA}, "poses": [{STANDING}, {STANDING}, {bad}, {STANDING}]}}"#
        );
        write(room.path(), "camera.json", json.as_bytes());
        let expected = format!("camera.json: frame 2: the pose is no rotation and translation: {why}");
        assert_eq!(lost_frame(&room, 2), expected, "{bad}");
    }
    let rig = folder(&[("a/0.png", "")]);
    let camera =
        format!(r#"{{"name": "top", {CAMERA}, "camera_to_world": {}, "images": "a"}}"#, with_x("NaN"));
    write(rig.path(), "rig.json", format!(r#"{{"cameras": [{camera}]}}"#).as_bytes());
    let expected = "rig.json: camera top: the pose is no rotation and translation: a number is not finite";
    assert_eq!(refused(&rig), expected);
}

/// A take of five images, one each hundred milliseconds, and lines of poses.
fn tum_take(poses: &[&str]) -> TempDir {
    let images: String = (0..5).map(|frame| format!("10.{frame} {frame}.png\n")).collect();
    let tum = folder(&[
        ("depth.txt", &images),
        ("groundtruth.txt", &poses.join("\n")),
        ("calibration.txt", "500 510 1.5 0.5 4 2\n"),
    ]);
    for frame in 0..5 {
        write(tum.path(), &format!("{frame}.png"), &png::depths(4, &[1000; 8]));
    }
    tum
}

#[test]
fn one_bad_line_costs_its_frame_alone() {
    let line = |frame: usize| format!("10.{frame} {frame} 0 0 0 0 0 1");
    for (bad, why) in [
        ("10.F 0 nan 0 0 0 0 1", "a number is not finite"),
        ("10.F -inf 0 0 0 0 0 1", "a number is not finite"),
        ("10.F -1.#IND 0 0 0 0 0 1", "a number is not finite"),
        ("10.F 0 0 0 0 0 0 0", "the quaternion has length 0, not 1"),
        ("10.F 0 0", "a time stamp, tx ty tz and qx qy qz qw are expected"),
        ("10.F 0 0 0 0 0 0 x", "`x` is not a number"),
        ("10.F", "a time stamp, tx ty tz and qx qy qz qw are expected"),
        // Without a time of its own, a line stands for the image between its neighbours', or beside the first or last.
        ("nan 0 0 0 0 0 0 1", "`nan` is not a time"),
        ("lost", "`lost` is not a time"),
    ] {
        for frame in 0..5 {
            let bad = bad.replace('F', &frame.to_string());
            let mut lines: Vec<String> = (0..5).map(line).collect();
            lines[frame] = bad.clone();
            let take = tum_take(&lines.iter().map(String::as_str).collect::<Vec<_>>());
            let (found, number) = (lost_frame(&take, frame), frame + 1);
            let start = format!("groundtruth.txt: frame {frame}: the pose is no rotation and translation: ");
            assert_eq!(found, format!("{start}{why} (line {number})"), "{bad}");
            assert_eq!(open(&take).unwrap().timestamp_ns(4), Some(400_000_000));
        }
    }
}

#[test]
fn a_bad_line_between_good_ones_costs_no_frame_that_is_nearer_to_these() {
    let lines: Vec<String> = (0..=40)
        .map(|step| match step {
            // Nearest to the image at 10.2 s only.
            20 => "10.20 nan 0 0 0 0 0 1".to_owned(),
            // Nearest to none.
            5 | 33 => format!("10.{step:02} lost"),
            _ => format!("10.{step:02} {step} 0 0 0 0 0 1"),
        })
        .collect();
    let take = tum_take(&lines.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(lost_frame(&take, 2).contains("(line 21)"));
    assert_eq!(open(&take).unwrap().read(3).unwrap()[0].pose().centre.x, 30.0);
    // Headers without a comment sign, and an image beside a bad line.
    let header = tum_take(&[
        "time tx ty tz qx qy qz qw",
        "10.0 0 0 0 0 0 0 1",
        "10.1 1 0 0 0 0 0 1",
        "10.4 4 0 0 0 0 0 1",
    ]);
    let sequence = open(&header).unwrap();
    assert_eq!((sequence.frames(), sequence.skipped(), sequence.frames_without_pose()), (3, 2, vec![]));
    assert_eq!(sequence.timestamp_ns(2), Some(400_000_000));
    let all_lost = tum_take(&["10.0 lost", "10.1 lost"]);
    assert_eq!(refused(&all_lost), "groundtruth.txt: `lost` is not a number (line 1)");
}

#[test]
fn time_stamps_are_kept_to_the_nanosecond_in_any_unit() {
    let take = |stamps: &[&str]| {
        let list = |what: &str| stamps.iter().map(|time| format!("{time} {what}\n")).collect::<String>();
        folder(&[("depth.txt", &list("a.png")), ("groundtruth.txt", &list("0 0 0 0 0 0 1"))])
    };
    let ms = [0, 100, 200, 2400, 2500].map(|ms| ms * 1_000_000);
    for (stamps, unit) in [
        (
            [
                "1305031102.175304",
                "1305031102.275304",
                "1305031102.375304",
                "1305031104.575304",
                "1305031104.675304",
            ],
            None,
        ),
        (["0", "1e-1", "0.2", "2.4", "2.5"], None),
        (["0", "100", "200", "2400", "2500"], Some("milliseconds")),
        (
            ["1305031102175", "1305031102275", "1305031102375", "1305031104575", "1305031104675"],
            Some("milliseconds"),
        ),
        (["0", "100000", "200000", "2400000", "2500000"], Some("microseconds")),
        (
            [
                "1305031102175304000",
                "1305031102275304000",
                "1305031102375304000",
                "1305031104575304000",
                "1305031104675304000",
            ],
            Some("nanoseconds"),
        ),
    ] {
        let sequence = open(&take(&stamps)).unwrap();
        let times: Vec<_> = (0..5).map(|frame| sequence.timestamp_ns(frame).unwrap()).collect();
        assert_eq!((times, sequence.time_unit()), (ms.to_vec(), unit), "{stamps:?}");
        assert!((sequence.fps().unwrap() - 10.0).abs() < 1e-6);
    }
    // One frame a second or two is no millisecond.
    assert_eq!(open(&take(&["0", "1", "2"])).unwrap().fps(), Some(1.0));
    // An image without a pose is left out, and those after it keep their times.
    let gap = folder(&[
        ("depth.txt", "0 a.png\n1 a.png\n2 a.png\n"),
        ("groundtruth.txt", "0 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"),
    ]);
    let sequence = open(&gap).unwrap();
    assert_eq!(
        (sequence.frames(), sequence.skipped(), sequence.timestamp_ns(1)),
        (2, 1, Some(2_000_000_000))
    );
}

#[test]
fn times_of_camera_json_are_exact_and_in_order() {
    let with = |keys: &str| {
        let room = room(3);
        let json = format!(r#"{{{CAMERA}, {keys}, "poses": [{STANDING}, {STANDING}, {STANDING}]}}"#);
        write(room.path(), "camera.json", json.as_bytes());
        open(&room).map_err(|error| message(&room, &error)).map(|sequence| {
            let times: Vec<_> = (0..3).filter_map(|frame| sequence.timestamp_ns(frame)).collect();
            (times, sequence.fps(), sequence.time_unit())
        })
    };
    let times = |ns: [u64; 3]| ns.to_vec();
    for (keys, expected) in [
        (r#""fps": 30"#, (vec![], Some(30.0), None)),
        (
            r#""timestamps": [1305031102.175304, 1305031102.275304, 1305031102.375305]"#,
            (times([0, 100_000_000, 200_001_000]), None, None),
        ),
        (
            r#""timestamps": ["1305031102.175304001", "1305031102.275304", "1305031102.375304003"]"#,
            (times([0, 99_999_999, 200_000_002]), None, None),
        ),
        (
            r#""timestamps": [5, 38, 71], "fps": 25"#,
            (times([0, 33_000_000, 66_000_000]), Some(25.0), Some("milliseconds")),
        ),
        (
            r#""timestamps": [5, 38, 71], "fps": 25, "time_unit": "s""#,
            (times([0, 33_000_000_000, 66_000_000_000]), Some(25.0), None),
        ),
        (
            r#""timestamps": [0, 1.5, 3], "fps": 1"#,
            (times([0, 1_500_000_000, 3_000_000_000]), Some(1.0), Some("seconds")),
        ),
    ] {
        let (found, fps, unit) = with(keys).unwrap();
        assert_eq!((found, unit), (expected.0, expected.2), "{keys}");
        assert!(expected.1.is_none_or(|rate| fps == Some(rate)), "{keys}: {fps:?}");
    }
    for (keys, expected) in [
        (r#""timestamps": [0, NaN, 2]"#, "camera.json: frame 1: its entry in timestamps is no number"),
        (
            r#""timestamps": [0, 2, 1]"#,
            "camera.json: frame 2: its entry in timestamps is before that of the frame before it",
        ),
        (r#""timestamps": [0, 1]"#, "camera.json: 2 timestamps, but 3 images in "),
        (r#""timestamps": [0, 1, 2], "time_unit": "min""#, "camera.json: unknown variant `min`"),
        (r#""fps": NaN"#, "camera.json: fps is NaN; it must be above 0"),
    ] {
        let found = with(keys).unwrap_err();
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn time_unit_of_camera_json_holds_for_lists() {
    let list = |what: &str| (0..3).map(|frame| format!("{} {what}\n", 10 * frame)).collect::<String>();
    let files = [("depth.txt", list("a.png")), ("groundtruth.txt", list("0 0 0 0 0 0 1"))];
    let take = folder(&files.each_ref().map(|(name, text)| (*name, text.as_str())));
    assert_eq!(open(&take).unwrap().time_unit(), Some("milliseconds"));
    write(take.path(), "camera.json", format!(r#"{{{CAMERA}, "time_unit": "s"}}"#).as_bytes());
    let sequence = open(&take).unwrap();
    assert_eq!(
        (sequence.fps(), sequence.time_unit(), sequence.timestamp_ns(1)),
        (Some(0.1), None, Some(10_000_000_000))
    );
}

#[test]
fn lists_of_windows_name_images_with_backslashes() {
    for name in ["depth\\0.png", ".\\depth\\0.png", "depth/0.png"] {
        let take = folder(&[
            ("depth.txt", &format!("1 {name}\n")),
            ("groundtruth.txt", "1 0 0 0 0 0 0 1\n"),
            ("calibration.txt", "500 510 1.5 0.5 4 2\n"),
        ]);
        write(take.path(), "depth/0.png", &png::depths(4, &[1000; 8]));
        assert!(open(&take).unwrap().read(0).is_ok(), "{name}");
    }
}

/// Readings and what is said of values that may be none, of an image of a take whose camera has some keys.
fn suspects(keys: &str, values: &[u16; 8]) -> (usize, Option<(u16, f64, bool)>) {
    let room = room(3);
    let json = format!(r#"{{{CAMERA}, {keys} "poses": [{STANDING}, {STANDING}, {STANDING}]}}"#);
    write(room.path(), "camera.json", json.as_bytes());
    for (frame, values) in [&[9; 8], &[9; 8], values].into_iter().enumerate() {
        write(room.path(), &format!("depth/frame_{frame}.png"), &png::depths(4, values));
    }
    let sequence = open(&room).unwrap();
    let suspect = sequence.saturation().map(|found| {
        assert!(found.path.ends_with("depth/frame_2.png"));
        assert_eq!(found.depth_m, f64::from(found.value) * 0.001);
        (found.value, found.share, found.is_reading)
    });
    (sequence.read(2).unwrap()[0].readings(), suspect)
}

#[test]
fn a_saturated_pixel_is_no_reading_unless_the_capture_says_so() {
    let saturated = [65535, 1000, 1000, 1000, 0, 0, 0, 65535];
    assert_eq!(suspects("", &saturated), (3, Some((65535, 0.25, false))));
    assert_eq!(suspects(r#""invalid_values": null,"#, &saturated), (3, Some((65535, 0.25, false))));
    assert_eq!(suspects(r#""invalid_values": [0, 65535],"#, &saturated), (3, None));
    assert_eq!(suspects(r#""invalid_values": [0],"#, &saturated), (5, Some((65535, 0.25, true))));
    assert_eq!(suspects(r#""invalid_values": [],"#, &saturated), (5, Some((65535, 0.25, true))));
}

#[test]
fn other_largest_values_that_may_be_no_reading_are_named_and_kept() {
    let values = |largest| [largest, 1000, 1000, 1000, 0, 0, 0, largest];
    for largest in [2047, 4095, 10_000, 32_767, 65_534] {
        assert_eq!(suspects("", &values(largest)), (5, Some((largest, 0.25, true))));
        assert_eq!(suspects(&format!(r#""invalid_values": [0, {largest}],"#), &values(largest)), (3, None));
    }
    // A wall, and a value that is not the largest.
    assert_eq!(suspects("", &values(3000)), (5, None));
    assert_eq!(suspects("", &[4095, 4095, 4095, 5000, 0, 0, 0, 0]), (4, None));
}

#[test]
fn the_background_of_renderers_is_no_reading() {
    let metres = [65_504.0, 1e10, 65_503.0, 1.0, f32::MAX, 0.0, 0.0, 0.0];
    let room = room(1);
    fs::remove_file(room.path().join("depth/frame_0.png")).unwrap();
    write(room.path(), "depth/0.exr", &exr::image([4, 2], vec![("Z", FlatSamples::F32(metres.to_vec()))]));
    assert_eq!(
        depths(&open(&room).unwrap().read(0).unwrap()),
        [[0.0, 0.0, 65_503.0, 1.0, 0.0, 0.0, 0.0, 0.0]]
    );
}

#[test]
fn a_lens_that_distorts_is_undone_as_the_image_is_read() {
    // A pixel two columns right of the centre was seen at 2 (1 + 0.0625 * 4 k1) columns: 3 with k1 = 2, where x is 0.5.
    let room = room(1);
    let camera = CAMERA.replace("\"fx\": 5", "\"fx\": 4");
    for (keys, expected) in [(r#""k1": 2,"#, [9.0, 1.0, 3.0, 0.0]), (r#""k1": 0,"#, [9.0, 1.0, 2.0, 3.0])] {
        let json =
            format!(r#"{{{camera}, {keys} "poses": [{STANDING}]}}"#).replace("\"cx\": 1.5", "\"cx\": 0");
        write(room.path(), "camera.json", json.replace("\"cy\": 0.5", "\"cy\": 0").as_bytes());
        write(room.path(), "depth/frame_0.png", &png::depths(4, &[9000, 1000, 2000, 3000, 0, 0, 0, 0]));
        let image = &open(&room).unwrap().read(0).unwrap()[0];
        assert_eq!(image.depths_m()[..4], expected, "{keys}");
    }
}

/// The examples of `docs/formats/depth.md`, with empty files for images.
#[test]
fn documented_examples_are_read() {
    let page = include_str!("../../../../docs/formats/depth.md");
    let examples: Vec<&str> =
        page.split("```json\n").skip(1).map(|part| part.split("```").next().unwrap()).collect();
    let camera = folder(&[("camera.json", examples[0]), ("depth/0.png", "")]);
    let sequence = open(&camera).unwrap();
    assert_eq!((sequence.frames(), sequence.cameras(), sequence.fps()), (1, 1, Some(30.0)));
    let rig = folder(&[("rig.json", examples[1]), ("left/0.png", ""), ("all/right_0.exr", "")]);
    let sequence = open(&rig).unwrap();
    assert_eq!((sequence.frames(), sequence.cameras(), sequence.fps()), (1, 2, Some(25.0)));
}

#[test]
fn broken_descriptions_are_named_in_one_sentence() {
    let with = |json: &str| {
        let room = room(1);
        write(room.path(), "camera.json", json.as_bytes());
        refused(&room)
    };
    let scaled = STANDING.replace("[1, 0, 0,", "[1.2, 0, 0,");
    let mirrored = STANDING.replace("[1, 0, 0,", "[-1, 0, 0,");
    let tall = STANDING.replace("[0, 0, 0, 1]", "[0, 0, 1, 1]");
    for (json, expected) in [
        ("{".to_owned(), "camera.json: EOF while parsing an object at line 1"),
        ("{}".to_owned(), "camera.json: missing field `poses`"),
        (format!("{{{CAMERA}}}"), "camera.json: missing field `poses`"),
        (format!(r#"{{{CAMERA}, "poses": []}}"#), "camera.json: 0 poses, but 1 images in "),
        (
            format!(r#"{{{CAMERA}, "poses": [{scaled}]}}"#),
            "camera.json: frame 0: the pose is no rotation and translation: the axes are not of unit length",
        ),
        (
            format!(r#"{{{CAMERA}, "poses": [{mirrored}]}}"#),
            "camera.json: frame 0: the pose is no rotation and translation: it mirrors",
        ),
        (
            format!(r#"{{{CAMERA}, "poses": [{tall}]}}"#),
            "camera.json: frame 0: the pose is no rotation and translation: the last row is not 0 0 0 1",
        ),
        (
            format!(r#"{{{CAMERA}, "fps": 0, "poses": [{STANDING}]}}"#),
            "camera.json: fps is 0; it must be above 0 and at most 1000000",
        ),
        (
            format!(r#"{{{CAMERA}, "depth_scale_m": -1, "poses": [{STANDING}]}}"#),
            "camera.json: depth_scale_m is -1; it must be above 0 and at most 1000000",
        ),
        (
            format!(r#"{{{}, "poses": [{STANDING}]}}"#, CAMERA.replace("\"fx\": 5", "\"fx\": 0")),
            "camera.json: intrinsics of 4 x 2 pixels with fx 0,",
        ),
        (
            format!(r#"{{{}, "poses": [{STANDING}]}}"#, CAMERA.replace("4, \"h", "5, \"h")),
            "depth/frame_0.png: frame 0: an image of 4 x 2 pixels for a camera of 5 x 2",
        ),
    ] {
        let found = with(&json);
        assert!(found.starts_with(expected), "{found}\ninstead of\n{expected}");
    }
    let rig = folder(&[("rig.json", r#"{"cameras": []}"#)]);
    assert_eq!(refused(&rig), "rig.json: 0 cameras with depth images, but 1 at least is needed");
    let camera = format!(r#"{{"name": "top", {CAMERA}, "camera_to_world": {scaled}, "images": "a"}}"#);
    write(rig.path(), "rig.json", format!(r#"{{"cameras": [{camera}]}}"#).as_bytes());
    assert!(refused(&rig).starts_with("rig.json: camera top: the pose is no rotation"));
    let empty = folder(&[("frame.ply", "ply")]);
    assert!(refused(&empty).ends_with("there is neither rig.json nor depth.txt nor camera.json"));
}

#[test]
fn broken_images_are_named_with_their_frame() {
    let room = room(3);
    let image = room.path().join("depth/frame_1.png");
    let sound = fs::read(&image).unwrap();
    let sequence = open(&room).unwrap();
    let read = || sequence.read(1).map_err(|error| message(&room, &error));

    fs::write(&image, png::depths(4, &[0, 65535, 0, 0, 0, 0, 0, 0])).unwrap();
    assert_eq!(read().unwrap_err(), "depth/frame_1.png: frame 1: no pixel has a depth");
    for end in 0..sound.len() - 12 {
        fs::write(&image, &sound[..end]).unwrap();
        assert!(read().unwrap_err().starts_with("depth/frame_1.png: frame 1: "), "{end} bytes");
    }
    fs::write(&image, eight_bits()).unwrap();
    let text = read().unwrap_err();
    assert_eq!(text, "depth/frame_1.png: frame 1: Grayscale of 8 bits; depths must be grey of 16 bits");
    fs::remove_file(&image).unwrap();
    assert!(read().unwrap_err().starts_with("depth/frame_1.png: frame 1: No such file"));
    write(room.path(), "depth/frame_1.exr", b"");
    assert!(refused(&room).starts_with("depth: both .png and .exr images"));
    fs::remove_dir_all(room.path().join("depth")).unwrap();
    assert!(refused(&room).starts_with("depth: No such file"));
    fs::create_dir(room.path().join("depth")).unwrap();
    assert!(refused(&room).starts_with("depth: no depth images here"));
}

/// A header that promises far more than the camera has is refused before memory is taken for it.
#[test]
fn images_larger_than_their_camera_are_refused_by_their_headers() {
    let room = room(1);
    let path = room.path().join("depth/frame_0.png");
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, 1 << 30, 1 << 30);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(::png::BitDepth::Sixteen);
    drop(encoder.write_header().unwrap());
    fs::write(path, bytes).unwrap();
    let text = refused(&room);
    assert!(text.contains("an image of 1073741824 x 1073741824 pixels for a camera of 4 x 2"), "{text}");
}

/// A camera and an image that agree on far more pixels than the file has bytes for.
#[test]
fn images_larger_than_their_files_are_refused() {
    let room = room(1);
    let wide = CAMERA.replace("4, \"height\": 2", "16384, \"height\": 16384");
    write(room.path(), "camera.json", format!(r#"{{{wide}, "poses": [{STANDING}]}}"#).as_bytes());
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, 16384, 16384);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(::png::BitDepth::Sixteen);
    drop(encoder.write_header().unwrap());
    let length = bytes.len();
    write(room.path(), "depth/frame_0.png", &bytes);
    let text = refused(&room);
    assert_eq!(text, format!("depth/frame_0.png: frame 0: {length} bytes cannot hold 16384 x 16384 pixels"));
    let beyond = CAMERA.replace("4, \"height\": 2", "16385, \"height\": 16384");
    write(room.path(), "camera.json", format!(r#"{{{beyond}, "poses": [{STANDING}]}}"#).as_bytes());
    assert!(refused(&room).starts_with("camera.json: intrinsics of 16385 x 16384 pixels"));
}

#[test]
fn damaged_images_never_panic() {
    let room = room(1);
    let depths = FlatSamples::F32((1..9).map(|i| i as f32).collect());
    let sound = exr::image([4, 2], vec![("Z", depths)]);
    fs::remove_file(room.path().join("depth/frame_0.png")).unwrap();
    let path = room.path().join("depth/frame_0.exr");
    fs::write(&path, &sound).unwrap();
    let sequence = open(&room).unwrap();
    assert!(sequence.read(0).is_ok());
    for end in 0..sound.len() {
        fs::write(&path, &sound[..end]).unwrap();
        assert!(sequence.read(0).is_err(), "{end} bytes");
    }
    for at in 0..sound.len() {
        for change in [1, 0x80, 0xff] {
            let mut bytes = sound.clone();
            bytes[at] ^= change;
            fs::write(&path, &bytes).unwrap();
            let _ = sequence.read(0);
        }
    }
}

#[test]
fn a_real_take_opens() {
    let Some(path) = capture("room_rgbd") else { return };
    let sequence = DepthSequence::open(&path).unwrap();
    assert_eq!((sequence.frames(), sequence.fps()), (60, Some(30.0)));
    let image = &sequence.read(0).unwrap()[0];
    assert_eq!(image.readings(), 273_943);
    assert!(image.depths_m().iter().all(|d| *d == 0.0 || (0.8..3.5).contains(d)));
}

/// Refuses frames of a rig whose cameras have dropped an image each, but not the same one. Rigs whose numbers
/// are in order or say nothing pass.
#[test]
fn images_that_were_not_taken_together_are_no_frame() {
    let camera = |name: &str| {
        format!(
            r#"{{"name": "{name}", "width": 2, "height": 2, "fx": 1, "fy": 1, "cx": 0.5, "cy": 0.5,
            "camera_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "images": "{name}"}}"#
        )
    };
    let json = format!(r#"{{"cameras": [{}, {}]}}"#, camera("left"), camera("right"));
    let rig = |left: &[&str], right: &[&str]| {
        let folder = folder(&[("rig.json", &json)]);
        for (camera, numbers) in [("left", left), ("right", right)] {
            for number in numbers {
                write(folder.path(), &format!("{camera}/cam_{number}.png"), b"");
            }
        }
        folder
    };
    let refused_pair = refused(&rig(&["0000", "0001", "0003", "0004"], &["0000", "0001", "0002", "0004"]));
    assert!(refused_pair.contains("frame 2: cam_0003.png and cam_0002.png are no pair"), "{refused_pair}");
    for (left, right) in [
        (["0000", "0001", "0003"], ["0000", "0001", "0003"]),
        // Each counts from a number of its own.
        (["7", "8", "10"], ["1001", "1002", "1004"]),
        // Times.
        (["1000", "1033", "1067"], ["1001", "1035", "1066"]),
        // No numbers.
        (["a", "b", "c"], ["a", "b", "d"]),
    ] {
        assert_eq!(DepthSequence::open(rig(&left, &right).path()).unwrap().frames(), 3, "{left:?} {right:?}");
    }
}
