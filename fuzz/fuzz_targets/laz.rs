//! A .laz file.
#![no_main]

isv_fuzz::run!("laz");
