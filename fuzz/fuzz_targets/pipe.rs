//! Frames on a pipe: a tar archive or PLY files one after the other.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_pipe(bytes));
