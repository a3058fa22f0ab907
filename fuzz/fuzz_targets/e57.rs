//! A .e57 file whose pages have checksums that fit.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_scans(bytes));
