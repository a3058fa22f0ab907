//! A depth image as EXR.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_depth_image("depth/0.exr", bytes));
