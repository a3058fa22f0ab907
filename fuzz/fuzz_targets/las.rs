//! A .las file.
#![no_main]

isv_fuzz::run!("las");
