//! Whatever is wrong: one sentence that says so, the right exit status, and nothing half-written.

mod support;

use isv::raw::encode::{Encoder, EncoderSettings, FrameQuality, Preset};
use isv::raw::format::{FramePayload, FrameRate, PacketReader, PacketWriter, Profile, StreamHeader};
use isv::raw::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use isv_testkit::volume_of;
use std::fs;
use std::io::Write;
use support::{ENCODE, Run, Workspace};

/// A tetrahedron as a text PLY whose lines after the header can be replaced.
fn ply(vertices: &[&str], faces: &[&str]) -> String {
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    );
    header + &[vertices, faces].concat().join("\n") + "\n"
}

const VERTICES: [&str; 4] = ["0 0 0", "0.1 0 0", "0 0.1 0", "0 0 0.1"];
const FACES: [&str; 4] = ["3 0 2 1", "3 0 1 3", "3 0 3 2", "3 1 2 3"];

/// Encodes a folder with a good frame and this one; whatever comes of it, nothing may be left behind.
fn encode_with(frame: &str) -> Run {
    let work = Workspace::new();
    fs::create_dir(work.path("in")).unwrap();
    work.write("in/frame.ply", frame);
    let run = work.isv(&["encode", "in", "-o", "out.isv", "--stats", "stats.json"]);
    assert_eq!(work.names(""), ["in"]);
    run
}

#[test]
fn a_good_tetrahedron_is_encoded() {
    let work = Workspace::new();
    work.write("frame.ply", ply(&VERTICES, &FACES));
    work.isv(&["encode", "frame.ply", "-o", "out.isv"]).done();
}

#[test]
fn an_empty_folder_and_a_missing_one() {
    let work = Workspace::new();
    fs::create_dir(work.path("in")).unwrap();
    work.isv(&["encode", "in", "-o", "out.isv"]).fails(1, &["in: no files of meshes or points here"]);
    work.isv(&["encode", "gone", "-o", "out.isv"]).fails(1, &["gone: no such file or folder"]);
    work.isv(&["decode", "gone.isv", "-o", "out"]).fails(1, &["gone.isv: "]);
    assert_eq!(work.names(""), ["in"]);
}

#[test]
fn a_slip_does_not_cost_a_capture() {
    let (work, _) = Workspace::with_stream(1);
    let frame = fs::read(work.path("frames/frame_0.ply")).unwrap();
    let stream = fs::read(work.path("take.isv")).unwrap();
    work.isv(&["encode", "frames", "-o", "frames/frame_0.ply"]).fails(
        2,
        &["frames/frame_0.ply: is there and is no .isv stream and no MP4 file, so it is not overwritten"],
    );
    work.isv(&["encode", "take.isv", "-o", "./take.isv"]).fails(2, &["./take.isv: is what is read"]);
    assert_eq!(fs::read(work.path("frames/frame_0.ply")).unwrap(), frame);
    assert_eq!(fs::read(work.path("take.isv")).unwrap(), stream);
    for copying in [&["cut", "take.isv", "0.."][..], &["join", "take.isv"], &["repair", "take.isv"]] {
        work.isv(&[copying, &["-o", "take.isv"]].concat()).fails(2, &["take.isv: is what is read"]);
        work.isv(&[copying, &["-o", "frames/frame_0.ply"]].concat()).fails(2, &["is no .isv stream"]);
    }
    // What is decoded has the names that captures have.
    fs::create_dir(work.path("capture")).unwrap();
    for (format, bytes) in [("ply", ply(&VERTICES, &FACES)), ("obj", "v 0 0 0\n".to_owned())] {
        let name = format!("capture/frame_0000.{format}");
        work.write(&name, &bytes);
        let decode = ["decode", "take.isv", "-o", "capture", "--format", format];
        work.isv(&decode).fails(2, &[&name, "is there and was not made by isv, so it is not overwritten"]);
        work.isv(&["decode", "take.isv", "-o", &name]).fails(2, &["was not made by isv"]);
        assert_eq!(work.read(&name), bytes.as_bytes());
    }
    work.write("capture/frame_0000.vdb", "a level set");
    work.isv(&["decode", "take.isv", "-o", "capture", "--format", "vdb"]).fails(2, &["was not made by isv"]);
    let volumes = ["decode", "take.isv", "-o", "capture", "--as", "volume"];
    fs::create_dir(work.path("capture/frame_0000")).unwrap();
    work.write("capture/frame_0000/tsdf.npy", "distances");
    work.isv(&volumes).fails(2, &["capture/frame_0000: is there and was not made by isv"]);
    work.write("capture/frame_0000/grid.json", "{}");
    work.isv(&volumes).fails(2, &["capture/frame_0000/grid.json: is there and was not made by isv"]);
    assert_eq!(work.names("capture/frame_0000"), ["grid.json", "tsdf.npy"]);
    work.isv(&["encode", "capture/frame_0000.ply", "-o", "new.isv", "--stats", "capture/frame_0000.ply"])
        .fails(2, &["capture/frame_0000.ply"]);
    work.isv(&["encode", "frames", "-o", "new.isv", "--stats", "frames/frame_0.ply"])
        .fails(2, &["frames/frame_0.ply: is there and holds no statistics"]);
    assert_eq!(fs::read(work.path("frames/frame_0.ply")).unwrap(), frame);
    // What an earlier run has left is not in the way.
    for _ in 0..2 {
        work.isv(&["encode", "frames", "-o", "take.isv", "--stats", "stats.json"]).done();
        for format in ["ply", "obj", "stl", "glb"] {
            work.isv(&["decode", "take.isv", "-o", "meshes", "--format", format]).done();
        }
        for format in ["ply", "pcd", "xyz"] {
            work.isv(&["decode", "take.isv", "-o", "points", "--as", "points", "--format", format]).done();
        }
        for format in ["npy", "vdb"] {
            work.isv(&["decode", "take.isv", "-o", "volumes", "--as", "volume", "--format", format]).done();
        }
    }
}

#[test]
fn a_truncated_frame() {
    let whole = ply(&VERTICES, &FACES);
    encode_with(&whole[..whole.len() - 9]).fails(1, &["frame.ply: truncated: header promises 4 faces"]);
}

#[test]
fn a_coordinate_that_is_no_number() {
    let mut vertices = VERTICES;
    vertices[2] = "0 nan 0";
    encode_with(&ply(&vertices, &FACES)).fails(1, &["frame.ply: vertex 2 is not finite"]);
}

#[test]
fn an_index_past_the_end() {
    let mut faces = FACES;
    faces[1] = "3 0 1 4";
    encode_with(&ply(&VERTICES, &faces)).fails(1, &["frame.ply: face 1 names vertex 4 of 4"]);
}

#[test]
fn no_faces() {
    let work = Workspace::new();
    let vertices: String = VERTICES.iter().map(|vertex| format!("v {vertex}\n")).collect();
    work.write("frame.obj", vertices + "l 1 2\n");
    work.isv(&["encode", "frame.obj", "-o", "out.isv"]).fails(1, &["frame.obj: no faces"]);
    assert_eq!(work.names(""), ["frame.obj"]);
}

#[test]
fn instructions_that_are_not_there() {
    let work = Workspace::new();
    let missing = if cfg!(target_arch = "x86_64") { "neon" } else { "sse2" };
    let info = |set| work.isv(&["info", "gone.isv", "--simd", set]);
    info(missing).fails(2, &["--simd: this machine does not have", missing, "it has scalar"]);
    info("mmx").fails(2, &["--simd", "'mmx' is no instruction set"]);
}

#[test]
fn captures_of_other_kinds() {
    let work = Workspace::new();
    let encode = |input: &str| work.isv(&["encode", input, "-o", "out.isv"]);
    fs::create_dir(work.path("mixed")).unwrap();
    work.write("mixed/a.ply", ply(&VERTICES, &FACES));
    work.write("mixed/b.obj", "v 0 0 0\n");
    encode("mixed").fails(1, &["mixed: ", ".ply", ".obj"]);
    work.write("empty.gltf", r#"{"asset": {"version": "2.0"}}"#);
    let run = encode("empty.gltf");
    assert!(run.stderr().contains("empty.gltf: no surface in any frame"), "{}", run.stderr());
    work.write("points.xyz", "0 0 0\n0 nan 0\n");
    encode("points.xyz").fails(1, &["points.xyz: point 1 is not finite"]);
    work.write("scan.laz", "LASF, or so it says");
    encode("scan.laz").fails(1, &["scan.laz: "]);
    work.isv(&["encode", "points.xyz", "-o", "out.isv", "--sign", "closed"]).fails(1, &["points.xyz: "]);
    work.write("bare.xyz", "0 0 0\n0 0 0.01\n");
    work.isv(&["encode", "bare.xyz", "-o", "out.isv", "--voxel=5mm", "--sign", "closed"])
        .fails(1, &["bare.xyz: no point has a normal", "--normals estimate"]);
    // Points a metre apart are no surface at 5 mm a voxel.
    let sparse: String = (0..100).map(|i| format!("{} {} 0 0 0 1\n", i % 10, i / 10)).collect();
    work.write("sparse.xyz", sparse);
    work.isv(&["encode", "sparse.xyz", "-o", "out.isv", "--voxel", "5mm"])
        .fails(1, &["sparse.xyz: the points are about 1", "try --voxel "]);
    assert!(!work.path("out.isv").exists());
}

#[test]
fn no_frame_vanishes_from_a_take() {
    let work = Workspace::new();
    fs::create_dir(work.path("in")).unwrap();
    work.write("in/a.ply", ply(&VERTICES, &FACES));
    work.write("in/b.ply", ply(&VERTICES, &[]));
    let last_line = |input: &str| {
        let run = work.isv(&["encode", input, "-o", "out.isv"]);
        assert_eq!(run.status(), Some(1));
        run.stderr().lines().last().unwrap().to_owned()
    };
    assert!(
        last_line("in")
            .starts_with("isv: in/b.ply: points and no faces, but the frames before it are meshes")
    );
    work.write("in/b.ply", "");
    assert_eq!(last_line("in"), "isv: in/b.ply: the file is empty");
    #[cfg(unix)]
    {
        fs::remove_file(work.path("in/b.ply")).unwrap();
        std::os::unix::fs::symlink("gone", work.path("in/b.ply")).unwrap();
        assert!(last_line("in").starts_with("isv: in/b.ply: No such file"));
        std::os::unix::fs::symlink("/dev/zero", work.path("endless.ply")).unwrap();
        assert_eq!(last_line("endless.ply"), "isv: endless.ply: not a regular file");
    }
    fs::create_dir_all(work.path("volumes/0")).unwrap();
    work.write("volumes/0/coords.npy", "");
    assert!(last_line("volumes").starts_with("isv: volumes/0/tsdf.npy: No such file"));
}

#[test]
fn flags_without_effect_are_named() {
    let (work, _) = Workspace::with_stream(1);
    let noted = |input: &str, flags: &[&str]| {
        let run = work.isv(&[&["encode", input, "-o", "new.isv", "--voxel=20mm"], flags].concat()).done();
        let note =
            run.stderr().lines().find_map(|line| Some(line.split_once("without effect on ")?.1.to_owned()));
        note.unwrap_or_default()
    };
    assert_eq!(
        noted("frames", &["--fusion=accumulate", "--max-depth=3m"]),
        "meshes and points: --fusion, --max-depth"
    );
    assert_eq!(noted("take.isv", &["--units=cm", "--normals=estimate"]), "volumes: --units, --normals");
    assert_eq!(noted("frames", &["--origin=0,0,0", "--sign=closed", "--offset=1"]), "");
    assert_eq!(noted("take.isv", &["--fusion=per-frame", "--sign=closed"]), "");
}

#[test]
fn an_output_that_ends_like_a_folder_is_refused_first() {
    let (work, _) = Workspace::with_stream(1);
    for args in [&["encode", "gone"][..], &["join", "take.isv", "take.isv"], &["repair", "take.isv"]] {
        let at_once = if args[0] == "encode" { "gone: " } else { "new.isv/: cannot write: " };
        work.isv(&[args, &["-o", "new.isv/"]].concat()).fails(1, &[at_once]);
    }
    work.isv(&["encode", "frames", "-o", "new.isv/", "--voxel=20mm"]).fails(1, &["new.isv/: cannot write: "]);
    assert_eq!(work.names(""), ["frames", "take.isv"]);
    work.isv(&["decode", "take.isv", "-o", "new.ply/"]).done();
    assert_eq!(work.names("new.ply"), ["frame_0000.ply"]);
}

#[test]
fn a_voxel_size_cannot_be_chosen_by_no_frames() {
    let (work, bytes) = Workspace::with_stream(1);
    work.write("empty.isv", &bytes[..48]);
    let auto = ["encode", "empty.isv", "-o", "new.isv", "--voxel", "auto"];
    work.isv(&auto).fails(1, &["empty.isv: no frames to choose a voxel size by"]);
}

/// Foam has many times the surface of what is captured.
#[test]
fn a_surface_of_more_than_there_is_memory_for_is_refused() {
    let work = Workspace::new();
    let header = StreamHeader::new(
        Profile::Main,
        Grid {
            voxel_size: VoxelSize::from_metres(0.01).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        },
        FrameRate::DEFAULT,
    );
    let foam = |position: [f64; 3]| 2.0 * position.map(|x| (2.0 * x).sin()).iter().sum::<f64>();
    let mut main = Preset::Realtime.settings();
    main.quality = FrameQuality::of_quality(100.0);
    let mut encoder = Encoder::new(&header, EncoderSettings { main, ..EncoderSettings::default() });
    let frame = encoder.encode(&volume_of(header.grid, 4, foam, |_| false));
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    writer.write_frame(true, 0, &frame.payload()).unwrap();
    work.write("foam.isv", writer.finish().unwrap());
    let decode = |content: &str, memory: &str| {
        work.isv(&["decode", "foam.isv", "-o", content, "--as", content, "--max-memory", memory])
    };
    // A vertex or more in each voxel of 512 blocks. A volume's distances are those of its surface.
    for content in ["mesh", "volume"] {
        decode(content, "5MB").fails(1, &["frame 0: ", "vertices", "--max-memory 5MB has room for"]);
        decode(content, "50MB").done();
    }
}

#[test]
fn a_frame_that_no_decoder_would_take_is_not_encoded() {
    let work = Workspace::new();
    work.write("frame.ply", ply(&VERTICES, &FACES));
    let encode = |memory: &str| {
        work.isv(&["encode", "frame.ply", "-o", "out.isv", "--voxel=5mm", "--max-memory", memory])
    };
    let refused = encode("100kB");
    assert_eq!(refused.status(), Some(1));
    let stderr = refused.stderr();
    // The sign had been announced.
    let why = stderr.lines().last().unwrap();
    assert!(why.starts_with("isv: frame.ply: ") && why.contains("blocks, above the limit of 24"), "{stderr}");
    assert!(why.contains("--max-memory 100kB has room for"), "{stderr}");
    assert_eq!(work.names(""), ["frame.ply"]);
    let fits = |memory: &String| encode(memory).status() == Some(0);
    let least = (1..40).map(|tenths| format!("{}kB", 100 * tenths)).find(fits).unwrap();
    println!("a tetrahedron takes {least}");
    assert_ne!(least, "100kB");
    work.isv(&["verify", "out.isv", "--max-memory", &least]).done();
}

/// A log on a full disk, or a pipe that nobody reads any more.
#[cfg(target_os = "linux")]
#[test]
fn work_goes_on_where_nobody_hears_of_it() {
    let (work, mut bytes) = Workspace::with_stream(6);
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    work.write("damaged.isv", &bytes);
    let unheard = |args: &[&str]| {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        assert_eq!(work.command(args).stderr(full).status().unwrap().code(), Some(0), "{args:?}");
    };
    unheard(&["decode", "damaged.isv", "-o", "meshes", "--after-loss=hold", "--stats=stats.json"]);
    assert_eq!(work.names("meshes").len(), 6);
    assert!(work.path("stats.json").is_file());
    unheard(&[&ENCODE[..3], &["new.isv", "--voxel=20mm", "--max-depth=3m"]].concat());
    work.isv(&["verify", "new.isv"]).done();
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    assert_eq!(work.command(&["verify", "damaged.isv"]).stderr(full).status().unwrap().code(), Some(1));
}

#[test]
fn depth_cameras_that_cannot_be() {
    let work = Workspace::new();
    fs::create_dir_all(work.path("room/depth")).unwrap();
    let encode = |parts: &[&str]| work.isv(&["encode", "room", "-o", "out.isv"]).fails(1, parts);
    let camera = |width: u32, scale: u32| {
        let json = format!(
            r#"{{"width": {width}, "height": 1, "fx": 9, "fy": 9, "cx": 1, "cy": 0, "fps": 30, "depth_scale_m": 0.001,
            "poses": [[[{scale}, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]]}}"#
        );
        work.write("room/camera.json", json);
    };
    encode(&["room: no depth images here: there is neither rig.json nor depth.txt nor camera.json"]);
    work.write("room/camera.json", "{");
    work.write("room/depth/0.png", png(&[0, 0, 0]));
    encode(&["room/camera.json: "]);
    camera(3, 2);
    encode(&["room/camera.json: frame 0: ", "rotation"]);
    camera(4, 1);
    encode(&["room/depth/0.png: frame 0: ", "3 x 1", "4 x 1"]);
    camera(3, 1);
    encode(&["room/depth/0.png: frame 0: ", "no "]);
    work.write("room/depth/0.png", &png(&[900, 900, 900])[..60]);
    encode(&["room/depth/0.png: frame 0: "]);
    assert_eq!(work.names(""), ["room"]);
}

/// One row of a depth image.
fn png(depths: &[u16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, depths.len() as u32, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = depths.iter().flat_map(|depth| depth.to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

#[test]
fn frames_without_a_common_unit() {
    let work = Workspace::new();
    fs::create_dir(work.path("in")).unwrap();
    work.write("in/a.ply", ply(&VERTICES, &FACES));
    work.write("in/b.ply", ply(&["0 0 0", "100 0 0", "0 100 0", "0 0 100"], &FACES));
    let run = work.isv(&["encode", "in", "-o", "out.isv"]);
    assert_eq!(run.status(), Some(1));
    let stderr = run.stderr();
    // The first frame was good, and its sign had been announced.
    let sentence = stderr.lines().last().unwrap();
    assert!(sentence.starts_with("isv: in/b.ply: this frame is"), "{stderr}");
    assert!(sentence.contains("one common unit") && sentence.contains("--units"), "{sentence}");
    assert_eq!(work.names(""), ["in"]);
}

#[test]
fn too_many_blocks_say_which_voxel_fits() {
    let work = Workspace::with_figure(1);
    let run = work.isv(&["encode", "frames", "-o", "out.isv", "--voxel", "1mm", "--max-blocks", "2000"]);
    run.fails(1, &["frame_0.ply: the surface needs about ", "the limit is 2000", "try --voxel "]);
    assert_eq!(work.names(""), ["frames"]);
    let stderr = run.stderr();
    let voxel = stderr.split("try --voxel ").nth(1).unwrap().split(',').next().unwrap();
    work.isv(&["encode", "frames", "-o", "out.isv", "--voxel", voxel, "--max-blocks", "2000"]).done();
}

#[test]
fn outputs_that_cannot_be_written() {
    let (work, _) = Workspace::with_stream(1);
    let before = work.names("");
    let encode = |output: &str| work.isv(&["encode", "frames", "-o", output, "--voxel", "20mm"]);
    encode("gone/out.isv").fails(1, &["gone/out.isv: cannot write: "]);
    encode("frames").fails(1, &["frames: cannot write: "]);
    work.isv(&[&ENCODE[..], &["--stats", "gone/stats.json"]].concat())
        .fails(1, &["gone/stats.json: cannot write"]);
    work.isv(&["decode", "take.isv", "-o", "gone/out"])
        .fails(1, &["gone/out: cannot make this folder: there is no gone"]);
    work.isv(&["decode", "take.isv", "-o", "gone/out.ply"]).fails(1, &["gone/out.ply: cannot write"]);
    work.isv(&["render", "take.isv", "-o", "gone/out.png"]).fails(1, &["gone/out.png: cannot write"]);
    assert_eq!(work.names(""), before);
}

#[test]
fn statistics_do_not_replace_what_a_command_reads_or_writes() {
    let (work, bytes) = Workspace::with_stream(2);
    let words = "is what the command reads or writes";
    work.isv(&["decode", "take.isv", "-o", "out", "--stats", "./take.isv"]).fails(2, &[words]);
    let encode = ["encode", "frames", "-o", "new.isv", "--voxel=20mm", "--stats"];
    work.isv(&[&encode[..], &["new.isv"]].concat()).fails(2, &[words]);
    work.isv(&[&encode[..], &["-"]].concat()).fails(2, &["--stats", "a file"]);
    assert!(work.read("take.isv") == bytes && !work.path("new.isv").exists() && !work.path("out").exists());
}

#[test]
fn pictures_replace_pictures_alone() {
    let work = Workspace::with_figure(1);
    work.isv(&["render", "frames", "-o", "x.png", "--size", "64"]).done();
    work.isv(&["render", "frames", "-o", "x.png", "--size", "64"]).done();
    work.write("notes.png", "no picture");
    work.isv(&["render", "frames", "-o", "notes.png"]).fails(2, &["notes.png", "is no picture"]);
    assert_eq!(work.read("notes.png"), b"no picture");
}

#[test]
fn colours_that_come_after_the_first_frame_are_told_of() {
    let work = Workspace::with_painted_figure(3);
    let plain = Workspace::with_figure(1).read("frames/frame_0.ply");
    let name = |frame: usize| format!("frames/frame_{frame}.ply");
    work.write(&name(0), plain);
    let run = ["encode", "frames", "-o", "x.isv", "--voxel", "30mm"];
    let said = work.isv(&run).done().stderr();
    let about: Vec<_> = said.lines().filter(|line| line.contains("colours are not kept")).collect();
    assert!(
        about.len() == 1 && about[0].contains("frame_1") && about[0].contains("--expect-colour"),
        "{said}"
    );
    for more in ["--no-colour", "--expect-colour"] {
        let said = work.isv(&[&run[..], &[more]].concat()).done().stderr();
        assert!(!said.contains("colours are not kept"), "{said}");
    }
}

/// The first body among files says what there is. A pipe may be live, and cannot wait for it.
#[test]
fn an_empty_stage_before_the_first_body_says_nothing_of_colours() {
    let work = Workspace::with_painted_figure(3);
    let header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n\
        element face 0\nproperty list uchar int vertex_indices\nend_header\n";
    for frame in 0..2 {
        work.write(&format!("frames/frame_{frame}.ply"), header);
    }
    let has_colour =
        |name: &str| work.isv(&["info", name, "--json"]).json()["bytes_colour"].as_u64().unwrap() > 0;
    let said = work.isv(&["encode", "frames", "-o", "x.isv", "--voxel", "30mm"]).done().stderr();
    assert!(!said.contains("colours are not kept"), "{said}");
    let mut child = work.command(&["encode", "-", "-o", "-", "--voxel", "30mm"]).spawn().unwrap();
    let (mut stdin, stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    stdin.write_all(header.as_bytes()).unwrap();
    // This would wait for ever if the encoder waited for a body.
    let mut packets = isv::raw::format::PacketReader::new(stdout).unwrap();
    assert!(packets.next_frame().unwrap().unwrap().is_keyframe());
    stdin.write_all(&work.read("frames/frame_2.ply")).unwrap();
    drop(stdin);
    let body = packets.next_frame().unwrap().unwrap();
    assert!(body.parts().unwrap().colour.is_some_and(|colour| !colour.is_empty()));
    assert!(child.wait().unwrap().success() && has_colour("x.isv"));
}

#[test]
fn a_body_of_which_nothing_is_left_is_told_of() {
    let work = Workspace::new();
    std::fs::create_dir(work.path("frames")).unwrap();
    for (frame, radius) in [0.03, 0.03, 0.12].into_iter().enumerate() {
        let mesh = isv_testkit::sphere(radius, 16);
        let path = work.path(&format!("frames/frame_{frame}.ply"));
        isv::raw::io::write_mesh(&path, &mesh, isv::raw::io::Format::Ply).unwrap();
    }
    let run = ["encode", "frames", "-o", "x.isv", "--voxel", "20mm", "--quality", "0", "--frames"];
    let said = work.isv(&[&run[..], &["0..3"]].concat()).done().stderr();
    let told = said.lines().filter(|line| line.contains("nothing of its surface is left")).count();
    assert_eq!(told, 2, "{said}");
    let lost = work.isv(&[&run[..], &["0..2"]].concat());
    assert!(
        lost.status() == Some(1) && lost.stderr().contains("no surface in any frame"),
        "{}",
        lost.stderr()
    );
}

#[test]
fn a_title_has_an_end() {
    let work = Workspace::with_figure(1);
    let title = "x".repeat(5000);
    let run = ["encode", "frames", "-o", "x.isv", "--voxel", "20mm", "--title", &title];
    work.isv(&run).fails(2, &["--title: text of at most 4096 bytes"]);
}

#[test]
fn pictures_do_not_replace_what_they_are_of() {
    let (work, bytes) = Workspace::with_stream(1);
    let words = "the pictures would replace what they are of";
    work.isv(&["render", "take.isv", "-o", "./take.isv", "--format", "png"]).fails(2, &[words]);
    let against = ["--against", "take.isv", "--format", "png"];
    work.isv(&[&["render", "frames", "-o", "take.isv"][..], &against].concat()).fails(2, &[words]);
    assert!(work.read("take.isv") == bytes);
}

#[test]
fn something_else_than_a_stream() {
    let (work, bytes) = Workspace::with_stream(1);
    work.write("not.isv", ply(&VERTICES, &FACES));
    work.write("empty.isv", "");
    work.write("head.isv", &bytes[..20]);
    for command in [&["info"][..], &["verify"], &["decode", "-o", "out"], &["render", "-o", "out.png"]] {
        let run = |name: &str| work.isv(&[command, &[name]].concat());
        run("not.isv").fails(1, &["not.isv: not an .isv stream"]);
        run("empty.isv").fails(1, &["empty.isv: cut off at byte 0, inside the stream header"]);
        run("head.isv").fails(1, &["head.isv: cut off at byte 20, inside the stream header"]);
    }
    work.isv(&["verify", "frames"]).fails(1, &["frames: a folder, where an .isv file should be"]);
    assert!(!work.path("out").exists() && !work.path("out.png").exists());
}

#[test]
fn a_newer_version() {
    let (work, mut bytes) = Workspace::with_stream(1);
    bytes[8] = 200;
    work.write("new.isv", bytes);
    work.isv(&["info", "new.isv"])
        .fails(1, &["new.isv: format version 200, but this build reads versions 1 to 2"]);
    work.isv(&["decode", "new.isv", "-o", "out"]).fails(1, &["new.isv: format version 200"]);
}

/// Beginning of each packet of a stream, and its size.
fn packets(work: &Workspace) -> Vec<(usize, usize)> {
    let info = work.isv(&["info", "take.isv", "--json"]).json();
    let sizes = info["packets"].as_array().unwrap().iter().map(|p| p["bytes"].as_u64().unwrap() as usize);
    let mut end = 48;
    let place = |size| {
        end += size;
        (end - size, size)
    };
    sizes.map(place).collect()
}

#[test]
fn a_stream_cut_inside_a_packet() {
    let (work, bytes) = Workspace::with_stream(3);
    let cut = packets(&work)[2].0 + 100;
    work.write("cut.isv", &bytes[..cut]);
    let place = format!("cut.isv: cut off at byte {cut}, inside a packet");
    work.isv(&["verify", "cut.isv"]).fails(1, &[&place, "--frames 0..2"]);
    work.isv(&["decode", "cut.isv", "-o", "out"]).fails(1, &[&place, "2 frames before this went to out"]);
    assert_eq!(work.names("out"), ["frame_0000.ply", "frame_0001.ply"]);
    work.isv(&["decode", "cut.isv", "-o", "saved", "--frames", "0..2"]).done();
    let info = work.isv(&["info", "cut.isv", "--json"]).json();
    assert_eq!((&info["frames"], &info["complete"]), (&2.into(), &false.into()));
}

#[test]
fn a_stream_cut_between_packets() {
    let (work, bytes) = Workspace::with_stream(3);
    work.write("cut.isv", &bytes[..packets(&work)[2].0]);
    work.isv(&["verify", "cut.isv"]).fails(1, &["cut.isv: ends without an index", "--frames 0..2"]);
    let run = work.isv(&["decode", "cut.isv", "-o", "out"]).done();
    assert!(run.stderr().contains("cut.isv: ends without an index"), "{}", run.stderr());
    assert_eq!(work.names("out").len(), 2);
}

#[test]
fn a_flipped_bit() {
    let (work, mut bytes) = Workspace::with_stream(3);
    let (at, size) = packets(&work)[1];
    bytes[at + size / 2] ^= 1;
    work.write("bad.isv", &bytes);
    let place = format!("bad.isv: damaged: checksum of the packet at byte {at} does not match");
    work.isv(&["verify", "bad.isv"]).fails(1, &[&place]);
    work.isv(&["info", "bad.isv"]).fails(1, &[&place, "isv repair keeps what is sound"]);
    work.isv(&["decode", "bad.isv", "-o", "out"]).fails(1, &[&place, "1 frame before this went to out"]);
    work.isv(&["decode", "bad.isv", "-o", "one.ply", "--frames", "1..2"]).fails(1, &[&place]);
    let one = ["decode", "-", "-o", "-", "--format", "obj"];
    work.isv_with_input(&one, &bytes).fails(1, &["standard input: damaged: "]);
    assert!(!work.path("one.ply").exists());
}

#[test]
fn a_frame_that_needs_more_memory_than_there_is() {
    let (work, _) = Workspace::with_stream(2);
    let decode = |size: &str| work.isv(&["decode", "take.isv", "-o", "out", "--max-memory", size]);
    decode("100kB").fails(1, &["take.isv", "blocks, above the limit", "--max-memory 100kB has room for"]);
    decode("1GiB").done();
    for command in ["verify", "eval", "render"] {
        let more: &[&str] = match command {
            "eval" => &["take.isv"],
            "render" => &["-o", "a.png"],
            _ => &[],
        };
        let args = [&[command, "take.isv"], more, &["--max-memory=100kB"]].concat();
        work.isv(&args).fails(1, &["--max-memory 100kB has room for"]);
    }
    decode("much").fails(2, &["500MB or 2GiB"]);
}

#[test]
fn a_hash_that_does_not_match() {
    let (work, bytes) = Workspace::with_stream(3);
    let mut reader = PacketReader::new(&bytes[..]).unwrap();
    let header = *reader.header();
    let mut writer = PacketWriter::new(Vec::new(), &header).unwrap();
    for frame in 0..3 {
        let packet = reader.next_frame().unwrap().unwrap();
        let at = packet.payload_at();
        let mut payload = FramePayload::parse(&packet.payload, at, true, &header.profile).unwrap();
        if frame == 1 {
            payload.header.volume_hash = Some(7);
        }
        writer.write_frame(packet.is_keyframe(), packet.header.timestamp_ns, &payload).unwrap();
    }
    work.write("other.isv", writer.finish().unwrap());
    let sentence = "but the stream says 0000000000000007";
    work.isv(&["verify", "other.isv"]).fails(1, &["other.isv: frame 1: ", sentence, "--frames 0..1"]);
}

#[test]
fn frames_that_are_not_there() {
    let (work, bytes) = Workspace::with_stream(2);
    let before = work.names("");
    let sentence = "frames 1..3 asked for, but there are 2 (0..2)";
    work.isv(&["encode", "frames", "-o", "out.isv", "--frames", "1..3"]).fails(1, &["frames: ", sentence]);
    work.isv(&["decode", "take.isv", "-o", "out", "--frames", "1..3"]).fails(1, &["take.isv: ", sentence]);
    work.isv(&["render", "take.isv", "-o", "out.png", "--frame", "2"]).fails(1, &["take.isv: frames 2..3"]);
    work.isv(&["eval", "frames", "take.isv", "--frames", "1..3"]).fails(1, &["frames: ", sentence]);
    assert_eq!(work.names(""), before);
    let piped = work.isv_with_input(&["decode", "-", "-o", "out", "--frames", "1..3"], &bytes);
    piped.fails(1, &["standard input: ", sentence, "1 frame before this went to out"]);
    work.isv(&["decode", "take.isv", "-o", "out", "--frames", "2..2"]).fails(2, &["--frames", "no frame"]);
    work.isv(&["decode", "take.isv", "-o", "out", "--frames", "2"]).fails(2, &["--frames", "A..B"]);
}

#[test]
fn many_frames_where_one_fits() {
    let (work, _) = Workspace::with_stream(2);
    work.isv(&["decode", "take.isv", "-o", "one.ply"]).fails(1, &["one.ply: takes one frame", "--frames"]);
    work.isv(&["decode", "take.isv", "-o", "-", "--format", "obj"]).fails(1, &["-: takes one frame"]);
    assert!(!work.path("one.ply").exists());
}

#[test]
fn sequences_of_different_length() {
    let (work, _) = Workspace::with_stream(3);
    work.isv(&["decode", "take.isv", "-o", "two", "--frames", "0..2"]).done();
    let run = work.isv(&["eval", "frames", "two"]);
    run.fails(1, &["two has 2 frames but frames has 3", "--frames"]);
    work.isv(&["eval", "frames", "two", "--frames", "1..3"]).done();
}

#[test]
fn wrong_command_lines() {
    let work = Workspace::with_figure(1);
    let encode = |more: &[&str]| work.isv(&[&["encode", "frames", "-o", "out.isv"], more].concat());
    encode(&["--voxel", "5"]).fails(2, &["--voxel", "a length needs a unit"]);
    encode(&["--voxel", "2km"]).fails(2, &["--voxel", "unit `km`"]);
    let paper = |more: &[&str]| encode(&[&["--profile", "paper"], more].concat());
    paper(&["--voxel", "0.1mm", "--ac-step", "1m"]).fails(2, &["--ac-step 1000mm: at voxels of 0.1mm"]);
    encode(&["--voxel", "5000m"]).fails(2, &["--voxel 5000000mm: voxel size 5000 m is outside"]);
    paper(&["--block", "5"]).fails(2, &["--block: block edge 5"]);
    encode(&["--truncation", "99"]).fails(2, &["--truncation: truncation of 99"]);
    paper(&["--coefficients", "513"]).fails(2, &["--coefficients 513: a block of 8^3 voxels has 1 to 512"]);
    encode(&["--offset", "9"]).fails(2, &["--offset 9: "]);
    encode(&["--gop", "0"]).fails(2, &["--gop", "a whole number above 0"]);
    encode(&["--fps", "0"]).fails(2, &["--fps", "30000/1001"]);
    let main = |more: &[&str]| encode(&[&["--profile", "main"], more].concat());
    for knob in [["--motion", "3dof"], ["--coefficients", "64"], ["--dc-step", "1mm"], ["--ac-step", "9mm"]] {
        main(&knob)
            .fails(2, &[&format!("{}: this is a setting of profile paper, not of profile main", knob[0])]);
    }
    main(&["--block", "16"]).fails(2, &["--block 16: profile main has blocks of 8^3 voxels"]);
    encode(&["--motion", "3dof"]).fails(2, &["--motion: ", "add --profile paper"]);
    paper(&["--bitrate", "1M"]).fails(2, &["--bitrate: this is a setting of profile main"]);
    encode(&["--quality", "50", "--max-error", "1mm"]).fails(2, &["--quality and --max-error: only one"]);
    encode(&["--quality", "101"]).fails(2, &["--quality", "a number from 0 to 100"]);
    encode(&["--bitrate", "2"]).fails(2, &["--bitrate", "as in 800k or 2M"]);
    encode(&["--max-error", "1"]).fails(2, &["--max-error", "a length needs a unit"]);
    encode(&["--passes", "2"]).fails(2, &["--passes needs --bitrate"]);
    encode(&["--preset", "slow"]).fails(2, &["slow", "archive"]);
    encode(&["--motion", "4dof"]).fails(2, &["4dof", "6dof"]);
    encode(&["--units", "furlong"]).fails(2, &["unit `furlong` is not one of"]);
    encode(&["--threads", "100000"]).fails(2, &["--threads 100000: at most 256"]);
    encode(&["--origin", "1,2"]).fails(2, &["--origin", "three numbers"]);
    encode(&["--no-such-flag"]).fails(2, &["--no-such-flag", "--help"]);
    work.isv(&["encode", "frames"]).fails(2, &["--output"]);
    // As a shell has it where the pattern was not in quotes.
    work.isv(&["encode", "frames/frame_0.ply", "frames/frame_0.ply", "-o", "out.isv"])
        .fails(2, &["frames/frame_0.ply: one input too many", "in quotes"]);
    work.isv(&["transcode"]).fails(2, &["transcode"]);
    work.isv(&["decode", "a.isv", "-o", "a.obj", "--format", "ply"]).fails(2, &["--format ply", "a.obj"]);
    let decode = |more: &[&str]| work.isv(&[&["decode", "a.isv", "-o", "a"], more].concat());
    decode(&["--format", "las"])
        .fails(2, &["`las` is not one of ply, obj, stl, glb, usda, usdc (meshes), ply, pcd, xyz"]);
    decode(&["--as", "points", "--format", "stl"])
        .fails(2, &["stl files are not written of points: use one of ply"]);
    decode(&["--as", "mesh", "--points", "9"]).fails(2, &["--points and --spacing need --as points"]);
    decode(&["--lod", "3"]).fails(2, &["--lod", "1, 2, 4"]);
    let many = ["render", "frames", "-o", "out.png", "--turntable", "9", "--size", "8000"];
    work.isv(&many).fails(2, &["9 pictures of 8000 x 8000 pixels are too many"]);
    assert_eq!(work.isv(&[]).status(), Some(2));
    assert_eq!(work.names(""), ["frames"]);
}

#[test]
fn a_reader_that_goes_away_is_no_news() {
    let work = Workspace::with_figure(3);
    let mut child = work.command(&["encode", "frames", "-o", "-", "--voxel", "20mm"]).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(!String::from_utf8_lossy(&output.stderr).contains("isv: "));
}
