//! A dense field: a byte of options, then an array of NumPy or an archive of arrays.
#![no_main]

isv_fuzz::run!("dense");
