//! Volumes and settings, encoded in several ways.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::encoder::round_trip(bytes));
