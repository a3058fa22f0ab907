//! A .ply file.
#![no_main]

isv_fuzz::run!("ply");
