//! Meshes and points of any shape become volumes.
#![no_main]

isv_fuzz::run!("ingest");
