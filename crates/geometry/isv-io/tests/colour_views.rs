//! Colour images beside depth images: which are read, where their cameras stand, and what is said of those that are broken.

use ::png::{BitDepth, ColorType};
use isv_io::{ColourSequence, Colours, DepthFileError, DepthSequence};
use isv_testfiles::image::{png, png_of_size};
use isv_testfiles::png::depths;
use isv_testkit::capture;
use isv_volume::ColourView;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const LENS: &str = r#""width": 4, "height": 2, "fx": 5, "fy": 6, "cx": 1.5, "cy": 0.5"#;
const STANDING: &str = "[[1, 0, 0, 0.25], [0, 1, 0, 0], [0, 0, 1, -2], [0, 0, 0, 1]]";
const BESIDE: &str = "[[1, 0, 0, 0.025], [0, 1, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]]";

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// An image of 4 x 2 pixels, all of one red.
fn red(value: u8) -> Vec<u8> {
    png(4, ColorType::Rgb, BitDepth::Eight, &[value, 0, 0].repeat(8))
}

/// A black image of a size.
fn black(width: u32, height: u32) -> Vec<u8> {
    png(width, ColorType::Rgb, BitDepth::Eight, &vec![0; 3 * (width * height) as usize])
}

/// A moving camera with three depth images, and keys of `camera.json` besides.
fn room(keys: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let poses = [STANDING; 3].join(", ");
    write(folder.path(), "camera.json", format!(r#"{{{LENS}, {keys} "poses": [{poses}]}}"#).as_bytes());
    for frame in 0..3 {
        write(folder.path(), &format!("depth/frame_{frame}.png"), &depths(4, &[1000; 8]));
    }
    folder
}

fn open(folder: &TempDir) -> Result<DepthSequence, DepthFileError> {
    DepthSequence::open_with(folder.path(), Colours::Keep)
}

/// The red of the first view of each frame, or -1 without a view.
fn reds(sequence: &DepthSequence) -> Vec<i32> {
    let red = |view: Option<&ColourView>| view.map_or(-1, |view| i32::from(view.image().pixels()[0][0]));
    (0..sequence.frames()).map(|frame| red(sequence.read_colours(frame).unwrap().first())).collect()
}

fn refused(folder: &TempDir) -> String {
    let read = |sequence: DepthSequence| sequence.read_colours(0);
    let text = open(folder).and_then(read).map(|_| ()).unwrap_err().to_string();
    let path = folder.path().to_str().unwrap();
    assert!(text.starts_with(path) && !text.contains('\n'), "{text}");
    text[path.len()..].trim_start_matches('/').to_owned()
}

#[test]
fn a_folder_of_colours_is_found_and_taken_as_registered() {
    let room = room("");
    for frame in 0..3 {
        write(room.path(), &format!("color/{frame}.png"), &red(frame));
    }
    let sequence = open(&room).unwrap();
    assert_eq!((sequence.colour_cameras(), sequence.frames_without_colour()), (1, 0));
    assert!(sequence.colours_are_uncalibrated());
    assert_eq!(reds(&sequence), [0, 1, 2]);
    assert_eq!(reds(&sequence.select(1..3).unwrap()), [1, 2]);
    let view = &sequence.read_colours(2).unwrap()[0];
    let depth = &sequence.read(2).unwrap()[0];
    assert_eq!((view.intrinsics(), view.pose()), (depth.intrinsics(), depth.pose()));
    assert_eq!((view.depth_image(), view.is_rough()), (Some(0), true));
    assert_eq!(sequence.image_paths(0).count(), 2);
    // Nobody who wants no colours looks for any.
    let without = DepthSequence::open(room.path()).unwrap();
    assert_eq!((without.colour_cameras(), without.image_paths(0).count()), (0, 1));
}

#[test]
fn a_colour_camera_has_a_lens_and_a_place_of_its_own() {
    let keys = format!(
        r#""color": {{"images": "c/*.png", "width": 8, "height": 4, "fx": 11, "fy": 12, "cx": 3.5, "cy": 1.5, "to_depth": {BESIDE}}},"#
    );
    let room = room(&keys);
    write(room.path(), "c/other.jpg", b"another kind");
    for frame in 0..3 {
        write(room.path(), &format!("c/{frame}.png"), &red(frame));
    }
    let view = &open(&room).unwrap().read_colours(0).unwrap()[0];
    // The image is half as large as the lens says: edges of pixels scale.
    let lens = view.intrinsics();
    assert_eq!((lens.width, lens.height, lens.focal.to_array()), (4, 2, [5.5, 6.0]));
    assert_eq!(lens.principal.to_array(), [1.5, 0.5]);
    assert_eq!(view.pose().centre.to_array(), [0.275, 0.5, -2.0]);
    assert!(!view.is_rough());
}

#[test]
fn a_lens_of_the_first_kinect_has_a_colour_camera_of_525_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let json = format!(
        r#"{{"width": 640, "height": 480, "fx": 585, "fy": 585, "cx": 320, "cy": 240, "poses": [{STANDING}]}}"#
    );
    write(folder.path(), "camera.json", json.as_bytes());
    write(folder.path(), "depth/0.png", b"is not read here");
    write(folder.path(), "rgb/0.png", &black(640, 480));
    let view = &open(&folder).unwrap().read_colours(0).unwrap()[0];
    assert_eq!(view.intrinsics().focal.to_array(), [525.0, 525.0]);
}

#[test]
fn frames_may_lack_an_image() {
    // In a folder, numbers tell which belong together.
    let by_folder = room("");
    write(by_folder.path(), "color/frame_0.color.png", &red(7));
    write(by_folder.path(), "color/frame_2.color.png", &red(9));
    // In a list, null does.
    let by_list = room(r#""colour": ["x/a.png", null, "x/b.png"],"#);
    write(by_list.path(), "x/a.png", &red(7));
    write(by_list.path(), "x/b.png", &red(9));
    for folder in [by_folder, by_list] {
        let sequence = open(&folder).unwrap();
        assert_eq!(reds(&sequence), [7, -1, 9]);
        assert_eq!((sequence.frames_without_colour(), sequence.colour_cameras()), (1, 1));
    }
}

#[test]
fn images_of_any_size_and_kind_are_read() {
    let room = room(r#""colour": ["0.png", "1.png", "2.png"],"#);
    write(room.path(), "0.png", &black(400, 200));
    let grey = [40, 80, 120, 160].map(|v: u16| (v * 257).to_be_bytes()).concat();
    write(room.path(), "1.png", &png(4, ColorType::Grayscale, BitDepth::Sixteen, &grey.repeat(2)));
    write(room.path(), "2.png", &black(4, 2));
    let sequence = open(&room).unwrap();
    let views = [0, 1, 2].map(|frame| sequence.read_colours(frame).unwrap().remove(0));
    assert_eq!(views.each_ref().map(|view| view.intrinsics().width), [400, 4, 4]);
    assert_eq!(views[0].intrinsics().focal.to_array(), [500.0, 600.0]);
    assert_eq!(views[1].image().pixels()[1], [80; 3]);
}

#[test]
fn broken_colours_are_named_with_their_frame() {
    let with = |keys: &str, files: &[(&str, Vec<u8>)]| {
        let room = room(keys);
        files.iter().for_each(|(name, bytes)| write(room.path(), name, bytes));
        refused(&room)
    };
    let one = r#""colour": ["0.png", null, null],"#;
    let missing = with(one, &[]);
    assert!(missing.starts_with("0.png: frame 0: cannot be read: No such file"), "{missing}");
    assert_eq!(
        with(one, &[("0.png", b"GIF89a".to_vec())]),
        "0.png: frame 0: not a PNG, JPEG, WebP or KTX2 image"
    );
    let cut = with(one, &[("0.png", red(1)[..60].to_vec())]);
    assert!(cut.starts_with("0.png: frame 0: not a readable PNG image: "), "{cut}");
    assert_eq!(
        with(one, &[("0.png", black(40, 40))]),
        "0.png: frame 0: a colour image of 40 x 40 pixels has another shape than its camera, 4 x 2"
    );
    let huge = with(one, &[("0.png", png_of_size(16384, 8192))]);
    assert!(huge.starts_with("0.png: frame 0: 16384 x 8192 pixels; the limit is"), "{huge}");
    assert_eq!(
        with(r#""colour": ["0.png"],"#, &[]),
        "camera.json: 1 colour images, but 3 depth images, and their names do not say which belong together"
    );
    let outside = with(r#""colour": ["../0.png", null, null],"#, &[]);
    assert!(outside.starts_with("camera.json: `../0.png` leads out of its folder"), "{outside}");
    let unpaired = with(r#""colour": "c","#, &[("c/left.png", red(1)), ("c/right.png", red(1))]);
    assert_eq!(
        unpaired,
        "c: 2 colour images, but 3 depth images, and their names do not say which belong together"
    );
    assert_eq!(
        with(r#""colour": "c","#, &[("c/a.txt", vec![])]),
        "c: no colour images here; they must be .png, .jpg or .webp"
    );
    let half = with(
        r#""colour": {"images": "c", "fx": 5},"#,
        &[("c/1.png", red(1)), ("c/0.png", red(1)), ("c/2.png", red(1))],
    );
    assert_eq!(
        half,
        "camera.json: the colour camera has some of fx, fy, cx and cy: give all of them or none"
    );
    assert_eq!(with(r#""colour": {"fx": 5},"#, &[]), "camera.json: `colour` names no images");
    assert_eq!(
        with(r#""colour": 7,"#, &[]),
        "camera.json: `colour` is neither a place of images nor a camera"
    );
    let bent = r#""colour": {"images": ["0.png", null, null], "k1": 0.1},"#;
    assert_eq!(
        with(bent, &[("0.png", red(1))]),
        "camera.json: the colour camera has a distortion, so it needs fx, fy, cx and cy, too"
    );
}

#[test]
fn every_prefix_of_an_image_gives_a_message() {
    let room = room(r#""colour": ["0.png", null, null],"#);
    let bytes = red(3);
    for length in 0..bytes.len() {
        write(room.path(), "0.png", &bytes[..length]);
        let _ = open(&room).unwrap().read_colours(0);
    }
}

#[test]
fn an_unnamed_folder_that_fits_nothing_is_passed_over() {
    let with = |keys: &str, images: [Vec<u8>; 3]| {
        let room = room(keys);
        for (frame, bytes) in images.iter().enumerate() {
            write(room.path(), &format!("color/{frame}.png"), bytes);
        }
        (open(&room).unwrap(), room)
    };
    let one = room("");
    write(one.path(), "color/left.png", &red(1));
    assert_eq!(open(&one).unwrap().colour_cameras(), 0);
    // Another shape, or no image at all.
    assert_eq!(with("", [black(40, 40), red(1), red(2)]).0.colour_cameras(), 0);
    assert_eq!(with("", [vec![], red(1), red(2)]).0.colour_cameras(), 0);
    // One that nobody named does not cost its frame.
    let (sequence, _room) = with("", [red(0), black(40, 40), vec![]]);
    assert_eq!(reds(&sequence), [0, -1, -1]);
    let (_, room) = with("", [red(0), red(1), red(2)]);
    let text = ColourSequence::open(room.path()).unwrap_err().to_string();
    assert!(
        text.ends_with("no camera has colour images with a calibration: name them under `colour`"),
        "{text}"
    );
}

#[test]
fn what_others_write_under_these_keys_is_passed_over() {
    for keys in [
        r#""rgb": true,"#,
        r#""color": {"width": 1920, "height": 1080, "fx": 1, "k1": "?"},"#,
        r#""color": [1, 2], "rgb": {},"#,
        r#""colour": null,"#,
    ] {
        let room = room(keys);
        assert_eq!(open(&room).unwrap().colour_cameras(), 0, "{keys}");
        assert_eq!(DepthSequence::open(room.path()).unwrap().frames(), 3, "{keys}");
    }
    let room = room(r#""rgb": true, "color": ["0.png", null, null],"#);
    write(room.path(), "0.png", &red(5));
    assert_eq!(reds(&open(&room).unwrap()), [5, -1, -1]);
}

#[test]
fn cameras_of_colour_alone_have_no_part_in_the_limit_of_depths() {
    let large = |keys: &str| {
        let lens = r#""width": 16384, "height": 8192, "fx": 5, "fy": 6, "cx": 1.5, "cy": 0.5"#;
        format!(r#"{{"name": "a", {lens}, "camera_to_world": {STANDING}, {keys}}}"#)
    };
    let folder = rig(&[]);
    let cameras = [vec![large(r#""images": "d""#)], vec![large(r#""colour": "c""#); 4]].concat();
    write(folder.path(), "rig.json", format!(r#"{{"cameras": [{}]}}"#, cameras.join(", ")).as_bytes());
    assert_eq!(open(&folder).unwrap().colour_cameras(), 4);
    assert_eq!(DepthSequence::open(folder.path()).unwrap().cameras(), 1);
}

#[test]
fn tum_images_are_paired_by_time_and_stand_where_they_were_taken() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("depth.txt", "10.00 d/a.png\n10.04 d/b.png\n10.08 d/c.png\n"),
        ("groundtruth.txt", "10.00 0 0 0 0 0 0 1\n10.10 1 0 0 0 0 0 1\n"),
        ("rgb.txt", "# time file\n10.03 c/1.png\n10.00 c/0.png\n10.12 c/late.png\n"),
        ("camera.json", &format!("{{{LENS}, \"depth_scale_m\": 0.001}}")),
    ] {
        write(folder.path(), name, text.as_bytes());
    }
    for name in ["a", "b", "c"] {
        write(folder.path(), &format!("d/{name}.png"), &depths(4, &[1000; 8]));
    }
    assert_eq!(open(&folder).unwrap().colour_cameras(), 0, "a list without its images");
    write(folder.path(), "c/0.png", &red(1));
    write(folder.path(), "c/1.png", &red(2));
    let sequence = open(&folder).unwrap();
    assert_eq!(reds(&sequence), [1, 2, -1]);
    let view = &sequence.read_colours(1).unwrap()[0];
    assert!((view.pose().centre.x - 0.3).abs() < 1e-9, "{view:?}");
    assert!(!sequence.colours_are_uncalibrated());
    let own =
        format!(r#"{{{LENS}, "colour": {{"fx": 9, "fy": 9, "cx": 1, "cy": 1, "to_depth": {BESIDE}}}}}"#);
    write(folder.path(), "camera.json", own.as_bytes());
    let view = &open(&folder).unwrap().read_colours(1).unwrap()[0];
    assert_eq!(view.intrinsics().focal.to_array(), [9.0, 9.0]);
    assert!((view.pose().centre.x - 0.325).abs() < 1e-9, "{view:?}");
}

/// A rig of cameras given by keys besides the lens, with a colour image or two in `c`.
fn rig(cameras: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = |(number, keys): (usize, &&str)| {
        format!(r#"{{"name": "cam{number}", {LENS}, "camera_to_world": {STANDING}, {keys}}}"#)
    };
    let cameras: Vec<String> = cameras.iter().enumerate().map(camera).collect();
    write(folder.path(), "rig.json", format!(r#"{{"cameras": [{}]}}"#, cameras.join(", ")).as_bytes());
    for frame in 0..2 {
        write(folder.path(), &format!("d/{frame}.png"), &depths(4, &[1000; 8]));
        write(folder.path(), &format!("c/{frame}.png"), &red(frame));
    }
    write(folder.path(), "short/0.png", &red(0));
    folder
}

#[test]
fn cameras_of_a_rig_see_depths_or_colours_or_both() {
    let other = format!(r#""colour": {{"images": "c", "camera_to_world": {BESIDE}}}"#);
    let folder = rig(&[r#""images": "d", "colour": "c""#, r#""colour": "c""#, r#""images": "d""#, &other]);
    let sequence = open(&folder).unwrap();
    assert_eq!((sequence.cameras(), sequence.colour_cameras(), sequence.frames()), (2, 3, 2));
    let views = sequence.read_colours(1).unwrap();
    assert_eq!(views.iter().map(ColourView::depth_image).collect::<Vec<_>>(), [Some(0), None, None]);
    assert_eq!(views[2].pose().centre.to_array(), [0.025, 0.5, 0.0]);
    let colours = ColourSequence::open(&folder.path().join("rig.json")).unwrap();
    assert_eq!((colours.cameras(), colours.frames()), (3, 2));
    assert_eq!(colours.read(1).unwrap(), views);
    assert_eq!(DepthSequence::open(folder.path()).unwrap().cameras(), 2);
}

#[test]
fn a_rig_without_depths_has_colours_alone() {
    let folder = rig(&[r#""colour": "c""#, r#""color": "c""#]);
    let colours = ColourSequence::open(folder.path()).unwrap();
    assert_eq!((colours.cameras(), colours.frames()), (2, 2));
    assert_eq!(refused(&folder), "rig.json: 0 cameras with depth images, but 1 at least is needed");
    let bare = rig(&[r#""images": "d""#]);
    let text = ColourSequence::open(bare.path()).unwrap_err().to_string();
    assert!(
        text.ends_with(": no camera has colour images with a calibration: name them under `colour`"),
        "{text}"
    );
    assert_eq!(refused(&rig(&[r#""fps": 3"#])), "rig.json: camera cam0: it names neither images nor colour");
    let unequal = refused(&rig(&[r#""colour": "c""#, r#""colour": "short""#]));
    assert_eq!(
        unequal,
        "rig.json: 1 colour images of a camera, but 2 frames; all cameras of a rig must have equally many"
    );
}

#[test]
fn distorted_colours_become_those_of_a_pinhole() {
    let keys = r#""colour": {"images": ["0.png", null, null], "fx": 50, "fy": 50, "cx": 49.5, "cy": 24.5, "width": 100, "height": 50, "k1": 0.5},"#;
    let room = room(keys);
    let pixels: Vec<u8> = (0..5000u32).flat_map(|i| [(2 * (i % 100)) as u8, 0, 0]).collect();
    write(room.path(), "0.png", &png(100, ColorType::Rgb, BitDepth::Eight, &pixels));
    let view = &open(&room).unwrap().read_colours(0).unwrap()[0];
    let red = |x: f64| view.colour([x, 24.5].into()).map(|colour| colour[0]);
    // A pinhole's pixel 20 to the right of the middle is 0.4 from the axis; the lens shows it at 0.4 (1 + 0.5 * 0.16).
    let expected = 2.0 * (49.5 + 50.0 * 0.4 * 1.08);
    assert!((f64::from(red(69.5).unwrap()) - expected).abs() < 1.1, "{:?}", red(69.5));
    assert_eq!(red(98.0), None, "beyond what the lens shows");
}

#[test]
fn a_real_take_has_colours() {
    let Some(path) = capture("room_rgbd") else { return };
    let sequence = DepthSequence::open_with(&path, Colours::Keep).unwrap();
    assert_eq!((sequence.colour_cameras(), sequence.frames_without_colour()), (1, 0));
    let view = &sequence.read_colours(59).unwrap()[0];
    assert_eq!([view.intrinsics().width, view.intrinsics().height], [640, 480]);
    assert_eq!(view.intrinsics().focal.x, 525.0);
}
