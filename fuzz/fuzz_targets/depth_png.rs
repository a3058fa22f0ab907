//! A depth image as 16-bit PNG.
#![no_main]

isv_fuzz::run!("depth_png");
