//! Symbols, and bytes to decode them from.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::range_decoder::check(bytes));
