//! An .isv stream.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::decode_stream(bytes));
