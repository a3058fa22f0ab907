//! The two lists of a folder in the TUM RGB-D layout and its lens, with empty lines between them. The lens,
//! if there is one, is calibration.txt or camera.json.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (depth, rest) = isv_fuzz::split(bytes, b"\n\n");
    let (poses, lens) = isv_fuzz::split(rest.trim_ascii_start(), b"\n\n");
    let lens = lens.trim_ascii_start();
    let (json, text) = if lens.starts_with(b"{") { (lens, &[][..]) } else { (&[][..], lens) };
    let lists = [("depth.txt", depth), ("groundtruth.txt", poses)];
    let lenses = [("camera.json", json), ("calibration.txt", text)];
    isv_fuzz::read_depth(&[lists, lenses].concat(), &["depth/0.png", "depth/1.png"]);
});
