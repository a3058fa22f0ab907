//! A .off file.
#![no_main]

isv_fuzz::run!("off");
