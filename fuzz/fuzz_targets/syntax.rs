//! An .isv stream of which one segment, or one field of a frame header, is changed.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::stream::decode(bytes));

libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    isv_fuzz::mutators::syntax(data, size, max_size, seed)
});
