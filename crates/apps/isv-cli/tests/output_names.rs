//! Names of outputs: what is no file that isv writes is refused before any work, and nothing is left under that name.

mod support;

use support::Workspace;

/// Endings of files of other programs, some of which isv reads.
const FOREIGN: [&str; 13] =
    ["usdz", "abc", "fbx", "mp4", "drc", "npz", "dae", "blend", "jpg", "MOV", "3mf", "tar.gz", "ply.zst"];

#[test]
fn decode_makes_no_folder_that_is_named_like_a_file() {
    let (work, _) = Workspace::with_stream(1);
    let before = work.names("");
    for ending in FOREIGN {
        for more in [&[][..], &["--as=points"], &["--as=volume"], &["--format=ply"]] {
            let name = format!("a.{ending}");
            let run = work.isv(&[&["decode", "take.isv", "-o", &name], more].concat());
            run.fails(
                2,
                &[
                    &format!("{name}: isv does not write"),
                    "ply, obj, stl, glb, usda, usdc (meshes)",
                    "a folder",
                ],
            );
        }
    }
    for name in ["a.gltf", "a.off", "a.las", "a.e57"] {
        work.isv(&["decode", "take.isv", "-o", name]).fails(2, &[name, "use one of ply, obj, stl, glb"]);
    }
    work.isv(&["decode", "take.isv", "-o", "a.npy"]).fails(2, &["a.npy: ", "name a folder"]);
    // What is wrong with the stream is said later.
    work.isv(&["decode", "gone.isv", "-o", "a.usdz"]).fails(2, &["a.usdz"]);
    assert_eq!(work.names(""), before);
}

#[test]
fn a_folder_may_have_a_dot_in_its_name() {
    let (work, _) = Workspace::with_stream(1);
    std::fs::create_dir(work.path("there.usd")).unwrap();
    for folder in ["take.v2", "2024.01.05", "new.fbx/", "there.usd", "out.obj/"] {
        work.isv(&["decode", "take.isv", "-o", folder]).done();
        assert_eq!(work.names(folder), ["frame_0000.ply"], "{folder}");
    }
}

#[test]
fn streams_are_not_written_under_the_names_of_other_files() {
    let (work, bytes) = Workspace::with_stream(3);
    let before = work.names("");
    let commands: [&[&str]; 4] = [
        &["encode", "frames", "--voxel=20mm"],
        &["cut", "take.isv", "0..3"],
        &["join", "take.isv", "take.isv"],
        &["repair", "take.isv"],
    ];
    for command in commands {
        for name in ["take.ply", "take.mov", "take.GLB", "take.npz", "take.isv.gz", "take.usdz"] {
            let run = work.isv(&[command, &["-o", name]].concat());
            run.fails(2, &[&format!("{name}: what is written is an .isv stream"), ".isv"]);
        }
        assert_eq!(work.names(""), before, "{command:?}");
    }
    // Names without an ending, and those that scripts rename later.
    for name in ["take", "take.isv.tmp", "take.v2", "new.ISV"] {
        work.isv(&["cut", "take.isv", "0..3", "-o", name]).done();
        assert_eq!(work.read(name), bytes);
    }
}

#[test]
fn pictures_studies_and_pages_are_not_written_under_the_names_of_other_files() {
    let (work, _) = Workspace::with_stream(1);
    let before = work.names("");
    work.isv(&["render", "take.isv", "-o", "r.jpg"]).fails(2, &["r.jpg", ".png"]);
    work.isv(&["render", "take.isv", "-o", "r.jpg", "--format=png"]).fails(2, &["r.jpg", ".png"]);
    work.isv(&["compare", "frames", "-o", "study.csv"]).fails(2, &["study.csv: isv does not write .csv"]);
    work.isv(&["export-player", "page.html", "take.isv"]).fails(2, &["page.html: isv does not write .html"]);
    work.isv(&["demo", "-o", "demo.zip"]).fails(2, &["demo.zip: isv does not write .zip"]);
    assert_eq!(work.names(""), before);
}
