//! An .isv stream that loses frames.
#![no_main]

libfuzzer_sys::fuzz_target!(init: isv_fuzz::on_one_thread(), |bytes: &[u8]| isv_fuzz::loss::lose(bytes));

libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    isv_fuzz::mutators::any(data, size, max_size, seed)
});
