//! An image of a texture: PNG, JPEG, WebP or KTX2.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| isv_fuzz::read_image(bytes));
