//! The frames of an animated GLB.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::play_animation(bytes));
