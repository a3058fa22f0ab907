//! A `Range` header of a request.
#![no_main]

isv_fuzz::run!("range_header");
