//! A .obj file, alone and with a material library.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    isv_fuzz::read_geometry("frame.obj", bytes);
    isv_fuzz::read_materials(bytes);
});
