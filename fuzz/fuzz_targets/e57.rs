//! A .e57 file whose pages have checksums that fit.
#![no_main]

isv_fuzz::run!("e57");
