//! Sound of any kind, to be put into an MP4 file.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::mp4::hear(bytes));
