//! A .obj file, alone and with a material library.
#![no_main]

isv_fuzz::run!("obj");
