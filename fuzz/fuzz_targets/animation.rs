//! The frames of an animated GLB.
#![no_main]

isv_fuzz::run!("animation");
