//! Sound of any kind, to be put into an MP4 file.
#![no_main]

isv_fuzz::run!("sound");
