//! Meshes and points of any shape become volumes.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::ingest(bytes));
