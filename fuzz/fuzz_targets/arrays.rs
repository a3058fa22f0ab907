//! A volume as NumPy arrays, one file after the other: grid.json if the bytes do not begin as an array, coordinates, distances, and
//! possibly weights.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    const MARK: &[u8] = b"\x93NUMPY";
    let (description, arrays) =
        if bytes.starts_with(MARK) { (&[][..], bytes) } else { isv_fuzz::split(bytes, MARK) };
    let (coords, rest) = isv_fuzz::split(arrays, MARK);
    let (tsdf, weight) = isv_fuzz::split(rest, MARK);
    isv_fuzz::read_arrays(&[
        ("grid.json", description),
        ("coords.npy", coords),
        ("tsdf.npy", tsdf),
        ("weight.npy", weight),
    ]);
});
