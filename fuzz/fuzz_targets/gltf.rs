//! A .gltf file.
#![no_main]

isv_fuzz::run!("gltf");
