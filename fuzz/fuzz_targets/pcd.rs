//! A .pcd file.
#![no_main]

isv_fuzz::run!("pcd");
