//! An .isv stream of which one payload is changed.
#![no_main]

isv_fuzz::run!("packet");
