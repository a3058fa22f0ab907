//! An .isv stream that is not decoded.
#![no_main]

isv_fuzz::run!("container");
