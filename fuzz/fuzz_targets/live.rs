//! Bytes of a live source: streams that may be damaged, cut and joined.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::live::read_packets(bytes));
