//! Torso, arms, hands, legs and shoes.

use crate::clay::{Clay, Ripple};
use crate::paint::Matter;
use crate::shape::{Ellipsoid, RoundCone};
use crate::skeleton::{Frame, Limb, SIDES, Skeleton};
use glam::{Mat3, Vec3};

/// Width of the seams within the body, in metres.
const FLESH_M: f32 = 0.05;

pub(crate) fn add(clay: &mut Clay, skeleton: &Skeleton) {
    for (leg, foot) in skeleton.legs.iter().zip(&skeleton.feet) {
        add_leg(clay, leg, foot);
        add_shoe(clay, foot);
    }
    add_torso(clay, skeleton);
    for side in 0..2 {
        add_arm(clay, &skeleton.arms[side], &skeleton.chest, SIDES[side]);
        add_hand(clay, &skeleton.hands[side], SIDES[side], skeleton.hand_curl[side]);
    }
}

fn add_torso(clay: &mut Clay, skeleton: &Skeleton) {
    let Skeleton { pelvis, chest, .. } = skeleton;
    clay.take(Matter::Jacket, chest);
    clay.add(Ellipsoid::new(pelvis, [0.0, 0.0, -0.01], [0.165, 0.125, 0.115]), FLESH_M);
    let waist = Frame { origin: pelvis.origin.lerp(chest.origin, 0.45), axes: chest.axes };
    clay.add(Ellipsoid::new(&waist, [0.0, 0.0, 0.0], [0.118, 0.13, 0.088]), FLESH_M);
    let creases = Ripple::Creases {
        origin: chest.origin,
        wave: chest.axes * Vec3::new(45.0, 95.0, 10.0),
        wander: chest.axes * Vec3::new(28.0, 15.0, 0.0),
        height_m: 0.0022,
    };
    clay.add_rippled(Ellipsoid::new(chest, [0.0, 0.0, -0.005], [0.148, 0.175, 0.1]), FLESH_M, creases);
    for side in SIDES {
        clay.add(Ellipsoid::new(chest, [side * 0.062, 0.012, 0.052], [0.06, 0.062, 0.052]), 0.06);
        let [neck, shoulder] = [chest.at(side * 0.05, 0.165, -0.015), chest.at(side * 0.15, 0.13, -0.012)];
        clay.add(RoundCone::new(neck, shoulder, [0.05, 0.052]), FLESH_M);
    }
}

fn add_arm(clay: &mut Clay, arm: &Limb, chest: &Frame, side: f32) {
    let [upper, lower] = [arm.middle - arm.root, arm.end - arm.middle].map(Vec3::normalize);
    let across = upper.cross(lower).normalize_or(chest.axes.y_axis);
    let creases = |origin: Vec3, along: Vec3, height_m: f32| Ripple::Creases {
        origin,
        wave: (along + across * 0.6 * side) * 105.0,
        wander: (along.cross(across) + along * 0.35) * 50.0,
        height_m,
    };
    let axes = |along: Vec3| Mat3::from_cols(across, along, across.cross(along));
    clay.take(Matter::Sleeve, &Frame { origin: arm.root, axes: axes(upper) });
    let sleeve = RoundCone::new(arm.root, arm.middle, [0.055, 0.043]);
    clay.add_rippled(sleeve, 0.035, creases(arm.root, upper, 0.0024));
    clay.take(Matter::Sleeve, &Frame { origin: arm.middle, axes: axes(lower) });
    let cuff = arm.end - lower * 0.02;
    let sleeve = RoundCone::new(arm.middle, cuff, [0.043, 0.033]);
    clay.add_rippled(sleeve, 0.015, creases(arm.middle, lower, 0.003));
}

/// Palm, four fingers of two bones each, and a thumb.
fn add_hand(clay: &mut Clay, wrist: &Frame, side: f32, curl: f32) {
    // The thumb is on the -x side of the left hand and the +x side of the right one.
    let thumb = -side;
    clay.take(Matter::Skin, wrist);
    let hand = wrist.child(Vec3::ZERO, Mat3::from_rotation_x(curl * 0.6));
    clay.add(RoundCone::new(wrist.at(0.0, -0.04, 0.0), hand.at(0.0, 0.01, 0.0), [0.024, 0.021]), 0.004);
    clay.add(Ellipsoid::new(&hand, [0.0, 0.045, 0.002], [0.036, 0.05, 0.016]), 0.015);
    for (i, length) in [0.034, 0.041, 0.039, 0.03].into_iter().enumerate() {
        let across = thumb * (0.027 - 0.018 * i as f32);
        let bend =
            Mat3::from_rotation_z(-across * 5.0) * Mat3::from_rotation_x(curl * (0.7 + 0.35 * i as f32));
        let knuckle = hand.child(Vec3::new(across, 0.085, 0.0), bend);
        let joint = knuckle.child(Vec3::new(0.0, length, 0.0), Mat3::from_rotation_x(curl * 1.2));
        clay.add(RoundCone::new(knuckle.origin, joint.origin, [0.0105, 0.0092]), 0.006);
        clay.add(RoundCone::new(joint.origin, joint.at(0.0, length * 0.95, 0.0), [0.0092, 0.0075]), 0.004);
    }
    let [root, joint, tip] = [[0.022, 0.02, 0.004], [0.05, 0.05, 0.018], [0.057, 0.08, 0.024]]
        .map(|[x, y, z]| hand.at(thumb * x, y, z));
    clay.add(RoundCone::new(root, joint, [0.016, 0.0115]), 0.012);
    clay.add(RoundCone::new(joint, tip, [0.0115, 0.0085]), 0.004);
}

fn add_leg(clay: &mut Clay, leg: &Limb, foot: &Frame) {
    clay.take(Matter::Stockings, foot);
    clay.add(RoundCone::new(leg.root, leg.middle, [0.083, 0.054]), FLESH_M);
    clay.add(RoundCone::new(leg.middle, leg.end, [0.052, 0.034]), 0.03);
    let shin = leg.end - leg.middle;
    let up = -shin.normalize();
    let back = (-foot.axes.z_axis).reject_from(up).normalize();
    let calf = Frame { origin: leg.middle + shin * 0.3, axes: Mat3::from_cols(up.cross(-back), up, -back) };
    clay.add(Ellipsoid::new(&calf, [0.0, 0.0, -0.022], [0.044, 0.11, 0.04]), 0.04);
}

/// An ankle boot with a heel.
fn add_shoe(clay: &mut Clay, foot: &Frame) {
    clay.take(Matter::Boot, foot);
    let shaft = RoundCone::new(foot.at(0.0, 0.065, -0.004), foot.at(0.0, -0.01, -0.002), [0.045, 0.042]);
    clay.add(shaft, 0.006);
    let [heel, ball, toe] =
        [[-0.045, -0.036], [-0.05, 0.095], [-0.057, 0.145]].map(|[y, z]| foot.at(0.0, y, z));
    clay.add(RoundCone::new(heel, ball, [0.036, 0.037]), 0.03);
    clay.add(RoundCone::new(ball, toe, [0.037, 0.028]), 0.02);
    clay.add(RoundCone::new(heel, foot.at(0.0, -0.075, -0.04), [0.032, 0.026]), 0.01);
}
