//! How a surface is coloured.

use glam::Vec3;

/// Colour of faces seen straight from their back: a warm grey, lit like a front face.
///
/// No front face has it, as normals of unit length give saturated colours.
pub const BACK_FACE: [u8; 3] = [168, 158, 148];

/// Colour of a surface that has none of its own, where it faces the camera.
pub const GREY: [u8; 3] = [200, 200, 200];

/// Part of a front face's colour that does not depend on its angle to the camera.
const AMBIENT: f32 = 0.5;

/// Part of a front face's colour that does not depend on its angle, where colours are to be read off a scale.
/// Light must not hide them.
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

/// Normals that a surface is shaded by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalKind {
    /// The mesh's own normals or, if it has none, the mean of the faces around each vertex.
    #[default]
    Smooth,
    /// Each face's own normal: shows the triangles.
    Flat,
}

/// Meaning of a picture's colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// The normal as a colour: dents, seams and noise stand out, and backs of faces are [`BACK_FACE`].
    #[default]
    Normals,
    /// A grey surface in soft light from the camera.
    Shaded,
    /// The colour of the mesh's appearance as it is, without any light. A mesh without an appearance is drawn as [`Self::Shaded`].
    Colour,
    /// The colour of the mesh's appearance in soft light from the camera. A mesh without an appearance is drawn as
    /// [`Self::Shaded`].
    LitColour,
}

/// How to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Style {
    /// What lies behind the surface.
    pub background: Background,
    /// Meaning of the colours.
    pub shading: Shading,
    /// Normals that the light falls on, and that [`Shading::Normals`] shows.
    pub normals: NormalKind,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Paint {
    /// The normal: `n / 2 + 1/2`, lit from the camera; [`BACK_FACE`], lit alike, where a face is seen from its back.
    Normals,
    /// Only the form, for other colours to be laid over; both sides of a face alike.
    Form,
    /// [`GREY`] in soft light; both sides of a face alike.
    Grey,
    /// The mesh's colour without light; both sides of a face alike.
    Colour,
    /// The mesh's colour in the light of [`Self::Form`].
    LitColour,
}

impl Paint {
    /// The paint of a shading, on a mesh that has colours or has none.
    pub(crate) fn new(shading: Shading, has_colours: bool) -> Self {
        match shading {
            Shading::Normals => Self::Normals,
            Shading::Colour if has_colours => Self::Colour,
            Shading::LitColour if has_colours => Self::LitColour,
            Shading::Shaded | Shading::Colour | Shading::LitColour => Self::Grey,
        }
    }

    /// Whether it shows the mesh's colour.
    pub(crate) fn shows_colours(self) -> bool {
        matches!(self, Self::Colour | Self::LitColour)
    }

    /// Colour, 0 to 1, of a surface with a world normal. `own` is the mesh's colour there, for paints that show it.
    #[inline]
    pub(crate) fn colour(self, own: Vec3, normal: Vec3, to_camera: Vec3, front: bool) -> Vec3 {
        let facing = normal.dot(to_camera);
        match self {
            Self::Normals if front => (normal * 0.5 + 0.5) * lit(AMBIENT, facing.max(0.0)),
            Self::Normals => unit_colour(BACK_FACE) * lit(AMBIENT, facing.abs()),
            Self::Form => Vec3::splat(lit(FORM_AMBIENT, facing.abs())),
            Self::Grey => unit_colour(GREY) * lit(AMBIENT, facing.abs()),
            Self::Colour => own,
            Self::LitColour => own * lit(FORM_AMBIENT, facing.abs()),
        }
    }

    /// How much of the darkening of creases is used.
    pub(crate) fn crease_strength(self) -> f32 {
        match self {
            Self::Normals | Self::Grey => 1.0,
            Self::Form | Self::LitColour => 0.5,
            Self::Colour => 0.0,
        }
    }
}

/// A colour of 8 bits a channel as 0 to 1.
fn unit_colour(rgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(rgb.map(|c| f32::from(c) / 255.0))
}

/// Light on a surface, 1 where it faces the camera.
fn lit(ambient: f32, facing: f32) -> f32 {
    ambient + (1.0 - ambient) * facing
}
