//! A volume as NumPy arrays, one file after the other: grid.json if the bytes do not begin as an array, coordinates, distances, and
//! possibly weights.
#![no_main]

isv_fuzz::run!("arrays");
