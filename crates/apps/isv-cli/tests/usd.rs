//! `isv decode -o take.usda`: meshes over time for DCC programs and engines.

mod support;

use support::Workspace;

#[test]
fn a_take_becomes_one_usd_file() {
    let work = Workspace::with_painted_balls(3);
    work.isv(&["encode", "balls", "-o", "take.isv", "--voxel", "20mm", "--fps", "25"]).done();
    for name in ["take.usda", "take.usd"] {
        work.isv(&["decode", "take.isv", "-o", name, "--up", "z", "--units", "cm", "--origin", "100,0,0"])
            .done();
        // It is there, and made by isv, so it is overwritten.
        work.isv(&["decode", "take.isv", "-o", name, "--frames", "1..2"]).done();
        work.isv(&["decode", "take.isv", "-o", name, "--up", "z", "--units", "cm", "--origin", "100,0,0"])
            .done();
    }
    assert_eq!(work.read("take.usd"), work.read("take.usda"));
    let text = String::from_utf8(work.read("take.usda")).unwrap();
    let lines = [
        "metersPerUnit = 0.01",
        "upAxis = \"Z\"",
        "timeCodesPerSecond = 25",
        "startTimeCode = 0",
        "endTimeCode = 2",
        "double3 xformOp:translate = (100",
        "int[] faceVertexIndices.timeSamples",
        "normal3f[] normals",
        "color3f[] primvars:displayColor",
    ];
    for line in lines {
        assert!(text.contains(line), "{line}");
    }
    work.isv(&["decode", "take.isv", "-o", "frames", "--format", "usda", "--no-colour", "--no-normals"])
        .done();
    assert_eq!(work.names("frames"), ["frame_0000.usda", "frame_0001.usda", "frame_0002.usda"]);
}

#[test]
fn what_usd_cannot_hold_is_refused() {
    let work = Workspace::with_painted_balls(1);
    work.isv(&["encode", "balls", "-o", "take.isv", "--voxel", "20mm"]).done();
    let decode = |args: &[&str]| work.isv(&[&["decode", "take.isv"], args].concat());
    decode(&["-o", "take.usda", "--up", "x"]).fails(2, &["USD files have y or z up, not x"]);
    decode(&["-o", "-", "--format", "usda"]).fails(2, &["name a file"]);
    decode(&["-o", "take.usda", "--texture", "512"]).fails(2, &["usda files hold no texture"]);
    decode(&["-o", "take.usda", "--as", "points"]).fails(2, &["usda files are not written of points"]);
    work.write("film.usda", "#usda 1.0\n");
    decode(&["-o", "film.usda"]).fails(2, &["film.usda", "was not made by isv"]);
}
