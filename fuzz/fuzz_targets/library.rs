//! Options and calls of the library.
#![no_main]

isv_fuzz::run!("library");
