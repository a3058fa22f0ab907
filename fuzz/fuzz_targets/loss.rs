//! An .isv stream that loses frames.
#![no_main]

isv_fuzz::run!("loss");
