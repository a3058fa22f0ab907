//! Neck, face and hair.

use crate::clay::{Clay, Ripple};
use crate::paint::{HAIR_MIDDLE, HAIR_RADII, Matter};
use crate::shape::{Ellipsoid, RoundCone};
use crate::skeleton::{Frame, SIDES};
use glam::{Mat3, Vec3};

/// The frame's origin is the middle of the skull, 0.1 m below its top.
pub(crate) fn add(clay: &mut Clay, head: &Frame) {
    clay.take(Matter::Skin, head);
    let throat = RoundCone::new(head.at(0.0, -0.19, -0.03), head.at(0.0, -0.05, -0.012), [0.054, 0.049]);
    clay.add(throat, 0.03);
    add_face(clay, head);
    add_hair(clay, head);
}

fn add_face(clay: &mut Clay, head: &Frame) {
    clay.take(Matter::Face, head);
    clay.add(Ellipsoid::new(head, [0.0, 0.02, 0.0], [0.073, 0.094, 0.09]), 0.02);
    let jaw = RoundCone::new(head.at(0.0, -0.02, 0.026), head.at(0.0, -0.077, 0.05), [0.061, 0.032]);
    clay.add(jaw, 0.02);
    for side in SIDES {
        clay.carve(Ellipsoid::new(head, [side * 0.031, 0.008, 0.1], [0.019, 0.012, 0.02]), 0.018);
        clay.add(Ellipsoid::new(head, [side * 0.03, 0.006, 0.067], [0.016, 0.0105, 0.0145]), 0.003);
        clay.add(Ellipsoid::new(head, [side * 0.075, -0.008, -0.006], [0.01, 0.026, 0.016]), 0.006);
    }
    let [bridge, tip] = [head.at(0.0, 0.012, 0.086), head.at(0.0, -0.024, 0.102)];
    clay.add(RoundCone::new(bridge, tip, [0.007, 0.0115]), 0.014);
    clay.add(Ellipsoid::new(head, [0.0, -0.053, 0.079], [0.023, 0.006, 0.012]), 0.006);
    clay.add(Ellipsoid::new(head, [0.0, -0.064, 0.077], [0.018, 0.006, 0.011]), 0.005);
}

/// Hair combed back into a bun.
fn add_hair(clay: &mut Clay, head: &Frame) {
    // The comb's strokes meet at the bun and, hidden by the face, at the nose.
    let comb = head.child(Vec3::new(0.0, 0.088, -0.098), Mat3::from_rotation_x(0.56));
    clay.take(Matter::Hair, &comb);
    let strands =
        |count: f32, twist: f32, height_m: f32| Ripple::Strands { frame: comb, count, twist, height_m };
    let cap = Ellipsoid::new(head, HAIR_MIDDLE.to_array(), HAIR_RADII.to_array());
    clay.add_rippled(cap, 0.003, strands(21.0, 0.0, 0.0022));
    let nape = Ellipsoid::new(head, [0.0, -0.02, -0.045], [0.07, 0.075, 0.058]);
    clay.add_rippled(nape, 0.015, strands(21.0, 0.0, 0.0022));
    let bun = Ellipsoid::new(&comb, [0.0, 0.008, -0.012], [0.05, 0.05, 0.042]);
    clay.add_rippled(bun, 0.006, strands(5.0, 70.0, 0.0035));
}
