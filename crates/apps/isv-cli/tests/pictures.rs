//! `isv render`: stills, animations and pictures of errors.

mod support;

use gif::{ColorOutput, DecodeOptions};
use isv::raw::io::{Format, write_mesh};
use isv::raw::volume::TriangleMesh;
use isv_testkit::capture;
use std::fs;
use std::io::Cursor;
use support::Workspace;

/// Width, height and RGBA pixels of a still.
fn png(bytes: &[u8]) -> ([usize; 2], Vec<u8>) {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    // A picture without a transparent pixel has no alpha in its file.
    decoder.set_transformations(png::Transformations::ALPHA);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    ([info.width as usize, info.height as usize], pixels)
}

/// Width, height, delays and RGBA pixels of an animation.
fn gif(bytes: &[u8]) -> ([u16; 2], Vec<u16>, Vec<Vec<u8>>) {
    let mut options = DecodeOptions::new();
    options.set_color_output(ColorOutput::RGBA);
    let mut decoder = options.read_info(bytes).unwrap();
    let (mut delays, mut pictures) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        delays.push(frame.delay);
        pictures.push(frame.buffer.to_vec());
    }
    ([decoder.width(), decoder.height()], delays, pictures)
}

/// A folder of squares of 2 m in planes z = `heights`, one a frame.
fn with_squares(work: &Workspace, folder: &str, heights_mm: &[f64]) {
    fs::create_dir(work.path(folder)).unwrap();
    for (frame, z) in heights_mm.iter().enumerate() {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let mesh = TriangleMesh {
            vertices: corners.map(|[x, y]| [x, y, z / 1e3].into()).to_vec(),
            normals: vec![],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            appearance: None,
        };
        write_mesh(&work.path(&format!("{folder}/{frame}.ply")), &mesh, Format::Ply).unwrap();
    }
}

#[test]
fn errors_have_the_colours_of_their_size() {
    let work = Workspace::new();
    with_squares(&work, "flat", &[0.0, 0.0, 0.0]);
    with_squares(&work, "moved", &[0.0, 1.0, 3.0]);
    let middle = |frame: &str, more: &[&str]| {
        let args = ["render", "moved", "-o", "e.png", "--against", "flat", "--size", "200", "--frame", frame];
        let run = work.isv(&[&args[..], more].concat()).done();
        let ([width, height], pixels) = png(&work.read("e.png"));
        assert!(width == 200 && height > 200, "a bar is under the drawing: {width} x {height}");
        let at = (100 * width + 100) * 4;
        ([pixels[at], pixels[at + 1], pixels[at + 2]], run.stderr())
    };
    assert_eq!(middle("0", &[]).0, [255, 255, 204]);
    let (colour, said) = middle("1", &[]);
    assert_eq!(colour, [253, 141, 60]);
    assert!(said.contains("mean 1.000 mm, largest 1.000 mm"), "{said}");
    assert_eq!(middle("2", &[]).0, [0, 114, 178]);
    assert_eq!(middle("2", &["--range", "6mm"]).0, [253, 141, 60]);
}

#[test]
fn an_animation_has_all_frames_at_their_rate() {
    let (work, _) = Workspace::with_stream(4);
    work.isv(&["render", "take.isv", "-o", "take.gif", "--size", "64", "--fps", "10"]).done();
    let (size, delays, pictures) = gif(&work.read("take.gif"));
    assert_eq!((size, delays), ([64, 64], vec![10; 4]));
    assert_ne!(pictures[0], pictures[2]);

    work.isv(&["render", "take.isv", "-o", "take.apng", "--size", "64"]).done();
    let apng = work.read("take.apng");
    let reader = png::Decoder::new(Cursor::new(&apng)).read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 4);
    let frame = reader.info().frame_control().unwrap();
    assert_eq!((frame.delay_num, frame.delay_den), (1, 30), "the rate of the stream");

    let piped = work.isv(&["render", "take.isv", "-o", "-", "--format", "apng", "--size", "64"]).done();
    assert_eq!(piped.stdout(), apng);
    work.isv(&["render", "take.isv", "-o", "one.gif", "--frame", "3", "--size", "64"]).done();
    assert_eq!(gif(&work.read("one.gif")).1.len(), 1);
    work.isv(&["render", "take.isv", "-o", "some.gif", "--frames", "1..3", "--size", "64"]).done();
    assert_eq!(gif(&work.read("some.gif")).1.len(), 2);
}

#[test]
fn a_turntable_goes_around_while_frames_go_by() {
    let (work, bytes) = Workspace::with_stream(2);
    let turn = |more: &[&str]| {
        let args = ["render", "take.isv", "-o", "turn.apng", "--size", "64", "--turntable", "4"];
        work.isv(&[&args[..], more].concat()).done();
        let file = work.read("turn.apng");
        let mut reader = png::Decoder::new(Cursor::new(&file)).read_info().unwrap();
        let count = reader.info().animation_control().unwrap().num_frames;
        let mut picture = || {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            pixels
        };
        (0..count).map(|_| picture()).collect::<Vec<_>>()
    };
    let [still, other, moving] = [&[][..], &["--frame", "1"], &["--frames", "0..2"]].map(turn);
    assert_eq!((still.len(), moving.len()), (4, 4));
    assert_ne!(still[0], still[1]);
    // Another turntable begins where this one has turned by a quarter.
    assert_eq!(turn(&["--yaw", "90"])[0], still[1]);
    assert!(still[2] != other[2] && moving[0] != moving[2]);
    work.isv(&["render", "take.isv", "-o", "turn.png", "--turntable", "4", "--size", "64"]).done();
    let ([width, _], _) = png(&work.read("turn.png"));
    assert_eq!(width, 2 * 64 + 3 * 8, "a still of a turn is a contact sheet");

    // What comes from a pipe cannot be read twice, and is drawn the same.
    let args = ["render", "-", "-o", "piped.gif", "--frames", "0..2", "--size", "64"];
    work.isv_with_input(&args, &bytes).done();
    work.isv(&["render", "take.isv", "-o", "file.gif", "--frames", "0..2", "--size", "64"]).done();
    assert_eq!(work.read("piped.gif"), work.read("file.gif"));
}

#[test]
fn captions_and_backgrounds() {
    let work = Workspace::with_figure(2);
    let still = |more: &[&str]| {
        work.isv(&[&["render", "frames", "-o", "out.png", "--size", "128"], more].concat()).done();
        png(&work.read("out.png"))
    };
    let ([_, plain], light) = still(&[]);
    let ([_, captioned], _) = still(&["--captions"]);
    assert!(captioned > plain);
    let (_, dark) = still(&["--background", "dark"]);
    let (_, nothing) = still(&["--background", "transparent"]);
    assert_eq!(
        (light[..3].to_vec(), dark[..3].to_vec(), nothing[3]),
        (vec![250, 250, 248], vec![22, 23, 27], 0)
    );
    let looks = ["flat", "normals", "shaded", "lit", "colour"].map(|shade| still(&["--shade", shade]).1);
    let [flat, normals, shaded, lit, colour] = looks;
    assert!(flat != light && normals == light && shaded != light);
    assert!(lit == shaded && colour == shaded, "the figure has no colours");
    assert!(shaded.chunks(4).all(|pixel| pixel[0].abs_diff(pixel[2]) <= 2), "greys alone");
    // Errors have lines of their own where one is not wide enough, in all pictures of an animation.
    let lines = |size: &str| {
        let picture = ["render", "frames", "-o", "out.png", "--size", size, "--against", "frames"];
        work.isv(&picture).done();
        let ([_, plain], _) = png(&work.read("out.png"));
        work.isv(&[&picture[..], &["--captions"]].concat()).done();
        let ([_, captioned], _) = png(&work.read("out.png"));
        (captioned - plain) / 24
    };
    assert_eq!((lines("128"), lines("400")), (3, 1));
    let moving = ["render", "frames", "-o", "out.gif", "--size", "128", "--against", "frames", "--captions"];
    work.isv(&moving).done();
}

#[test]
fn threads_do_not_change_pictures() {
    let (work, _) = Workspace::with_stream(2);
    let with_threads = |threads: &str, name: &str| {
        let args = ["render", "take.isv", "-o", name, "--against", "frames", "--size", "96", "--captions"];
        let status = work.command(&args).env("RAYON_NUM_THREADS", threads).status().unwrap();
        assert!(status.success());
        work.read(name)
    };
    assert_eq!(with_threads("1", "one.gif"), with_threads("3", "three.gif"));
}

#[test]
fn what_cannot_be_drawn_is_said_in_one_sentence() {
    let (work, bytes) = Workspace::with_stream(3);
    work.isv(&["decode", "take.isv", "-o", "two", "--frames", "0..2"]).done();
    let names = work.names("");
    let render = |more: &[&str]| work.isv(&[&["render", "take.isv"], more].concat());
    render(&["-o", "out.jpg"]).fails(2, &["out.jpg: pictures are .png, .gif or .apng"]);
    render(&["-o", "out"]).fails(2, &["out: pictures are .png, .gif or .apng"]);
    render(&["-o", "out.png", "--format", "gif"]).fails(2, &["--format gif does not fit", "out.png"]);
    render(&["-o", "out.gif", "--fps", "60"]).fails(2, &["a GIF plays at most 50 pictures a second"]);
    render(&["-o", "out.gif", "--columns", "2"]).fails(2, &["--columns is for contact sheets"]);
    render(&["-o", "out.gif", "--turntable", "0"]).fails(2, &["--turntable", "1..=36000"]);
    render(&["-o", "out.gif", "--turntable", "-3"]).fails(2, &["-3"]);
    render(&["-o", "out.png", "--yaw", "NaN"]).fails(2, &["--yaw", "an angle is a number of degrees"]);
    render(&["-o", "out.png", "--range", "1mm"]).fails(2, &["--against"]);
    let against = |more: &[&str]| render(&[&["-o", "out.png", "--against"], more].concat());
    against(&["frames", "--range", "0mm"]).fails(2, &["--range", "a length is a number above 0"]);
    against(&["frames", "--range", "-1mm"]).fails(2, &["--range", "a length is a number above 0"]);
    against(&["frames", "--range", "2"]).fails(2, &["--range", "a length needs a unit"]);
    against(&["gone"]).fails(1, &["gone"]);
    against(&["two"]).fails(1, &["take.isv has 3 frames but two has 2", "--frames"]);
    against(&["two", "--frame", "2"]).fails(1, &["two: frames 2..3 asked for"]);
    against(&["-"]).fails(1, &["standard input"]);
    let piped = work.isv_with_input(&["render", "-", "-o", "out.gif"], &bytes);
    piped.fails(1, &["standard input: a pipe cannot be used here"]);
    assert_eq!(work.names(""), names);
}

#[test]
fn a_reference_without_a_surface_is_named() {
    let work = Workspace::new();
    with_squares(&work, "flat", &[0.0]);
    work.write("none.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    let run = work.isv(&["render", "flat", "-o", "out.png", "--against", "none.obj"]);
    run.fails(1, &["none.obj"]);
    assert_eq!(work.names(""), ["flat", "none.obj"]);
}

#[test]
fn a_real_dancer_is_drawn() {
    let Some(dancer) = capture("dancer") else { return };
    let dancer = dancer.to_str().unwrap();
    let work = Workspace::new();
    work.isv(&["encode", dancer, "-o", "dancer.isv", "--frames", "0..2"]).done();
    let run = work.isv(&[
        "render",
        "dancer.isv",
        "-o",
        "e.gif",
        "--against",
        dancer,
        "--frames",
        "0..2",
        "--captions",
    ]);
    let said = run.done().stderr();
    let mean_mm: f64 = said.split("mean ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((0.2..0.7).contains(&mean_mm), "{said}");
    let ([width, height], delays, _) = gif(&work.read("e.gif"));
    assert!(width == 512 && height > 560 && delays.len() == 2, "{width} x {height}, {delays:?}");
}
