//! Values over time.

use super::accessor::Accessors;
use super::animation::MAX_DURATION_S;
use super::fault::GltfFault;
use super::hierarchy::unit_quaternion;
use super::schema::{Interpolation, Sampler};
use crate::error::Flaw;
use glam::{DQuat, DVec3};

/// Most time by which a step may come early, in seconds. Times are stored as `f32`. The instant of a frame
/// may be rounded to just below the step that is meant to come with it.
const STEP_SLACK_S: f64 = 1e-5;

/// What a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Moved {
    Translation,
    Rotation,
    Scale,
    /// The weights of this many morph targets.
    Weights(usize),
}

/// Values at rising times, and how to get from one to the next.
#[derive(Debug)]
pub(super) struct Curve {
    times: Vec<f32>,
    /// A value has `width` numbers; of a cubic spline each key has three: the tangent in, the value, the tangent out.
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

/// Place of an instant among the keyframes.
#[derive(Clone, Copy)]
enum Place {
    /// At a key, or before the first or after the last.
    Key(usize),
    /// Between a key and the next: how far, from 0 to 1, and the seconds between the two.
    After { key: usize, share: f64, gap: f64 },
}

impl Curve {
    /// Loads a sampler of animation `animation`.
    pub(super) fn load(
        accessors: &Accessors,
        sampler: &Sampler,
        moved: Moved,
        animation: usize,
    ) -> Result<Self, Flaw> {
        let named_by = ("animation", animation);
        let times = accessors.floats::<1>(sampler.input, "SCALAR", named_by)?.into_flattened();
        let flaw = |fault: GltfFault| Flaw::in_object("accessor", sampler.input, fault);
        if times.is_empty() || !times.iter().all(|t| t.is_finite()) || !times.is_sorted() {
            return Err(flaw(GltfFault::Times));
        }
        if let Some(&seconds) = times.last().filter(|t| f64::from(**t) > MAX_DURATION_S) {
            return Err(flaw(GltfFault::Duration { seconds: seconds as u64 }));
        }
        let (values, width) = match moved {
            Moved::Translation | Moved::Scale => {
                (accessors.floats::<3>(sampler.output, "VEC3", named_by)?.into_flattened(), 3)
            }
            Moved::Rotation => (accessors.floats::<4>(sampler.output, "VEC4", named_by)?.into_flattened(), 4),
            Moved::Weights(count) => {
                (accessors.floats::<1>(sampler.output, "SCALAR", named_by)?.into_flattened(), count)
            }
        };
        let curve = Self { times, values, width, interpolation: sampler.interpolation };
        let wanted = curve.times.len() * curve.per_key() * width;
        if curve.values.len() != wanted {
            let fault = GltfFault::Count { wanted: wanted as u64, found: curve.values.len() as u64 };
            return Err(Flaw::in_object("accessor", sampler.output, fault));
        }
        Ok(curve)
    }

    /// Time of the first key, in seconds.
    pub(super) fn start_s(&self) -> f64 {
        self.times.first().map_or(0.0, |t| f64::from(*t))
    }

    /// Time of the last key, in seconds.
    pub(super) fn end_s(&self) -> f64 {
        self.times.last().map_or(0.0, |t| f64::from(*t))
    }

    /// The value at an instant; outside the keys the first or the last.
    pub(super) fn value(&self, seconds: f64) -> Vec<f64> {
        let place = self.place(seconds);
        let component = |i: usize| match place {
            Place::Key(key) => self.number(key, Part::Value, i),
            Place::After { key, share, .. } if self.interpolation == Interpolation::Linear => {
                let (from, to) = (self.number(key, Part::Value, i), self.number(key + 1, Part::Value, i));
                from + (to - from) * share
            }
            Place::After { key, share, gap } => self.spline(key, share, gap, i),
        };
        (0..self.width).map(component).collect()
    }

    /// Value of a curve of three numbers.
    pub(super) fn vector(&self, seconds: f64) -> DVec3 {
        DVec3::from_slice(&self.value(seconds))
    }

    /// Value of a curve of rotations, which turn evenly along the shorter way.
    pub(super) fn rotation(&self, seconds: f64) -> DQuat {
        let key_rotation = |key| unit_quaternion([0, 1, 2, 3].map(|i| self.number(key, Part::Value, i)));
        match self.place(seconds) {
            Place::After { key, share, .. } if self.interpolation == Interpolation::Linear => {
                key_rotation(key).slerp(key_rotation(key + 1), share)
            }
            _ => {
                let value = self.value(seconds);
                unit_quaternion([value[0], value[1], value[2], value[3]])
            }
        }
    }

    fn place(&self, seconds: f64) -> Place {
        let step = self.interpolation == Interpolation::Step;
        let reached = if step { seconds + STEP_SLACK_S } else { seconds };
        let next = self.times.partition_point(|key| f64::from(*key) <= reached);
        if step || next == 0 || next == self.times.len() {
            return Place::Key(next.saturating_sub(1));
        }
        let [from, to] = [next - 1, next].map(|key| f64::from(self.times[key]));
        Place::After { key: next - 1, share: (seconds - from) / (to - from), gap: to - from }
    }

    /// Hermite spline, appendix C.4 of the specification.
    fn spline(&self, key: usize, t: f64, gap: f64, i: usize) -> f64 {
        let (t2, t3) = (t * t, t * t * t);
        (2.0 * t3 - 3.0 * t2 + 1.0) * self.number(key, Part::Value, i)
            + gap * (t3 - 2.0 * t2 + t) * self.number(key, Part::TangentOut, i)
            + (3.0 * t2 - 2.0 * t3) * self.number(key + 1, Part::Value, i)
            + gap * (t3 - t2) * self.number(key + 1, Part::TangentIn, i)
    }

    fn per_key(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    fn number(&self, key: usize, part: Part, i: usize) -> f64 {
        let row = match (self.interpolation, part) {
            (Interpolation::CubicSpline, part) => 3 * key + part as usize,
            _ => key,
        };
        self.values[row * self.width + i].into()
    }
}

/// What the file stores at a key of a spline, in its order.
#[derive(Clone, Copy)]
enum Part {
    TangentIn,
    Value,
    TangentOut,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(interpolation: Interpolation, width: usize, values: &[f32]) -> Curve {
        Curve { times: vec![1.0, 2.0, 4.0], values: values.to_vec(), width, interpolation }
    }

    #[test]
    fn lines_steps_and_splines_pass_through_their_keys() {
        let line = curve(Interpolation::Linear, 1, &[0.0, 10.0, 30.0]);
        let step = curve(Interpolation::Step, 1, &[0.0, 10.0, 30.0]);
        let spline = curve(Interpolation::CubicSpline, 1, &[9.0, 0.0, 0.0, 0.0, 10.0, 5.0, 5.0, 30.0, 9.0]);
        for curve in [&line, &step, &spline] {
            let values = [-1.0, 1.0, 2.0, 4.0, 9.0].map(|t| curve.value(t)[0]);
            assert_eq!(values, [0.0, 0.0, 10.0, 30.0, 30.0]);
        }
        assert_eq!(line.value(3.0), [20.0]);
        assert_eq!([step.value(3.9)[0], step.value(4.0 - 1e-6)[0]], [10.0, 30.0]);
        // With flat tangents half way is the mean; tangents of 5 a second over 2 seconds cancel there as well.
        assert_eq!([spline.value(1.5)[0], spline.value(3.0)[0]], [5.0, 20.0]);
        let uneven = curve(Interpolation::CubicSpline, 1, &[0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(uneven.value(1.5), [1.0], "8 a second, an eighth of which arrives half way");
    }

    #[test]
    fn rotations_turn_evenly_the_shorter_way() {
        let quarter = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2).as_quat();
        let back = [-quarter.x, -quarter.y, -quarter.z, -quarter.w];
        let values = [[0.0, 0.0, 0.0, 1.0], quarter.to_array(), back].concat();
        let turn = curve(Interpolation::Linear, 4, &values);
        let third = turn.rotation(1.0 + 1.0 / 3.0);
        assert!(third.angle_between(DQuat::from_rotation_z(std::f64::consts::PI / 6.0)) < 1e-6);
        assert!(
            turn.rotation(3.0).angle_between(quarter.as_dquat()) < 1e-3,
            "the same rotation by another sign"
        );
    }
}
