//! Shapes joined into one field, in the order they are put on.

use crate::paint::{Matter, Paint};
use crate::shape::Shape;
use crate::skeleton::Frame;
use glam::{Mat3, Vec3};
use isv_volume::Rgb;
use rayon::prelude::*;

/// Most that the field may change over a distance of centimetres, as a multiple of it. Exact shapes and
/// blends keep 1; relief and approximate shapes exceed it. The test `figure_is_closed` would see the holes if
/// it were too small.
pub(crate) const STEEPEST: f32 = 1.25;

/// Places that are painted together, given the parts near all of them.
const TOGETHER: usize = 32;

/// Distances from the surface (m) at which light finds it open or not.
const OPEN_AT_M: [f32; 3] = [0.015, 0.03, 0.06];

/// Direction to the light, of length 1: above, to her right and ahead.
const TO_LIGHT: Vec3 = Vec3::new(-0.36, 0.8, 0.48);

/// The figure so far.
#[derive(Debug)]
pub(crate) struct Clay {
    parts: Vec<Part>,
    /// Paint of what is added next.
    paint: Paint,
}

/// A shape and how it meets what was there before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    shape: Shape,
    join: Join,
    /// Width, in metres, over which the seam is smoothed.
    blend_m: f32,
    ripple: Option<Ripple>,
    paint: Paint,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Join {
    Add,
    Carve,
}

/// Relief on a shape. Lengths in metres, to either side of the shape's own surface.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Ripple {
    /// Creased cloth: a wave along a direction, bent by another wave so that no two creases are alike, and fading in and
    /// out.
    Creases {
        /// Anchor of the waves.
        origin: Vec3,
        /// Direction across the creases, times radians a metre.
        wave: Vec3,
        /// Direction in which creases wander, times radians a metre.
        wander: Vec3,
        height_m: f32,
    },
    /// Combed hair: ridges that run out from the z axis of a frame.
    Strands {
        frame: Frame,
        /// Ridges all around; a whole number.
        count: f32,
        /// Turn of the ridges along the axis, in radians a metre.
        twist: f32,
        height_m: f32,
    },
}

impl Default for Clay {
    fn default() -> Self {
        let frame = Frame { origin: Vec3::ZERO, axes: Mat3::IDENTITY };
        Self { parts: Vec::new(), paint: Paint { matter: Matter::default(), frame } }
    }
}

impl Clay {
    /// Chooses what the shapes that are added from now on are made of. `frame`: of the pattern.
    pub(crate) fn take(&mut self, matter: Matter, frame: &Frame) {
        self.paint = Paint { matter, frame: *frame };
    }

    /// Adds a shape.
    pub(crate) fn add(&mut self, shape: impl Into<Shape>, blend_m: f32) {
        self.push(shape.into(), Join::Add, blend_m, None);
    }

    /// Adds a shape with creases.
    pub(crate) fn add_rippled(&mut self, shape: impl Into<Shape>, blend_m: f32, ripple: Ripple) {
        self.push(shape.into(), Join::Add, blend_m, Some(ripple));
    }

    /// Takes a shape away.
    pub(crate) fn carve(&mut self, shape: impl Into<Shape>, blend_m: f32) {
        self.push(shape.into(), Join::Carve, blend_m, None);
    }

    fn push(&mut self, shape: Shape, join: Join, blend_m: f32, ripple: Option<Ripple>) {
        self.parts.push(Part { shape, join, blend_m, ripple, paint: self.paint });
    }

    /// Colours at places on the surface, without light: each of the nearest part, of the last of several.
    ///
    /// Places that follow each other lie near each other, or it takes longer.
    pub(crate) fn colours(&self, places: &[Vec3]) -> Vec<Rgb> {
        places.par_chunks(TOGETHER).flat_map_iter(|places| self.colours_nearby(places)).collect()
    }

    fn colours_nearby<'a>(&'a self, places: &'a [Vec3]) -> impl Iterator<Item = Rgb> + use<'a> {
        let (centre, radius_m) = sphere_around(places);
        let added = self.parts.iter().filter(|part| part.join == Join::Add);
        let distances: Vec<_> = added.map(|part| (part, part.distance(centre))).collect();
        let least = distances.iter().map(|(_, distance)| *distance).fold(f32::MAX, f32::min);
        let limit = least + 2.0 * STEEPEST * radius_m;
        let near = distances.into_iter().filter(move |(_, distance)| *distance <= limit);
        let near: Vec<&Part> = near.map(|(part, _)| part).collect();
        places.iter().map(move |place| {
            let mut nearest = (f32::MAX, self.paint);
            for part in &near {
                let distance = part.distance(*place);
                if distance <= nearest.0 {
                    nearest = (distance, part.paint);
                }
            }
            nearest.1.colour(*place)
        })
    }

    /// Soft light from above on places with unit normals, as it is on a stage: about 1 in the open, less in folds.
    pub(crate) fn light(&self, places: &[Vec3], normals: &[Vec3]) -> Vec<f32> {
        let chunks = places.par_chunks(TOGETHER).zip(normals.par_chunks(TOGETHER));
        chunks.flat_map_iter(|(places, normals)| self.light_nearby(places, normals)).collect()
    }

    fn light_nearby(&self, places: &[Vec3], normals: &[Vec3]) -> Vec<f32> {
        let (centre, radius_m) = sphere_around(places);
        let [.., farthest_m] = OPEN_AT_M;
        let near = |part: &&Part| part.matters(centre, radius_m + farthest_m, farthest_m);
        let near: Vec<_> = self.parts.iter().filter(near).collect();
        let at = |place: &Vec3, normal: &Vec3| {
            let open = OPEN_AT_M.map(|step| distance(&near, *place + *normal * step) / step);
            let open = open.iter().sum::<f32>() / OPEN_AT_M.len() as f32;
            (0.84 + 0.16 * normal.dot(TO_LIGHT)) * (0.45 + 0.6 * open.clamp(0.0, 1.0))
        };
        places.iter().zip(normals).map(|(place, normal)| at(place, normal)).collect()
    }

    /// Point at which a ray meets the figure so far; `from` lies outside.
    pub(crate) fn surface_along(&self, from: Vec3, direction: Vec3) -> Vec3 {
        let parts = self.parts();
        (0..40).fold(from, |p, _| p + direction * distance(&parts, p) * 0.8)
    }

    /// All parts, in order.
    pub(crate) fn parts(&self) -> Vec<&Part> {
        self.parts.iter().collect()
    }
}

impl Part {
    fn distance(&self, p: Vec3) -> f32 {
        self.shape.distance(p) - self.ripple.map_or(0.0, |ripple| ripple.height(p))
    }

    /// Whether the part can change field values below `band_m` within `radius_m` of a point.
    pub(crate) fn matters(&self, centre: Vec3, radius_m: f32, band_m: f32) -> bool {
        self.distance(centre) < STEEPEST * radius_m + band_m + self.blend_m
    }
}

impl Ripple {
    fn height(&self, p: Vec3) -> f32 {
        match *self {
            Self::Creases { origin, wave, wander, height_m } => {
                let local = p - origin;
                let [along, aside] = [wave.dot(local), wander.dot(local)];
                let fade = 0.5 + 0.5 * (0.8 * aside + 0.31 * along).sin();
                height_m * fade * (along + 1.6 * aside.sin()).sin()
            }
            Self::Strands { frame, count, twist, height_m } => {
                let local = frame.axes.transpose() * (p - frame.origin);
                let angle = local.x.atan2(local.y);
                height_m * (count * angle + twist * local.z + 0.8 * (3.0 * angle).sin()).sin()
            }
        }
    }
}

/// The field of some parts, in metres: negative inside. Nothing lies below the ground, y = 0.
pub(crate) fn distance(parts: &[&Part], p: Vec3) -> f32 {
    let joined = parts.iter().fold(f32::MAX, |so_far, part| {
        let distance = part.distance(p);
        match part.join {
            Join::Add => smooth_min(so_far, distance, part.blend_m),
            Join::Carve => -smooth_min(-so_far, distance, part.blend_m),
        }
    });
    joined.max(-p.y)
}

/// A sphere around places: its middle and its radius (m).
fn sphere_around(places: &[Vec3]) -> (Vec3, f32) {
    let low = places.iter().fold(Vec3::MAX, |low, place| low.min(*place));
    let high = places.iter().fold(Vec3::MIN, |high, place| high.max(*place));
    ((low + high) / 2.0, (high - low).length() / 2.0)
}

/// The smaller value, rounded off where the two are closer than `blend`.
fn smooth_min(a: f32, b: f32, blend: f32) -> f32 {
    let overlap = (1.0 - (a - b).abs() / blend).max(0.0);
    a.min(b) - overlap * overlap * blend / 4.0
}
