//! A depth image as EXR.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_depth(&[
    ("camera.json", isv_fuzz::CAMERA_JSON.as_bytes()),
    ("depth/0.exr", bytes)
]));
