//! The rig.json of a folder of depth images.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_depth(
    &[("rig.json", bytes)],
    &["front/0.png", "front/1.png", "back/left_0.exr", "back/left_1.exr"]
));
