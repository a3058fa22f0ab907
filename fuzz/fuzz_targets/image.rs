//! An image of a texture: PNG, JPEG, WebP or KTX2.
#![no_main]

isv_fuzz::run!("image");
