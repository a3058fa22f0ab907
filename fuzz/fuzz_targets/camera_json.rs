//! The camera.json of a folder of depth images.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_depth(
    &[("camera.json", bytes)],
    &["depth/0.png", "depth/1.png"]
));
