//! A dense field: a byte of options, then an array of NumPy or an archive of arrays.
#![no_main]

use isv::raw::io::{DenseAxes, SampleAt};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((options, file)) = bytes.split_first() else { return };
    let axes = if options & 1 == 0 { DenseAxes::Zyx } else { DenseAxes::Xyz };
    let sample_at = if options & 2 == 0 { SampleAt::Centre } else { SampleAt::Corner };
    isv_fuzz::read_dense(file, axes, sample_at);
});
