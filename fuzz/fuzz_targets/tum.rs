//! The two lists of a folder in the TUM RGB-D layout, an empty line between them.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (depth, poses) = isv_fuzz::split(bytes, b"\n\n");
    isv_fuzz::read_depth(&[("depth.txt", depth), ("groundtruth.txt", poses), ("depth/0.png", b"")]);
});
