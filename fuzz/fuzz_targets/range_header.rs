//! A `Range` header of a request.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::live::read_range(bytes));
