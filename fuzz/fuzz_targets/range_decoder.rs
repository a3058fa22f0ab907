//! Symbols, and bytes to decode them from.
#![no_main]

isv_fuzz::run!("range_decoder");
