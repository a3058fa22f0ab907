//! Frames on a pipe: a tar archive or PLY files one after the other.
#![no_main]

isv_fuzz::run!("pipe");
