//! An .isv stream, changed anywhere.
#![no_main]

isv_fuzz::run!("stream");
