//! A .glb file.
#![no_main]

isv_fuzz::run!("glb");
