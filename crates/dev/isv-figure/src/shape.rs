//! The shapes the figure is made of, as signed distances (negative inside), in metres.

use crate::skeleton::Frame;
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::TAU;

/// One shape.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// See [`RoundCone`].
    RoundCone(RoundCone),
    /// See [`Ellipsoid`].
    Ellipsoid(Ellipsoid),
    /// See [`Drape`].
    Drape(Drape),
}

impl Shape {
    pub(crate) fn distance(&self, p: Vec3) -> f32 {
        match self {
            Self::RoundCone(shape) => shape.distance(p),
            Self::Ellipsoid(shape) => shape.distance(p),
            Self::Drape(shape) => shape.distance(p),
        }
    }
}

impl From<RoundCone> for Shape {
    fn from(shape: RoundCone) -> Self {
        Self::RoundCone(shape)
    }
}

impl From<Ellipsoid> for Shape {
    fn from(shape: Ellipsoid) -> Self {
        Self::Ellipsoid(shape)
    }
}

impl From<Drape> for Shape {
    fn from(shape: Drape) -> Self {
        Self::Drape(shape)
    }
}

/// The convex hull of two spheres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundCone {
    from: Vec3,
    along: Vec3,
    radius: f32,
    /// Radius at the start minus radius at the end.
    taper: f32,
    length_squared: f32,
    /// Squared length of the straight part of the mantle.
    mantle_squared: f32,
}

impl RoundCone {
    pub(crate) fn new(from: Vec3, to: Vec3, radii: [f32; 2]) -> Self {
        let along = to - from;
        let taper = radii[0] - radii[1];
        let length_squared = along.length_squared();
        let mantle_squared = length_squared - taper * taper;
        Self { from, along, radius: radii[0], taper, length_squared, mantle_squared }
    }

    /// Exact. Source: I. Quilez, "distance functions", round cone between two points.
    fn distance(&self, p: Vec3) -> f32 {
        let to_p = p - self.from;
        // Positions along the axis from either end, times its length; the squares are all times its fourth power.
        let y = to_p.dot(self.along);
        let z = y - self.length_squared;
        let x_squared = (to_p * self.length_squared - self.along * y).length_squared();
        let y_squared = y * y * self.length_squared;
        let z_squared = z * z * self.length_squared;
        let k = self.taper.signum() * self.taper * self.taper * x_squared;
        if z.signum() * self.mantle_squared * z_squared > k {
            return (x_squared + z_squared).sqrt() / self.length_squared - self.radius + self.taper;
        }
        if y.signum() * self.mantle_squared * y_squared < k {
            return (x_squared + y_squared).sqrt() / self.length_squared - self.radius;
        }
        ((x_squared * self.mantle_squared / self.length_squared).sqrt() + y * self.taper)
            / self.length_squared
            - self.radius
    }
}

/// An ellipsoid with its axes along those of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipsoid {
    centre: Vec3,
    to_local: Mat3,
    radii: Vec3,
}

impl Ellipsoid {
    pub(crate) fn new(frame: &Frame, centre: [f32; 3], radii: [f32; 3]) -> Self {
        let [x, y, z] = centre;
        Self { centre: frame.at(x, y, z), to_local: frame.axes.transpose(), radii: Vec3::from_array(radii) }
    }

    /// Right to first order at the surface. Source: I. Quilez, "ellipsoid distance".
    fn distance(&self, p: Vec3) -> f32 {
        let scaled = self.to_local * (p - self.centre) / self.radii;
        let k = scaled.length();
        if k < 0.1 {
            return -0.9 * self.radii.min_element();
        }
        k * (k - 1.0) / (scaled / self.radii).length()
    }
}

/// Cloth hanging from a ring: it widens from an ellipse at the top to one at the hem, with folds that deepen downwards.
///
/// Nobody sees far under a skirt, and a capture of one has no surface there: only its lowest part is hollow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drape {
    origin: Vec3,
    to_local: Mat3,
    hem_offset: Vec2,
    hem_turn: f32,
    cut: Cut,
}

/// The measures of a [`Drape`], in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// From the ring down to the hem.
    pub(crate) length: f32,
    /// Half axes of the ring, to the side and ahead.
    pub(crate) ring: [f32; 2],
    /// Half axes of the hem.
    pub(crate) hem: [f32; 2],
    /// How the width grows from ring to hem: a power of the part of the length.
    pub(crate) flare: f32,
    /// Folds all around: a whole number.
    pub(crate) folds: f32,
    /// Depth of the folds at the hem, to either side.
    pub(crate) fold_depth: f32,
    /// How far up from the hem it is hollow.
    pub(crate) hollow: f32,
    /// Half the thickness of the cloth.
    pub(crate) half_thickness: f32,
}

impl Drape {
    /// Hangs from the origin of `ring`, down its y axis; the hem is drawn towards where it would hang from `hem`.
    pub(crate) fn new(ring: &Frame, hem: &Frame, cut: Cut) -> Self {
        let to_local = ring.axes.transpose();
        let drag = to_local * (hem.at(0.0, -cut.length, 0.0) - ring.at(0.0, -cut.length, 0.0));
        let ahead = to_local * hem.axes.z_axis;
        Self {
            origin: ring.origin,
            to_local,
            hem_offset: Vec2::new(drag.x, drag.z),
            hem_turn: ahead.x.atan2(ahead.z),
            cut,
        }
    }

    /// Approximate: measured towards the axis, and divided by the steepness of flare and folds.
    fn distance(&self, p: Vec3) -> f32 {
        let cut = &self.cut;
        let local = self.to_local * (p - self.origin);
        let down = (-local.y / cut.length).clamp(0.0, 1.0);
        let from_axis = Vec2::new(local.x, local.z) - self.hem_offset * down * down;
        let widen = down.powf(cut.flare);
        let half_axes = Vec2::from_array(cut.ring).lerp(Vec2::from_array(cut.hem), widen);
        let scale = (from_axis / half_axes).length().max(1e-3);
        let smooth_radius = from_axis.length() / scale;

        let fold_depth = cut.fold_depth * down * down.sqrt();
        let mut radius = smooth_radius;
        if fold_depth > 0.0 {
            let angle = from_axis.x.atan2(from_axis.y) - self.hem_turn * down;
            radius += fold_depth * fold_profile(angle, cut.folds);
        }
        let flare_slope = (cut.hem[0] - cut.ring[0]) / cut.length * cut.flare.max(1.0);
        let fold_slope = fold_depth * cut.folds / radius.max(0.05);
        let steepness = (1.0 + flare_slope * flare_slope + fold_slope * fold_slope).sqrt();

        let outwards = (from_axis.length() - radius) / steepness;
        let below_lining = -local.y - (cut.length - cut.hollow);
        let beyond = (-local.y - cut.length * 0.5).abs() - cut.length * 0.5;
        if below_lining < 0.0 && outwards < 0.0 && beyond < 0.0 {
            return outwards.max(below_lining).max(beyond) - cut.half_thickness;
        }
        let across = if outwards < 0.0 { (-outwards).min(below_lining.max(0.0)) } else { outwards };
        // The cloth's edges are round.
        Vec2::new(across, beyond.max(0.0)).length() - cut.half_thickness
    }
}

/// Unequal folds, in -1..=1: a wave whose phase wanders around the hem.
fn fold_profile(angle: f32, folds: f32) -> f32 {
    let wander = 0.9 * (2.0 * angle + 1.0).sin() + 0.5 * (3.0 * angle).sin();
    let broad = (folds * angle + wander).sin();
    0.8 * broad + 0.2 * ((folds + 3.0) * angle - wander + TAU / 3.0).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_cone_is_the_hull_of_its_spheres() {
        let shape = RoundCone::new(Vec3::ZERO, Vec3::new(0.0, 2.0, 0.0), [0.5, 0.25]);
        // On the mantle the nearest point lies along a normal tilted by asin(taper / length).
        let tilt = 0.125f32.asin();
        let normal = Vec3::new(tilt.cos(), tilt.sin(), 0.0);
        for (p, expected) in [
            (Vec3::new(0.0, -1.0, 0.0), 0.5),
            (Vec3::new(0.0, 3.0, 0.0), 0.75),
            (normal * 0.7 + Vec3::new(0.0, 0.3, 0.0), 0.7 - 0.5 + 0.3 * 0.125),
        ] {
            assert!((shape.distance(p) - expected).abs() < 1e-5, "{} at {p}", shape.distance(p));
        }
    }
}
