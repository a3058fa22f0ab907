//! A .stl file.
#![no_main]

isv_fuzz::run!("stl");
