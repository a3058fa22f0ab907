//! Meshes and points of any shape become volumes.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::ingest(bytes));
