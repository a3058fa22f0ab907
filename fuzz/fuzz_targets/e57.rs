//! A .e57 file.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_geometry("frame.e57", bytes));
