//! Skirt, peplum, belt, collar and cuffs.

use crate::clay::Clay;
use crate::paint::Matter;
use crate::shape::{Cut, Drape, Ellipsoid, RoundCone};
use crate::skeleton::{Frame, Skeleton};
use glam::{Mat3, Vec2, Vec3};

/// Width of the seams between garments, in metres: narrow, so that edges show.
const SEAM_M: f32 = 0.006;

/// Depth to which lapels and buttons are sunk into the chest, in metres.
const SUNK_M: f32 = 0.004;

pub(crate) fn add(clay: &mut Clay, skeleton: &Skeleton) {
    add_front(clay, &skeleton.chest);
    add_skirt(clay, skeleton);
    add_collar(clay, &skeleton.chest);
    for arm in &skeleton.arms {
        add_cuff(clay, arm.middle, arm.end);
    }
}

/// Lapels from the collar to the breastbone, the jacket's edge from there to the waist, and buttons beside it.
fn add_front(clay: &mut Clay, chest: &Frame) {
    let meeting = [0.012, -0.045];
    let seams: Vec<_> = [[[0.06, 0.19], meeting], [[-0.06, 0.19], meeting], [meeting, [0.012, -0.26]]]
        .map(|[from, to]| on_chest(clay, chest, from, to))
        .into();
    let buttons = on_chest(clay, chest, [-0.012, -0.075], [-0.012, -0.215]);
    clay.take(Matter::Trim, chest);
    for points in &seams {
        for pair in points.windows(2) {
            clay.add(RoundCone::new(pair[0], pair[1], [0.0105; 2]), 0.012);
        }
    }
    clay.take(Matter::Brass, chest);
    for &button in buttons.iter().step_by(3) {
        clay.add(Ellipsoid::new(&Frame { origin: button, ..*chest }, [0.0; 3], [0.012, 0.012, 0.012]), 0.002);
    }
}

/// Points just below the front of the chest along a line, given by x and y in its frame.
fn on_chest(clay: &Clay, chest: &Frame, from: [f32; 2], to: [f32; 2]) -> Vec<Vec3> {
    let (from, to) = (Vec2::from_array(from), Vec2::from_array(to));
    let start = |i: i32| {
        let at = from.lerp(to, i as f32 / 9.0);
        chest.at(at.x, at.y, 0.3)
    };
    let inwards = -chest.axes.z_axis;
    (0..=9).map(|i| clay.surface_along(start(i), inwards) + inwards * SUNK_M).collect()
}

/// From the waist to below the knee, with a peplum and a belt over its ring.
fn add_skirt(clay: &mut Clay, skeleton: &Skeleton) {
    let waist = |frame: &Frame| frame.child(Vec3::new(0.0, 0.1, 0.0), Mat3::IDENTITY);
    let [ring, hem] = [waist(&skeleton.pelvis), waist(&skeleton.hem)];
    let skirt = Cut {
        length: 0.56,
        ring: [0.118, 0.092],
        hem: [0.35, 0.33],
        flare: 0.8,
        folds: 11.0,
        fold_depth: 0.028,
        hollow: 0.05,
        half_thickness: 0.007,
    };
    clay.take(Matter::Skirt, &ring);
    clay.add(Drape::new(&ring, &hem, skirt), SEAM_M);
    let peplum = Cut {
        length: 0.17,
        ring: [0.12, 0.093],
        hem: [0.236, 0.216],
        flare: 0.9,
        folds: 7.0,
        fold_depth: 0.01,
        hollow: 0.02,
        half_thickness: 0.007,
    };
    clay.take(Matter::Jacket, &ring);
    clay.add(Drape::new(&ring, &hem, peplum), SEAM_M);
    let belt = Cut {
        length: 0.035,
        ring: [0.123, 0.096],
        hem: [0.127, 0.1],
        flare: 1.0,
        folds: 0.0,
        fold_depth: 0.0,
        hollow: 0.0,
        half_thickness: 0.008,
    };
    clay.take(Matter::Leather, &ring);
    clay.add(Drape::new(&ring.child(Vec3::new(0.0, 0.018, 0.0), Mat3::IDENTITY), &ring, belt), SEAM_M);
}

/// A rolled collar, leaning back.
fn add_collar(clay: &mut Clay, chest: &Frame) {
    let ring = chest.child(Vec3::new(0.0, 0.232, -0.018), Mat3::from_rotation_x(0.25));
    let cut = Cut {
        length: 0.04,
        ring: [0.056, 0.054],
        hem: [0.066, 0.062],
        flare: 1.0,
        folds: 0.0,
        fold_depth: 0.0,
        hollow: 0.0,
        half_thickness: 0.01,
    };
    clay.take(Matter::Trim, &ring);
    clay.add(Drape::new(&ring, &ring, cut), SEAM_M);
}

/// A cuff that widens towards the hand.
fn add_cuff(clay: &mut Clay, elbow: Vec3, wrist: Vec3) {
    let up = (elbow - wrist).normalize();
    let side = up.any_orthonormal_vector();
    let ring = Frame { origin: wrist + up * 0.065, axes: Mat3::from_cols(side, up, side.cross(up)) };
    let cut = Cut {
        length: 0.055,
        ring: [0.032; 2],
        hem: [0.036; 2],
        flare: 1.0,
        folds: 0.0,
        fold_depth: 0.0,
        hollow: 0.0,
        half_thickness: 0.01,
    };
    clay.take(Matter::Trim, &ring);
    clay.add(Drape::new(&ring, &ring, cut), SEAM_M);
}
