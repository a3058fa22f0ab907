//! The rig.json of a folder of depth images.
#![no_main]

isv_fuzz::run!("rig");
