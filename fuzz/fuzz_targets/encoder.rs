//! Volumes and settings, encoded in several ways.
#![no_main]

isv_fuzz::run!("encoder");
