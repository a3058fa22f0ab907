//! An .isv stream decoded in several ways.
#![no_main]

isv_fuzz::run!("differential");
