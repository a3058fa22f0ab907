//! Bytes of a live source: streams that may be damaged, cut and joined.
#![no_main]

isv_fuzz::run!("live");
