//! How a surface is coloured.

use glam::Vec3;

/// Colour of faces seen straight from their back: a warm grey, lit like a front face.
///
/// No front face has it, as normals of unit length give saturated colours.
pub const BACK_FACE: [u8; 3] = [168, 158, 148];

/// Part of a front face's colour that does not depend on its angle to the camera.
const AMBIENT: f32 = 0.5;

/// The same where colours are to be read off a scale: light must not hide them.
const FORM_AMBIENT: f32 = 0.7;

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

    /// RGB of text on it. On nothing it is a grey that can be read on white and on black.
    pub(crate) fn ink(self) -> [u8; 3] {
        match self {
            Self::Light => [60, 60, 64],
            Self::Dark => [205, 205, 210],
            Self::Transparent => [128; 3],
        }
    }
}

/// What the colours of a drawing say.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Paint {
    /// The normal: `n / 2 + 1/2`, lit from the camera; [`BACK_FACE`], lit alike, where a face is seen from its back.
    Normals,
    /// Only the form, in grey, for other colours to be laid over; both sides of a face alike.
    Form,
}

impl Paint {
    /// Colour, 0 to 1, of a surface with a world normal.
    #[inline]
    pub(crate) fn colour(self, normal: Vec3, to_camera: Vec3, front: bool) -> Vec3 {
        let facing = normal.dot(to_camera);
        match self {
            Self::Normals if front => (normal * 0.5 + 0.5) * lit(AMBIENT, facing.max(0.0)),
            Self::Normals => {
                Vec3::from_array(BACK_FACE.map(|c| f32::from(c) / 255.0)) * lit(AMBIENT, facing.abs())
            }
            Self::Form => Vec3::splat(lit(FORM_AMBIENT, facing.abs())),
        }
    }

    /// How much of the darkening of creases is used.
    pub(crate) fn crease_strength(self) -> f32 {
        match self {
            Self::Normals => 1.0,
            Self::Form => 0.5,
        }
    }
}

/// Light on a surface, 1 where it faces the camera.
fn lit(ambient: f32, facing: f32) -> f32 {
    ambient + (1.0 - ambient) * facing
}
