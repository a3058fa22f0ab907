//! Colour parts of frames whose surface is known.
#![no_main]

isv_fuzz::run!("colour");
