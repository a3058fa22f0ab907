//! An MP4 file.
#![no_main]

isv_fuzz::run!("mp4");
