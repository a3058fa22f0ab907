//! A volume as NumPy arrays, one after the other: coordinates, then distances.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (coords, tsdf) = isv_fuzz::split(bytes, b"\x93NUMPY");
    isv_fuzz::read_arrays(&[("coords.npy", coords), ("tsdf.npy", tsdf)]);
});
