//! A depth image as EXR.
#![no_main]

isv_fuzz::run!("depth_exr");
