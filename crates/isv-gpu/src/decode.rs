//! Decoding on a GPU.

pub(crate) mod shaders;
