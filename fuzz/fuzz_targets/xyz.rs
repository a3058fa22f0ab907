//! A .xyz file.
#![no_main]

isv_fuzz::run!("xyz");
