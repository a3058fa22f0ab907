//! Colours of skin, hair and clothes, in frames that move with the body.

use crate::skeleton::Frame;
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
    /// Skin of the head with all that is painted on it, in the frame of the head.
    Face,
    /// Hair combed towards the frame's z axis.
    Hair,
    /// Cloth with stripes along y, all around the trunk.
    Jacket,
    /// Cloth of the jacket, around an arm.
    Sleeve,
    /// Plain cloth.
    Trim,
    Brass,
    /// Printed cloth that hangs from the frame's origin.
    Skirt,
    Stockings,
    Leather,
    /// Leather over a dark sole, in the frame of the foot.
    Boot,
}

const SKIN: Vec3 = Vec3::new(224.0, 172.0, 144.0);
const HAIR: Vec3 = Vec3::new(84.0, 46.0, 28.0);
const CREAM: Vec3 = Vec3::new(238.0, 224.0, 192.0);
const NAVY: Vec3 = Vec3::new(38.0, 68.0, 104.0);

/// Middle and radii of the hair on the skull, in the frame of the head (metres).
pub(crate) const HAIR_MIDDLE: Vec3 = Vec3::new(0.0, 0.05, -0.022);
pub(crate) const HAIR_RADII: Vec3 = Vec3::new(0.087, 0.086, 0.1);

/// Stripes around the trunk and around an arm.
const TRUNK_STRIPES: f32 = 20.0;
const SLEEVE_STRIPES: f32 = 7.0;

impl Paint {
    /// The colour at a place (metres), as 8-bit sRGB.
    pub(crate) fn colour(&self, place: Vec3) -> Rgb {
        let p = self.frame.axes.transpose() * (place - self.frame.origin);
        let colour = match self.matter {
            Matter::Skin => SKIN,
            Matter::Face => face(p),
            Matter::Hair => hair(p),
            Matter::Jacket => stripes(p, TRUNK_STRIPES),
            Matter::Sleeve => stripes(p, SLEEVE_STRIPES),
            Matter::Trim => CREAM,
            Matter::Brass => Vec3::new(206.0, 164.0, 72.0),
            Matter::Skirt => skirt(p),
            Matter::Stockings => Vec3::new(66.0, 56.0, 62.0),
            Matter::Leather => Vec3::new(128.0, 70.0, 42.0),
            Matter::Boot => boot(p),
        };
        colour.clamp(Vec3::ZERO, Vec3::splat(255.0)).to_array().map(|c| c.round() as u8)
    }
}

/// 1 where a value is below a limit, 0 above, and between these over a width.
fn below(value: f32, limit: f32, width: f32) -> f32 {
    (0.5 + (limit - value) / width).clamp(0.0, 1.0)
}

/// Skin with cheeks, freckles, brows, eyes, nostrils and mouth, up to the hair.
fn face(p: Vec3) -> Vec3 {
    let side = p.x.abs();
    let in_front = below(-p.z, -0.035, 0.02);
    let cheek = Vec2::new(side - 0.043, p.y + 0.03).length();
    let blush = 0.3 * in_front * below(cheek, 0.014, 0.028);
    let mut colour = SKIN.lerp(Vec3::new(226.0, 120.0, 110.0), blush);
    let freckle = (900.0 * p.x).sin() * (1100.0 * p.y).sin();
    let freckles = 0.3 * in_front * below(cheek, 0.02, 0.01) * below(-freckle, -0.85, 0.1);
    colour = colour.lerp(Vec3::new(176.0, 112.0, 82.0), freckles);
    let arch = 0.0285 - 7.0 * (side - 0.027).powi(2);
    let thickness = 0.0030 - 0.05 * (side - 0.014).max(0.0);
    let brow = below((side - 0.031).abs(), 0.019, 0.004) * below((p.y - arch).abs(), thickness, 0.0024);
    colour = colour.lerp(HAIR * 0.75, 0.85 * in_front * brow);
    let nostril = Vec2::new(side - 0.0065, 1.6 * (p.y + 0.0345)).length();
    colour = colour
        .lerp(Vec3::new(120.0, 66.0, 56.0), 0.8 * below(-p.z, -0.07, 0.02) * below(nostril, 0.0024, 0.003));
    colour = mouth(p, colour, in_front);
    colour = eye(p, colour, in_front);
    // The outline of the hair, without its strands.
    let cap = ((p - HAIR_MIDDLE) / HAIR_RADII).length();
    colour.lerp(HAIR * 0.9, below(cap, 1.035, 0.04))
}

/// Both lips, and the line between them.
fn mouth(p: Vec3, skin: Vec3, in_front: f32) -> Vec3 {
    const HALF_WIDTH_M: f32 = 0.0225;
    let across = p.x / HALF_WIDTH_M;
    let swell = (1.0 - across * across).max(0.0);
    let up = p.y + 0.0585;
    let bow = 1.0 - 0.3 * (-(across / 0.22).powi(2)).exp();
    let half = if up > 0.0 { 0.0078 * swell.sqrt() * bow } else { 0.0098 * swell };
    let lips = in_front * below(up.abs() - half, 0.0, 0.0018) * below(across.abs(), 1.0, 0.06);
    let colour = skin.lerp(Vec3::new(190.0, 84.0, 88.0), lips);
    let line = below((up + 0.0008 * swell).abs(), 0.0006, 0.0014) * below(across.abs(), 0.98, 0.06);
    colour.lerp(Vec3::new(112.0, 40.0, 46.0), 0.85 * in_front * line)
}

/// The nearer eye: white, iris and pupil between lids with lashes.
fn eye(p: Vec3, skin: Vec3, in_front: f32) -> Vec3 {
    let at = Vec2::new(p.x.abs() - 0.0305, p.y - 0.0065);
    let half_width = 0.0158;
    let across = at.x / half_width;
    let swell = (1.0 - across * across).max(0.0);
    // The upper lid is rounder than the lower one.
    let (upper, lower) = (0.0072 * swell.powf(0.7), -0.0056 * swell);
    let radius = Vec2::new(at.x, at.y - 0.0006).length();
    let mut ball = Vec3::new(244.0, 240.0, 236.0);
    ball = ball.lerp(Vec3::new(44.0, 70.0, 62.0), below(radius, 0.0066, 0.0012));
    ball = ball.lerp(Vec3::new(92.0, 138.0, 116.0), below(radius, 0.0054, 0.0016));
    ball = ball.lerp(Vec3::new(14.0, 12.0, 12.0), below(radius, 0.0029, 0.0012));
    ball = ball.lerp(Vec3::splat(255.0), below((at - Vec2::new(0.0018, 0.0026)).length(), 0.0014, 0.001));
    // The upper lid's shadow.
    ball *= 1.0 - 0.3 * below(upper - at.y, 0.0014, 0.003);
    let open = below(at.y, upper, 0.001) * below(-at.y, -lower, 0.001) * below(across.abs(), 0.97, 0.06);
    let mut colour = skin.lerp(ball, in_front * open);
    let lashes = below((at.y - upper - 0.0006).abs(), 0.0010, 0.0012) * below(across.abs(), 1.08, 0.1);
    colour = colour.lerp(HAIR * 0.35, 0.95 * in_front * lashes);
    let crease = below((at.y - upper - 0.0046).abs(), 0.0004, 0.0016) * below(across.abs(), 0.95, 0.3);
    colour = colour.lerp(SKIN * 0.72, 0.6 * in_front * crease);
    let lower_lid = below((at.y - lower + 0.0004).abs(), 0.0004, 0.0014) * below(across.abs(), 0.95, 0.1);
    colour.lerp(SKIN * 0.6, 0.6 * in_front * lower_lid)
}

/// Strands around the z axis, lighter and darker.
fn hair(p: Vec3) -> Vec3 {
    let angle = p.x.atan2(p.y);
    let fine = (42.0 * angle + 2.0 * (5.0 * angle).sin() + 60.0 * p.z).sin();
    let broad = (21.0 * angle + 0.8 * (3.0 * angle).sin()).sin();
    HAIR * (1.0 + 0.12 * fine + 0.16 * broad)
}

/// Stripes along y, so many around it: a light one between broad ones. Edges are soft, as a camera has them.
fn stripes(p: Vec3, around: f32) -> Vec3 {
    let turn = around * p.x.atan2(p.z) / TAU;
    let from_middle = (turn - turn.round()).abs();
    let cloth = NAVY.lerp(Vec3::new(28.0, 46.0, 76.0), below(from_middle, 0.3, 0.14));
    cloth.lerp(Vec3::new(132.0, 162.0, 184.0), below(from_middle, 0.08, 0.14))
}

/// Leather with a seam at the toe, over a sole.
fn boot(p: Vec3) -> Vec3 {
    let mut colour = Vec3::new(128.0, 70.0, 42.0);
    let toe = Vec2::new(p.x, p.z - 0.02).length();
    colour = colour.lerp(colour * 0.6, below((toe - 0.085).abs(), 0.0022, 0.004) * below(-p.z, -0.03, 0.01));
    let lace = (p.y / 0.016).fract().abs();
    let laced = below(p.x.abs(), 0.014, 0.003) * below(-p.z, -0.02, 0.01) * below(-p.y, 0.03, 0.01);
    colour = colour.lerp(CREAM, 0.8 * laced * below((lace - 0.5).abs(), 0.14, 0.08));
    colour.lerp(Vec3::new(46.0, 36.0, 32.0), below(p.y, -0.071, 0.004))
}

/// Rows of flowers, and a border at the hem.
fn skirt(p: Vec3) -> Vec3 {
    const ROW_M: f32 = 0.1;
    const FLOWERS: f32 = 13.0;
    let hung = -p.y;
    let row = (hung / ROW_M).floor();
    let column = FLOWERS * p.x.atan2(p.z) / TAU + 0.5 * row.rem_euclid(2.0);
    // In metres from the middle of the flower; columns widen with the skirt.
    let around = TAU * Vec2::new(p.x, p.z).length() / FLOWERS;
    let at = Vec2::new((column - column.floor() - 0.5) * around, (hung / ROW_M - row - 0.5) * ROW_M);
    let (radius, angle) = (at.length(), at.y.atan2(at.x));
    let petals = 0.024 + 0.0085 * (5.0 * angle).cos();
    let mut colour = Vec3::new(170.0, 48.0, 50.0);
    colour = colour.lerp(CREAM, below(radius, petals, 0.004));
    colour = colour.lerp(Vec3::new(222.0, 160.0, 60.0), below(radius, 0.009, 0.004));
    colour = colour.lerp(NAVY, below(-hung, -0.5, 0.004));
    colour.lerp(CREAM, below((hung - 0.512).abs(), 0.003, 0.004))
}
