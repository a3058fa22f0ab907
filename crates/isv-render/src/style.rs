//! How a surface is coloured.

use glam::Vec3;

/// Colour of faces seen from their back: a magenta that no front face looks like, for its normal would point down and
/// away.
pub const BACK_FACE: [u8; 3] = [214, 24, 96];

/// Part of a front face's colour that does not depend on its angle to the camera.
const AMBIENT: f32 = 0.5;

/// What lies behind the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// Nearly white.
    #[default]
    Light,
    /// Nearly black.
    Dark,
    /// Nothing: alpha is the part of each pixel that is covered.
    Transparent,
}

/// Which normals faces are coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// The mesh's own normals or, if it has none, the mean of the faces around each vertex.
    #[default]
    Smooth,
    /// Each face's own: shows the triangles.
    Flat,
}

/// How to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Style {
    /// What lies behind the surface.
    pub background: Background,
    /// Which normals faces are coloured by.
    pub shading: Shading,
}

impl Background {
    /// RGBA, 0 to 255.
    #[must_use]
    pub fn rgba(self) -> [u8; 4] {
        match self {
            Self::Light => [250, 250, 248, 255],
            Self::Dark => [22, 23, 27, 255],
            Self::Transparent => [0; 4],
        }
    }
}

/// Colour, 0 to 1, of a front face: world normal `n` as `n / 2 + 1/2`, lit from the camera.
pub(crate) fn front_colour(normal: Vec3, to_camera: Vec3) -> Vec3 {
    let headlight = normal.dot(to_camera).max(0.0);
    (normal * 0.5 + 0.5) * (AMBIENT + (1.0 - AMBIENT) * headlight)
}

/// Colour, 0 to 1, of a back face.
pub(crate) fn back_colour() -> Vec3 {
    Vec3::from_array(BACK_FACE.map(|c| f32::from(c) / 255.0))
}
