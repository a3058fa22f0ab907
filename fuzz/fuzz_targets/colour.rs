//! Colour parts of frames whose surface is known.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::colour::decode(bytes));
