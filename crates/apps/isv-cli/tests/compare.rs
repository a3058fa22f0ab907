//! `isv compare` on the project's own figure: what it writes, going on after an interruption, what it leaves out.

mod support;

use isv_testkit::{Need, capture, skip};
use std::fs;
use support::Workspace;

/// A quick study into the folder `study`.
const COMPARE: [&str; 9] = [
    "compare",
    "frames",
    "-o",
    "study",
    "--voxel=20mm",
    "--spacing=20mm",
    "--points=2",
    "--fps=10",
    "--threads=2",
];

fn compare<'a>(codecs: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&COMPARE, &["--codecs", codecs][..], more].concat()
}

/// Names of the codecs and points in the table of results.
fn rows(workspace: &Workspace) -> Vec<String> {
    let table = String::from_utf8(workspace.read("study/results.csv")).unwrap();
    table.lines().skip(1).map(|line| line.split(',').take(2).collect::<Vec<_>>().join(" ")).collect()
}

#[test]
fn a_study_leaves_a_page_tables_and_streams() {
    let workspace = Workspace::with_figure(2);
    let run = workspace.isv(&compare("paper-3dof,paper-intra", &[])).done();
    let said = String::from_utf8(run.stdout().to_vec()).unwrap();
    assert!(said.contains("paper-3dof") && said.contains("study/index.html"), "{said}");
    // In the order of the command line.
    let expected = [
        "paper-3dof k64-ac10mm",
        "paper-3dof k64-ac160mm",
        "paper-intra k64-ac10mm",
        "paper-intra k64-ac160mm",
    ];
    assert_eq!(rows(&workspace), expected);
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && page.contains("paper-3dof"));
    workspace.isv(&["verify", "study/points/paper-3dof/k64-ac10mm.isv"]).done();
    assert!(workspace.names("study/charts").contains(&"p2s_mean_mm.svg".to_owned()));
}

#[test]
fn colour_is_compared_and_shown_side_by_side() {
    let workspace = Workspace::with_painted_figure(3);
    let run = workspace.isv(&compare("main-realtime,paper-zero", &["--yaw=-20"])).done();
    let said = String::from_utf8(run.stdout().to_vec()).unwrap();
    assert!(said.contains("colour Y dB is the PSNR") && said.contains("study/sheet.png"), "{said}");
    assert!(workspace.read("study/sheet.png").starts_with(b"\x89PNG"));
    for chart in ["colour_y_psnr_db.svg", "render_y_psnr_db.svg"] {
        assert!(workspace.names("study/charts").contains(&chart.to_owned()), "{chart}");
    }
    let table = String::from_utf8(workspace.read("study/results.csv")).unwrap();
    let column = table.lines().next().unwrap().split(',').position(|name| name == "bytes_colour").unwrap();
    let colour = |codec: &str| {
        let row = table.lines().find(|line| line.starts_with(codec)).unwrap();
        row.split(',').nth(column).unwrap().parse::<f64>().unwrap()
    };
    assert!(colour("main-realtime") > 0.0 && colour("paper-zero") == 0.0, "{table}");
    // The stream of a point is one with colour, as isv encode makes it.
    let streams = workspace.names("study/points/main-realtime");
    let stream = streams.iter().find(|name| name.ends_with(".isv")).unwrap();
    let info = workspace.isv(&["info", &format!("study/points/main-realtime/{stream}")]).done();
    assert!(String::from_utf8_lossy(info.stdout()).contains("colour       2 layers"));
}

#[test]
fn a_study_without_colour_says_so() {
    let workspace = Workspace::with_figure(1);
    let run = workspace.isv(&compare("main-realtime", &[])).done();
    let said = String::from_utf8_lossy(run.stdout()).into_owned();
    assert!(said.contains("No colour was compared: the frames have none."), "{said}");
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    assert!(page.contains("There is no colour to compare"));
    assert!(workspace.read("study/sheet.png").starts_with(b"\x89PNG"));

    let workspace = Workspace::with_painted_figure(1);
    let run = workspace.isv(&compare("paper-zero", &[])).done();
    let said = String::from_utf8_lossy(run.stdout()).into_owned();
    assert!(said.contains("the frames have colour, but none of these codecs keeps it"), "{said}");
}

/// Whether the programs of `draco-video` are there; says so plainly if not.
fn has_draco_and_video() -> bool {
    let tools = isv_study::Tools::default();
    let missing = [(Need::Draco, "draco_encoder"), (Need::Draco, "draco_decoder"), (Need::Media, "ffmpeg")];
    let missing = missing.into_iter().find(|(_, name)| tools.find(name).is_none());
    if let Some((need, name)) = missing {
        skip(need, format!("{name} is not installed"));
    }
    missing.is_none()
}

#[test]
fn meshes_with_texture_video_are_compared_and_shown() {
    let Some(take) = capture("liam_textured") else { return };
    if !has_draco_and_video() {
        return;
    }
    let workspace = Workspace::with_painted_figure(1);
    let take = take.to_str().unwrap().to_owned();
    let mut arguments = compare("draco-video,draco-video-25", &["--frames=10..12"]);
    arguments[1] = &take;
    workspace.isv(&arguments).done();
    let table = String::from_utf8(workspace.read("study/results.csv")).unwrap();
    let names: Vec<_> = table.lines().next().unwrap().split(',').collect();
    let column = |row: &str, name: &str| -> f64 {
        let place = names.iter().position(|n| *n == name).unwrap();
        row.split(',').nth(place).unwrap().parse().unwrap()
    };
    let rows: Vec<_> = table.lines().skip(1).collect();
    assert_eq!(rows.len(), 4, "{table}");
    for name in ["bytes", "mbps_colour", "colour_y_psnr_db", "colour_encode_ms"] {
        assert!(rows.iter().all(|row| column(row, name) > 0.0), "{name}: {table}");
    }
    // Finer points have more bits and less error; a quarter of the faces takes less than half of the geometry's bytes.
    let [fine, coarse, quarter, _] = rows[..] else { unreachable!() };
    for name in ["mbps_geometry", "mbps_colour", "colour_y_psnr_db", "render_y_psnr_db"] {
        assert!(column(fine, name) > column(coarse, name), "{name}: {table}");
    }
    assert!(column(fine, "colour_y_psnr_db") > 38.0, "{table}");
    assert!(column(quarter, "mbps_geometry") < 0.5 * column(fine, "mbps_geometry"), "{table}");
    assert!(column(quarter, "colour_y_psnr_db") > 30.0, "{table}");
    let kept = workspace.names("study/points/draco-video");
    assert_eq!(kept.iter().filter(|name| name.ends_with(".glb")).count(), 4, "{kept:?}");
    assert!(workspace.read("study/sheet.png").starts_with(b"\x89PNG"));
}

#[test]
fn a_capture_without_a_texture_is_noted() {
    if !has_draco_and_video() {
        return;
    }
    let workspace = Workspace::with_painted_figure(1);
    let output = workspace.command(&compare("paper-zero,draco-video", &[])).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert!(stderr.contains("frame 0: it has no texture, or several"), "{stderr}");
    assert_eq!(rows(&workspace).len(), 2);
}

#[test]
fn a_study_goes_on_where_it_stopped() {
    let workspace = Workspace::with_figure(2);
    // What is of all commands may come before the command's name.
    workspace.isv(&[&["--simd=auto", "--max-memory=1GiB"], &compare("paper-zero", &[])[..]].concat()).done();
    let [kept, gone] =
        ["k64-ac10mm", "k64-ac160mm"].map(|p| workspace.path(&format!("study/points/paper-zero/{p}.json")));
    let time = |path| fs::metadata(path).unwrap().modified().unwrap();
    let before = time(&kept);
    fs::remove_file(&gone).unwrap();
    workspace.isv(&compare("paper-zero", &[])).done();
    assert_eq!(time(&kept), before, "what was measured is not measured again");
    assert!(gone.is_file());
    assert_eq!(rows(&workspace).len(), 2);

    // Other settings are another study.
    workspace.isv(&compare("paper-zero", &["--gop=1"])).done();
    assert!(time(&kept) > before);
    // So are other frames.
    let after = time(&kept);
    fs::copy(workspace.path("frames/frame_0.ply"), workspace.path("frames/frame_1.ply")).unwrap();
    workspace.isv(&compare("paper-zero", &["--gop=1"])).done();
    assert!(time(&kept) > after);
}

#[test]
fn a_missing_draco_is_left_out_with_a_note() {
    let workspace = Workspace::with_figure(1);
    let without_programs = |codecs| {
        let mut command = workspace.command(&compare(codecs, &[]));
        command.env("PATH", "").output().unwrap()
    };
    let output = without_programs("paper-zero,draco,draco-25");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{stderr}");
    assert!(
        stderr.contains("draco-25 at 9-bit: draco_encoder and draco_decoder are not both installed"),
        "{stderr}"
    );
    assert!(rows(&workspace).iter().all(|row| row.starts_with("paper-zero")));
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    assert!(page.contains("not both installed"));

    let output = without_programs("draco");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr.ends_with("isv: frames: no codec could be measured\n"), "{stderr}");
}

#[test]
fn a_codec_that_loses_the_surface_is_left_out_with_a_note() {
    let workspace = Workspace::new();
    fs::create_dir(workspace.path("frames")).unwrap();
    // A sheet has no inside: told that it is closed, isv finds no surface.
    let sheet = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
    workspace.write("frames/a.off", sheet);
    let run = workspace.isv(&compare("paper-zero", &["--sign=closed"]));
    assert_eq!(run.status(), Some(1));
    let stderr = run.stderr();
    assert!(stderr.contains("paper-zero at k64-ac10mm: frame 0: "), "{stderr}");
    assert!(stderr.ends_with("isv: frames: no codec could be measured\n"), "{stderr}");
    // As a shell it has one, of which a reader must know.
    let run = workspace.isv(&compare("paper-zero", &["--sign=offset"])).done();
    assert!(run.stderr().contains("a shell 30mm away from it on both sides"), "{}", run.stderr());
}

#[test]
fn what_cannot_be_studied_is_refused_in_one_sentence() {
    let workspace = Workspace::with_figure(1);
    workspace.isv(&compare("paper-4dof", &[])).fails(2, &["\"paper-4dof\"", "paper-3dof"]);
    workspace.isv(&compare("paper-zero", &["--picture=1"])).fails(2, &["--picture 1", "0..1"]);
    workspace.isv(&compare("paper-zero", &["--frames=0..4"])).fails(1, &["frames", "0..4"]);
    workspace.isv(&compare("paper-zero", &["--voxel=20m"])).fails(2, &["--voxel"]);
    workspace.isv(&compare("tang-cross", &["--train=nowhere"])).fails(1, &["nowhere"]);
    workspace.isv(&compare("tang-cross", &["--train=frames"])).fails(2, &["--train frames", "tang-scene"]);
    workspace.isv(&["compare", "nothing", "-o", "study"]).fails(1, &["nothing"]);
    workspace.write("file", "");
    workspace.isv(&["compare", "frames", "-o", "file"]).fails(1, &["file", "folder"]);
    fs::create_dir(workspace.path("study")).unwrap();
    workspace.write("study/index.html", "my own");
    workspace.isv(&compare("paper-zero", &[])).fails(2, &["study/index.html", "no study", "not overwritten"]);
    assert_eq!(workspace.read("study/index.html"), b"my own");
    fs::remove_dir_all(workspace.path("study")).unwrap();

    let run = workspace.isv(&compare("tang-cross", &[]));
    assert_eq!(run.status(), Some(1));
    assert!(run.stderr().contains("a transform trained on other takes needs some"), "{}", run.stderr());
}

#[test]
fn a_take_may_be_called_anything() {
    let workspace = Workspace::with_figure(1);
    fs::rename(workspace.path("frames"), workspace.path("-a <b> \"c\" é")).unwrap();
    let words =
        ["compare", "-o", "study", "--voxel=40mm", "--spacing=40mm", "--points=1", "--codecs=paper-zero"];
    workspace.isv(&[&words[..], &["--", "-a <b> \"c\" é"]].concat()).done();
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    assert!(page.contains("-a &lt;b&gt; &quot;c&quot; é"));
}

/// Draco gives a cube back as it was. An error of nothing has no place on a logarithmic axis, and Draco tells
/// no kinds of bits.
#[test]
fn a_perfect_copy_is_a_result_like_any_other() {
    let workspace = Workspace::new();
    let cube = "OFF\n8 12 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n3 0 2 1\n3 0 3 2\n3 4 5 6\n3 4 6 7\n\
                3 0 1 5\n3 0 5 4\n3 1 2 6\n3 1 6 5\n3 2 3 7\n3 2 7 6\n3 3 0 4\n3 3 4 7\n";
    workspace.write("cube.off", cube);
    let run = workspace.isv(&[
        "compare",
        "cube.off",
        "-o",
        "study",
        "--voxel=10cm",
        "--spacing=10cm",
        "--codecs=draco",
    ]);
    if run.stderr().contains("not both installed") {
        return skip(Need::Draco, "draco_encoder is not installed");
    }
    run.done();
    assert!(!workspace.names("study/charts").contains(&"kinds.svg".to_owned()));
    assert!(workspace.path("study/index.html").is_file());
}

/// The figure to reach: against intra-coding, motion saves on a person who moves.
#[test]
fn a_real_capture_is_studied() {
    let Some(folder) = capture("thomas") else { return };
    let workspace = Workspace::new();
    let folder = folder.to_str().unwrap();
    let codecs = "--codecs=paper-intra,paper-3dof,tang-scene,draco-25";
    workspace
        .isv(&[
            "compare",
            folder,
            "-o",
            "study",
            codecs,
            "--frames=0..2",
            "--points=2",
            "--voxel=10mm",
            "--spacing=10mm",
        ])
        .done();
    let deltas = String::from_utf8(workspace.read("study/bd_rates.csv")).unwrap();
    let saving = deltas.lines().find(|line| line.starts_with("p2s_mean_mm,paper-intra,paper-3dof,")).unwrap();
    let percent: f64 = saving.split(',').nth(3).unwrap().parse().unwrap();
    println!("3-DoF against intra, two frames of thomas: {percent} %");
    assert!(percent < -10.0, "{saving}");
}

/// A program that is a shell script.
#[cfg(unix)]
fn write_program(workspace: &Workspace, name: &str, script: &str) {
    use std::os::unix::fs::PermissionsExt;
    workspace.write(name, format!("#!/bin/sh\n{script}\n"));
    fs::set_permissions(workspace.path(name), fs::Permissions::from_mode(0o755)).unwrap();
}

/// A stand-in for `tmc3` that says its version and then does what a script says.
#[cfg(unix)]
fn write_stand_in(workspace: &Workspace, name: &str, script: &str) {
    let version = "case $1 in --help) echo MPEG PCC tmc3 version release-v99.0; exit;; esac";
    write_program(workspace, name, &format!("{version}\n{script}"));
}

/// Shell words that write a number as four bytes, the highest first.
#[cfg(unix)]
const FOUR_BYTES: &str =
    "four_bytes() { for s in 24 16 8 0; do printf \"\\\\$(printf %03o $(($1 >> s & 255)))\"; done; }";

/// A stand-in for `tmc3` that gives points back as they came, in one unit of a type: 2 is geometry, 4 attributes.
#[cfg(unix)]
fn write_keeper(workspace: &Workspace, unit: u8) {
    let encode =
        format!("{{ printf '\\00{unit}'; four_bytes $(wc -c <points.ply); cat points.ply; }} >points.bin");
    let decode = "tail -c +6 points.bin >decoded.ply";
    let script = format!("{FOUR_BYTES}\ncase $1 in --mode=0) {encode};; *) {decode};; esac");
    write_stand_in(workspace, "tmc3", &script);
}

/// Stand-ins for the programs of TMC2 that give the frames of a take back as they came, in one unit of attributes.
#[cfg(unix)]
fn write_take_keeper(workspace: &Workspace) {
    let encode = "echo PccAppEncoder v24.0; [ -f points_0000.ply ] || exit 0\n\
                  tar cf take.tar points_*.ply\n\
                  { printf '\\140'; four_bytes $(($(wc -c <take.tar) + 1)); printf '\\040'; cat take.tar; } >take.bin";
    let decode = "tail -c +7 take.bin | tar xf -; for f in points_*.ply; do mv $f decoded_${f#points_}; done";
    write_program(workspace, "PccAppEncoder", &format!("{FOUR_BYTES}\n{encode}"));
    write_program(workspace, "PccAppDecoder", decode);
    fs::create_dir_all(workspace.path("cfg/common")).unwrap();
    workspace.write("cfg/common/ctc-common.cfg", "");
}

#[cfg(unix)]
#[test]
fn codecs_of_points_are_compared_and_shown_in_colour() {
    let workspace = Workspace::with_painted_figure(1);
    write_keeper(&workspace, 4);
    write_take_keeper(&workspace);
    let tools =
        ["--tool=tmc3=tmc3", "--tool=PccAppEncoder=PccAppEncoder", "--tool=PccAppDecoder=PccAppDecoder"];
    // Coarse: points of fine codecs are many.
    let coarse = |codecs, tools: &[&'static str]| {
        let arguments: Vec<_> = compare(codecs, tools);
        arguments
            .into_iter()
            .map(|a| if a == "--voxel=20mm" { "--voxel=120mm" } else { a })
            .collect::<Vec<_>>()
    };
    let run = workspace.isv(&coarse("main-realtime,tmc13-octree,tmc2", &tools)).done();
    assert!(String::from_utf8_lossy(run.stdout()).contains("study/sheet.png"), "{}", run.stderr());
    let table = String::from_utf8(workspace.read("study/results.csv")).unwrap();
    let columns: Vec<_> = table.lines().next().unwrap().split(',').collect();
    for codec in ["tmc13-octree", "tmc2"] {
        let row: Vec<_> = table.lines().find(|line| line.starts_with(codec)).unwrap().split(',').collect();
        let cell =
            |name| row[columns.iter().position(|column| *column == name).unwrap()].parse::<f64>().unwrap();
        // All bytes but those of a few headers are of the unit of attributes.
        assert!(cell("mbps_colour") > 0.9 * cell("mbps"), "{table}");
        assert!(cell("colour_y_psnr_db") > 25.0 && cell("render_y_psnr_db") > 15.0, "{table}");
        let frames = workspace.names(&format!("study/points/{codec}"));
        assert!(frames.iter().any(|name| name.ends_with("-frame0.ply")), "{frames:?}");
    }
    for sheet in ["study/sheet.png", "study/sheet_error.png"] {
        assert!(workspace.read(sheet).starts_with(b"\x89PNG"), "{sheet}");
    }
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    assert!(page.contains("At the same rate, near") && page.contains("At the same error, near"));
    // Frames that an earlier study of the same points has left are not shown again.
    let without = Workspace::with_figure(1);
    fs::remove_dir_all(workspace.path("frames")).unwrap();
    fs::rename(without.path("frames"), workspace.path("frames")).unwrap();
    workspace.isv(&coarse("main-realtime,tmc13-octree", &tools[..1])).done();
    let frames = workspace.names("study/points/tmc13-octree");
    let kept: Vec<_> = frames.iter().filter(|name| name.contains("-frame")).collect();
    assert!(!kept.is_empty(), "{frames:?}");
    for name in kept {
        let file = workspace.read(&format!("study/points/tmc13-octree/{name}"));
        assert!(!String::from_utf8_lossy(&file).contains("property uchar red"), "{name}");
    }
}

/// Points that come back as they went in.
#[cfg(unix)]
#[test]
fn programs_of_others_are_named_with_version_and_command_line() {
    let workspace = Workspace::with_figure(2);
    write_keeper(&workspace, 2);
    let run = workspace.isv(&compare("paper-zero,tmc13-octree", &["--tool=tmc3=tmc3"])).done();
    let said = String::from_utf8_lossy(run.stdout()).into_owned();
    assert!(said.contains("tmc13-octree"), "{said}");
    assert_eq!(rows(&workspace).len(), 4);
    let programs = String::from_utf8(workspace.read("study/programs.csv")).unwrap();
    assert!(programs.contains("tmc13-octree,9-bit,release-v99.0,\"tmc3 --mode=0 "), "{programs}");
    // Points have one direction of distance alone.
    let table = String::from_utf8(workspace.read("study/results.csv")).unwrap();
    let columns: Vec<_> = table.lines().next().unwrap().split(',').collect();
    let row: Vec<_> = table.lines().find(|line| line.starts_with("tmc13")).unwrap().split(',').collect();
    let cell = |name| row[columns.iter().position(|column| *column == name).unwrap()];
    assert!(cell("p2s_mean_mm").is_empty() && cell("area_ratio").is_empty(), "{table}");
    assert!(cell("test_to_ref_mean_mm").parse::<f64>().unwrap() > 0.0, "{table}");
    assert!(!cell("d2_psnr_db").is_empty(), "{table}");
    let page = String::from_utf8(workspace.read("study/index.html")).unwrap();
    for words in [
        "tmc3 is version release-v99.0; isv's settings are tested with 23.0",
        "programs.csv",
        "Decoded points to source",
    ] {
        assert!(page.contains(words), "{words}");
    }
}

#[cfg(unix)]
#[test]
fn programs_of_others_that_misbehave_are_notes() {
    let workspace = Workspace::with_figure(1);
    write_stand_in(&workspace, "crash", "echo too many points; kill -SEGV $$");
    write_stand_in(&workspace, "hang", "exec sleep 600");
    write_stand_in(&workspace, "noise", "echo noise > points.bin");
    write_stand_in(
        &workspace,
        "unreadable",
        "printf '\\002\\0\\0\\0\\0' > points.bin; echo noise > decoded.ply",
    );
    workspace.write("other", "#!/bin/sh\necho usage: other FILE\n");
    fs::copy(workspace.path("other"), workspace.path("none")).unwrap();
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(workspace.path("other"), fs::Permissions::from_mode(0o755)).unwrap();
    for (program, words) in [
        ("crash", "too many points"),
        ("hang", "was ended as it took more than 1 s"),
        ("noise", "its output is not a stream of G-PCC"),
        ("unreadable", "its output cannot be read"),
        ("other", "does not call itself \"MPEG PCC tmc3 version\""),
    ] {
        let tool = format!("--tool=tmc3={program}");
        let more = [&tool[..], "--tool-limit=1"];
        let run = workspace.isv(&compare("paper-zero,tmc13-octree", &more)).done();
        assert!(
            run.stderr().contains("tmc13-octree at 9-bit: ") && run.stderr().contains(words),
            "{}",
            run.stderr()
        );
        assert!(rows(&workspace).iter().all(|row| row.starts_with("paper-zero")));
    }
    workspace
        .isv(&compare("tmc13-octree", &["--tool=tmc3=none"]))
        .fails(2, &["none", "not an executable file"]);
    workspace.isv(&compare("tmc13-octree", &["--tool=tmc9=other"])).fails(2, &["\"tmc9\"", "tmc3"]);
    workspace.isv(&compare("tmc13-octree", &["--tool=tmc3"])).fails(2, &["--tool"]);
}
