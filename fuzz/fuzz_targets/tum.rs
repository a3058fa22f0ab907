//! The two lists of a folder in the TUM RGB-D layout and its lens, with empty lines between them. The lens,
//! if there is one, is calibration.txt or camera.json.
#![no_main]

isv_fuzz::run!("tum");
