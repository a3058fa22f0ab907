//! Shapes, scenes and random numbers for tests and for the conformance streams. Never linked into anything that ships.

mod meshes;
mod random;
mod volumes;

pub use meshes::{cube, open_box, sheet, soup, sphere};
pub use random::Random;
pub use volumes::{ball, volume_of};
