//! Colours of skin, hair and clothes, in frames that move with the body.

use crate::skeleton::{Frame, SIDES};
use glam::{Vec2, Vec3};
use isv_volume::Rgb;
use std::f32::consts::TAU;

/// Matter of a part, and the frame that its pattern lies in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint {
    pub(crate) matter: Matter,
    pub(crate) frame: Frame,
}

/// Matter that parts of the figure are made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Matter {
    /// Plain skin.
    #[default]
    Skin,
    /// Skin of the face, with brows, cheeks and freckles.
    Face,
    /// An eye, 0 the left one, 1 the right one, in the frame of the head.
    Eye(usize),
    Lips,
    Hair,
    /// Cloth with stripes along y.
    Jacket,
    /// Plain cloth.
    Trim,
    Brass,
    /// Printed cloth that hangs from the frame's origin.
    Skirt,
    Stockings,
    Leather,
}

const SKIN: Vec3 = Vec3::new(224.0, 172.0, 144.0);
const HAIR: Vec3 = Vec3::new(84.0, 46.0, 28.0);
const CREAM: Vec3 = Vec3::new(238.0, 224.0, 192.0);
const NAVY: Vec3 = Vec3::new(36.0, 62.0, 92.0);

impl Paint {
    /// The colour at a place (metres), as 8-bit sRGB.
    pub(crate) fn colour(&self, place: Vec3) -> Rgb {
        let p = self.frame.axes.transpose() * (place - self.frame.origin);
        let colour = match self.matter {
            Matter::Skin => SKIN,
            Matter::Face => face(p),
            Matter::Eye(side) => eye(p, SIDES[side]),
            Matter::Lips => Vec3::new(182.0, 74.0, 78.0),
            Matter::Hair => HAIR * (1.0 + 0.22 * (160.0 * p.x + 30.0 * (40.0 * p.y).sin()).sin()),
            Matter::Jacket => jacket(p),
            Matter::Trim => CREAM,
            Matter::Brass => Vec3::new(206.0, 164.0, 72.0),
            Matter::Skirt => skirt(p),
            Matter::Stockings => Vec3::new(66.0, 56.0, 62.0),
            Matter::Leather => Vec3::new(112.0, 60.0, 36.0),
        };
        colour.clamp(Vec3::ZERO, Vec3::splat(255.0)).to_array().map(|c| c.round() as u8)
    }
}

/// 1 where a value is below a limit, 0 above, and between these over a width.
fn below(value: f32, limit: f32, width: f32) -> f32 {
    (0.5 + (limit - value) / width).clamp(0.0, 1.0)
}

/// Brows, blushed cheeks and freckles.
fn face(p: Vec3) -> Vec3 {
    let side = p.x.abs();
    let in_front = below(-p.z, -0.035, 0.02);
    let cheek = Vec2::new(side - 0.043, p.y + 0.03).length();
    let blush = 0.45 * in_front * below(cheek, 0.016, 0.024);
    let mut colour = SKIN.lerp(Vec3::new(226.0, 120.0, 110.0), blush);
    let freckle = (900.0 * p.x).sin() * (1100.0 * p.y).sin();
    colour = colour.lerp(
        Vec3::new(176.0, 112.0, 82.0),
        0.35 * in_front * below(cheek, 0.02, 0.01) * below(-freckle, -0.85, 0.1),
    );
    let arch = 0.0275 - 7.0 * (side - 0.027).powi(2);
    let brow = below((side - 0.031).abs(), 0.018, 0.003) * below((p.y - arch).abs(), 0.0026, 0.0016);
    colour.lerp(HAIR * 0.8, 0.9 * in_front * brow)
}

/// White, iris and pupil between lids.
fn eye(p: Vec3, side: f32) -> Vec3 {
    let at = Vec2::new(p.x - side * 0.03, p.y - 0.006);
    let opening = 0.0064 * (1.0 - (at.x / 0.0142).powi(2)).max(0.0);
    let radius = at.length();
    let mut colour = Vec3::new(246.0, 242.0, 238.0);
    colour = colour.lerp(Vec3::new(70.0, 104.0, 86.0), below(radius, 0.0052, 0.001));
    colour = colour.lerp(Vec3::new(16.0, 14.0, 14.0), below(radius, 0.0024, 0.001));
    colour =
        colour.lerp(Vec3::splat(255.0), below((at - Vec2::new(0.0016, 0.0018)).length(), 0.0011, 0.0006));
    let lid = at.y.abs() - opening;
    colour = colour.lerp(HAIR * 0.5, below(-lid, 0.0008, 0.001));
    colour.lerp(SKIN * 0.97, below(-lid, -0.0012, 0.001))
}

/// Stripes a centimetre and a half apart.
fn jacket(p: Vec3) -> Vec3 {
    let stripe = ((p.x / 0.015).fract().abs() - 0.5).abs();
    NAVY.lerp(Vec3::new(96.0, 132.0, 158.0), below(stripe, 0.07, 0.08))
}

/// Rows of flowers, and a border at the hem.
fn skirt(p: Vec3) -> Vec3 {
    const ROW_M: f32 = 0.062;
    const FLOWERS: f32 = 22.0;
    let hung = -p.y;
    let row = (hung / ROW_M).floor();
    let column = FLOWERS * p.x.atan2(p.z) / TAU + 0.5 * row.rem_euclid(2.0);
    // In metres from the middle of the flower; columns widen with the skirt.
    let around = TAU * Vec2::new(p.x, p.z).length() / FLOWERS;
    let at = Vec2::new((column - column.floor() - 0.5) * around, (hung / ROW_M - row - 0.5) * ROW_M);
    let (radius, angle) = (at.length(), at.y.atan2(at.x));
    let petals = 0.0155 + 0.0055 * (5.0 * angle).cos();
    let mut colour = Vec3::new(170.0, 48.0, 50.0);
    colour = colour.lerp(CREAM, below(radius, petals, 0.002));
    colour = colour.lerp(Vec3::new(222.0, 160.0, 60.0), below(radius, 0.0055, 0.002));
    colour = colour.lerp(NAVY, below(-hung, -0.5, 0.002));
    colour.lerp(CREAM, below((hung - 0.512).abs(), 0.003, 0.002))
}
