//! Files of every format that is read, small, as other programs write them: for tests of the readers, and for a fuzzer to start
//! from. Never linked into anything that ships.
//!
//! A builder panics where it cannot make what it is asked for: a test has to hear of that, and nobody else asks.

pub mod compressed;
pub mod e57;
pub mod exr;
pub mod gltf;
pub mod image;
pub mod lidar;
pub mod npy;
pub mod pcd;
pub mod ply;
pub mod png;
pub mod tar;
pub mod text;
