//! Places of the bones.

use crate::motion::{PERIOD_S, Pose};
use glam::{Mat3, Vec3};

/// Left and right, as a sign of x.
pub(crate) const SIDES: [f32; 2] = [1.0, -1.0];

const THIGH_M: f32 = 0.425;
const SHIN_M: f32 = 0.41;
const UPPER_ARM_M: f32 = 0.275;
const FOREARM_M: f32 = 0.245;

/// Shoulder to wrist: less than the bones together, so that elbows stay bent.
const REACH_M: f32 = 0.475;

/// The hem of the skirt is where the hips were this long ago.
const HEM_DELAY_S: f64 = 0.055 * PERIOD_S;

/// A place and the directions of a part of the body there: x to its left, y up along it, z ahead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) origin: Vec3,
    pub(crate) axes: Mat3,
}

/// Two bones: shoulder, elbow, wrist or hip, knee, ankle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limb {
    pub(crate) root: Vec3,
    pub(crate) middle: Vec3,
    pub(crate) end: Vec3,
}

/// All joints, in metres. Pairs are left, right.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Skeleton {
    pub(crate) pelvis: Frame,
    /// The pelvis of a moment ago.
    pub(crate) hem: Frame,
    pub(crate) chest: Frame,
    pub(crate) head: Frame,
    pub(crate) arms: [Limb; 2],
    /// At the wrist: y towards the fingers, z out of the palm.
    pub(crate) hands: [Frame; 2],
    pub(crate) hand_curl: [f32; 2],
    pub(crate) legs: [Limb; 2],
    /// At the ankle: z towards the toes.
    pub(crate) feet: [Frame; 2],
}

impl Frame {
    /// World position of a point of this frame.
    pub(crate) fn at(&self, x: f32, y: f32, z: f32) -> Vec3 {
        self.origin + self.axes * Vec3::new(x, y, z)
    }

    /// A frame at a point of this one, turned by `turn` relative to it.
    pub(crate) fn child(&self, origin: Vec3, turn: Mat3) -> Self {
        Self { origin: self.origin + self.axes * origin, axes: self.axes * turn }
    }
}

impl Skeleton {
    pub(crate) fn at(time_s: f64) -> Self {
        let pose = Pose::at(time_s);
        let pelvis = pelvis(&pose);
        let chest = chest(&pose, &pelvis);
        let head_turn = Mat3::from_rotation_y(pose.head_turn)
            * Mat3::from_rotation_z(pose.head_tilt)
            * Mat3::from_rotation_x(pose.head_nod);
        let head = chest.child(Vec3::new(0.0, 0.325, 0.012), head_turn);
        let arms = [0, 1].map(|side| arm(&pose, &chest, side));
        let hands = [0, 1].map(|side| hand(&arms[side], &chest, side));
        let feet = [0, 1].map(|side| foot(&pose, side));
        let legs = [0, 1].map(|side| leg(&pelvis, &feet[side], side));
        let hem = self::pelvis(&Pose::at(time_s - HEM_DELAY_S));
        Self { pelvis, hem, chest, head, arms, hands, hand_curl: pose.hand_curl, legs, feet }
    }
}

fn pelvis(pose: &Pose) -> Frame {
    Frame {
        origin: Vec3::from_array(pose.pelvis),
        axes: Mat3::from_rotation_y(pose.pelvis_turn) * Mat3::from_rotation_z(pose.pelvis_tilt),
    }
}

/// The chest turns about the waist, 0.1 m above the pelvis; its origin is the middle of the ribs.
fn chest(pose: &Pose, pelvis: &Frame) -> Frame {
    let turn = Mat3::from_rotation_y(pose.chest_turn)
        * Mat3::from_rotation_z(pose.chest_lean - pose.pelvis_tilt)
        * Mat3::from_rotation_x(pose.chest_bend);
    let waist = pelvis.child(Vec3::new(0.0, 0.11, 0.0), turn);
    waist.child(Vec3::new(0.0, 0.22, 0.0), Mat3::IDENTITY)
}

fn arm(pose: &Pose, chest: &Frame, side: usize) -> Limb {
    let (sin_rise, cos_rise) = pose.arm_rise[side].sin_cos();
    let (sin_forward, cos_forward) = pose.arm_forward[side].sin_cos();
    let out = SIDES[side];
    // A raised arm lifts its shoulder.
    let shoulder = chest.at(out * 0.165, 0.13 + 0.025 * sin_rise, -0.01);
    let direction = chest.axes * Vec3::new(out * cos_rise * cos_forward, sin_rise, cos_rise * sin_forward);
    let elbow_side = chest.axes * Vec3::new(out * 0.7, -0.45 + 0.3 * sin_rise, -0.6);
    two_bones(shoulder, shoulder + direction * REACH_M, [UPPER_ARM_M, FOREARM_M], elbow_side)
}

/// The hand goes on from the forearm, palm down or, the steeper the arm, towards the body.
fn hand(arm: &Limb, chest: &Frame, side: usize) -> Frame {
    let along = (arm.end - arm.middle).normalize();
    let inwards = chest.axes * Vec3::new(-SIDES[side], 0.0, 0.2);
    let steep = along.y * along.y;
    let palm = (inwards * steep - Vec3::Y * (1.0 - steep)).reject_from(along).normalize();
    Frame { origin: arm.end, axes: Mat3::from_cols(along.cross(palm), along, palm) }
}

/// The foot turns on its ball, which stays in place on the ground.
fn foot(pose: &Pose, side: usize) -> Frame {
    let out = SIDES[side];
    let ball = Vec3::new(out * 0.125, 0.0, if side == 0 { 0.13 } else { 0.06 });
    let on_ground = Frame { origin: ball, axes: Mat3::from_rotation_y(out * 0.4) };
    let lifted = on_ground.child(Vec3::ZERO, Mat3::from_rotation_x(pose.heel_lift[side]));
    lifted.child(Vec3::new(0.0, 0.085, -0.12), Mat3::IDENTITY)
}

fn leg(pelvis: &Frame, foot: &Frame, side: usize) -> Limb {
    let hip = pelvis.at(SIDES[side] * 0.088, -0.03, 0.0);
    let knee_side = foot.axes.z_axis + pelvis.axes.z_axis;
    two_bones(hip, foot.origin, [THIGH_M, SHIN_M], knee_side)
}

/// Two bones of given lengths from `root` to `end`, the joint on the side that `bend` points to. Out of reach, they are
/// straight and end short.
fn two_bones(root: Vec3, end: Vec3, [upper, lower]: [f32; 2], bend: Vec3) -> Limb {
    let along = (end - root).normalize();
    let distance = (end - root).length().min((upper + lower) * 0.999);
    let across = bend.reject_from(along).normalize();
    let foot = (distance * distance + upper * upper - lower * lower) / (2.0 * distance);
    let height = (upper * upper - foot * foot).max(0.0).sqrt();
    Limb { root, middle: root + along * foot + across * height, end: root + along * distance }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_keep_their_lengths() {
        for frame in 0..50 {
            let skeleton = Skeleton::at(f64::from(frame) * 0.1);
            for (limbs, lengths) in
                [(skeleton.arms, [UPPER_ARM_M, FOREARM_M]), (skeleton.legs, [THIGH_M, SHIN_M])]
            {
                for limb in limbs {
                    assert!((limb.root.distance(limb.middle) - lengths[0]).abs() < 1e-3);
                    assert!((limb.middle.distance(limb.end) - lengths[1]).abs() < 1e-3);
                }
            }
            for side in 0..2 {
                assert!(
                    skeleton.legs[side].end.distance(skeleton.feet[side].origin) < 0.01,
                    "feet within reach"
                );
            }
        }
    }

    #[test]
    fn hands_move_as_fast_as_a_dancers_and_feet_stay() {
        let frames = 150;
        let step_s = PERIOD_S / f64::from(frames);
        let fastest = |point: fn(&Skeleton) -> Vec3| {
            let at = |frame: i32| point(&Skeleton::at(f64::from(frame) * step_s));
            (0..frames).map(|f| at(f).distance(at(f + 1))).fold(0.0, f32::max)
        };
        // Metres a frame at 30 frames a second.
        let hand = fastest(|s| s.hands[0].origin);
        assert!((0.012..0.024).contains(&hand), "{hand} m");
        assert!(fastest(|s| s.feet[1].at(0.0, -0.085, 0.12)) < 1e-5);
        assert!(fastest(|s| s.pelvis.origin) < 0.01);
    }
}
