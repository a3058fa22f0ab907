//! An .isv stream that is not decoded.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::container::read(bytes));
