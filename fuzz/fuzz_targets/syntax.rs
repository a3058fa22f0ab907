//! An .isv stream of which one segment, or one field of a frame header, is changed.
#![no_main]

isv_fuzz::run!("syntax");
