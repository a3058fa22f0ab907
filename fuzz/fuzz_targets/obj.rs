//! A .obj file.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_geometry("frame.obj", bytes));
