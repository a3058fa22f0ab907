//! `isv decode -o take.usdc` and `take.usda`: meshes over time for DCC programs and engines.

mod support;

use support::Workspace;

#[test]
fn a_take_becomes_one_usd_file() {
    let work = Workspace::with_painted_balls(3);
    work.isv(&["encode", "balls", "-o", "take.isv", "--voxel", "20mm", "--fps", "25"]).done();
    let placed = ["--up", "z", "--units", "cm", "--origin", "100,0,0"];
    let decode = |name: &str, options: &[&str]| {
        work.isv(&[&["decode", "take.isv", "-o", name], options].concat()).done()
    };
    for name in ["take.usda", "take.usdc", "take.usd"] {
        decode(name, &placed);
        // It is there, and made by isv, so it is overwritten.
        decode(name, &["--frames", "1..2"]);
        decode(name, &placed);
    }
    let (text, binary) = (work.read("take.usda"), work.read("take.usdc"));
    assert!(binary.starts_with(b"PXR-USDC"));
    assert!(binary.len() < text.len() / 2, "{} and {}", binary.len(), text.len());
    assert!(work.read("take.usd") == binary);
    decode("take.usd", &[&placed[..], &["--format", "usda"]].concat());
    assert!(work.read("take.usd") == text);
    let text = String::from_utf8(text).unwrap();
    let lines = [
        "metersPerUnit = 0.01",
        "upAxis = \"Z\"",
        "timeCodesPerSecond = 25",
        "startTimeCode = 0",
        "endTimeCode = 2",
        "double3 xformOp:translate = (100, 0, 0)",
        "int[] faceVertexIndices.timeSamples",
        "normal3f[] normals",
        "color3f[] primvars:displayColor",
    ];
    for line in lines {
        assert!(text.contains(line), "{line}");
    }
    for format in ["usda", "usdc"] {
        decode(format, &["--format", format, "--no-colour", "--no-normals"]);
        let names = ["frame_0000", "frame_0001", "frame_0002"].map(|name| format!("{name}.{format}"));
        assert_eq!(work.names(format), names);
    }
}

#[test]
fn what_usd_cannot_hold_is_refused() {
    let work = Workspace::with_painted_balls(1);
    work.isv(&["encode", "balls", "-o", "take.isv", "--voxel", "20mm"]).done();
    let decode = |args: &[&str]| work.isv(&[&["decode", "take.isv"], args].concat());
    for format in ["usda", "usdc"] {
        let file = format!("take.{format}");
        decode(&["-o", &file, "--up", "x"]).fails(2, &["USD files have y or z up, not x"]);
        decode(&["-o", "-", "--format", format]).fails(2, &["name a file"]);
        let textured = format!("{format} files hold no texture");
        decode(&["-o", &file, "--texture", "512"]).fails(2, &[&textured]);
        let points = format!("{format} files are not written of points");
        decode(&["-o", &file, "--as", "points"]).fails(2, &[&points]);
        decode(&["-o", &file, "--format", "ply"]).fails(2, &["format ply does not fit the output's name"]);
    }
    decode(&["-o", "take.usdc", "--format", "usda"]).fails(2, &["format usda does not fit"]);
    for (name, text) in [("film.usda", "#usda 1.0\n"), ("film.usdc", "PXR-USDC\0\u{8}")] {
        work.write(name, text);
        decode(&["-o", name]).fails(2, &[name, "was not made by isv"]);
    }
}
