//! In-loop filter across the face between two blocks: takes back a part of the step that coding them apart left there.
//!
//! Each of the 64 lines of samples across the face, `p2 p1 p0 | q0 q1 q2`, is filtered by itself. The step is measured
//! against the slopes on both sides, so a linear field stays as it is. Blocks of 8 voxels a side only.

use crate::block8::{Block, EDGE};
use crate::simd::vectorized;
use isv_volume::Truncation;

/// Lines across a face.
const LINES: usize = EDGE * EDGE;

/// Lines whose samples at the face both lie farther from the surface than this many codes are left alone: 2.5 voxels.
const REACH: i32 = 640;
/// A fifth in 1/64, for the change of the third sample.
const FIFTH: i32 = 13;

/// The samples of all lines across a face, one array a layer: `p2 p1 p0` and `q0 q1 q2`.
type Layers = [[i16; LINES]; 6];

/// How strongly faces are smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceFilter {
    strength: i32,
    limit: i32,
    truncation: i32,
}

impl FaceFilter {
    /// Largest strength, in 1/64. A step shrinks to `1 - 5 strength / 128` of itself, so beyond 25 it would turn over.
    pub const MAX_STRENGTH: u8 = 25;

    /// A filter that moves the samples at the face by `strength / 64` of the step, at most by `limit` codes. It keeps all samples
    /// within the truncation. `None` if the strength is above [`Self::MAX_STRENGTH`].
    #[must_use]
    pub fn new(strength: u8, limit: u8, truncation: Truncation) -> Option<Self> {
        (strength <= Self::MAX_STRENGTH).then_some(Self {
            strength: strength.into(),
            limit: limit.into(),
            truncation: truncation.codes().into(),
        })
    }
}

/// Smooths across the face between two blocks that are neighbours along an axis (0, 1, 2 for x, y, z): `lower` at the lower
/// coordinate. Whether anything changed.
///
/// A call touches three layers of either block, so the faces of one axis may be taken in any order. For
///
/// ```text
/// step = 3 (q0 - p0) + p1 - q1                 twice the step beyond the mean of the slopes on both sides
/// m    = min(strength |step| >> 7, limit)
/// ```
///
/// `p0`, `p1`, `p2` move by `m`, `m >> 1`, `13 m >> 6` in the direction of the step and `q0`, `q1`, `q2` as much against it. All
/// are clamped to the truncation. Intermediates stay below `2^22` for any samples.
///
/// # Panics
/// If `axis` is above 2.
pub fn smooth_face(axis: usize, lower: &mut Block, upper: &mut Block, filter: FaceFilter) -> bool {
    vectorized(
        #[inline(always)]
        || match axis {
            0 => smooth::<1>(lower, upper, filter),
            1 => smooth::<EDGE>(lower, upper, filter),
            2 => smooth::<LINES>(lower, upper, filter),
            _ => panic!("axis {axis} is not 0, 1 or 2"),
        },
    )
}

/// [`smooth_face`] along the axis on which neighbouring samples lie `STRIDE` apart.
#[inline(always)]
fn smooth<const STRIDE: usize>(lower: &mut Block, upper: &mut Block, filter: FaceFilter) -> bool {
    let mut layers = [[0; LINES]; 6];
    for (layer, samples) in layers.iter_mut().enumerate() {
        let block = if layer < 3 { &*lower } else { &*upper };
        for (line, sample) in samples.iter_mut().enumerate() {
            *sample = block[position::<STRIDE>(line, layer)];
        }
    }
    if !smooth_lines(&mut layers, filter) {
        return false;
    }
    for (layer, samples) in layers.iter().enumerate() {
        let block = if layer < 3 { &mut *lower } else { &mut *upper };
        for (line, sample) in samples.iter().enumerate() {
            block[position::<STRIDE>(line, layer)] = *sample;
        }
    }
    true
}

/// Index in its block of a line's sample of a layer. Layers 0 to 2 are the last of the lower block, 3 to 5 the first of the
/// upper.
#[inline(always)]
fn position<const STRIDE: usize>(line: usize, layer: usize) -> usize {
    let depth = (layer + EDGE - 3) % EDGE;
    line / STRIDE * (STRIDE * EDGE) + depth * STRIDE + line % STRIDE
}

/// Filters all lines. Whether any has changed.
#[inline(always)]
fn smooth_lines(layers: &mut Layers, filter: FaceFilter) -> bool {
    let [p2, p1, p0, q0, q1, q2] = layers;
    let mut changed = 0;
    for line in 0..LINES {
        let [near_p, near_q] = [p0[line], q0[line]].map(i32::from);
        let step = 3 * (near_q - near_p) + i32::from(p1[line]) - i32::from(q1[line]);
        let reached = near_p.abs().min(near_q.abs()) <= REACH;
        let most = if reached { filter.limit } else { 0 };
        let move0 = ((filter.strength * step.abs()) >> 7).min(most);
        let sign = if step < 0 { -1 } else { 1 };
        let moves = [move0, move0 >> 1, (FIFTH * move0) >> 6].map(|m| m * sign);
        let moved = |sample: i16, by: i32| {
            (i32::from(sample) + by).clamp(-filter.truncation, filter.truncation) as i16
        };
        p0[line] = moved(p0[line], moves[0]);
        p1[line] = moved(p1[line], moves[1]);
        p2[line] = moved(p2[line], moves[2]);
        q0[line] = moved(q0[line], -moves[0]);
        q1[line] = moved(q1[line], -moves[1]);
        q2[line] = moved(q2[line], -moves[2]);
        changed |= move0;
    }
    changed != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random.
    struct Noise(u32);

    impl Noise {
        fn below(&mut self, end: i32) -> i32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((u64::from(self.0) * end as u64) >> 32) as i32
        }
    }

    fn filter(strength: u8, limit: u8, truncation: u32) -> FaceFilter {
        FaceFilter::new(strength, limit, Truncation::from_voxels(truncation).unwrap()).unwrap()
    }

    /// A sample for each voxel, by its coordinates.
    fn block(sample: impl Fn([i32; 3]) -> i32) -> Block {
        let mut block = [0; 512];
        for (voxel, out) in block.iter_mut().enumerate() {
            *out = sample([voxel % 8, voxel / 8 % 8, voxel / 64].map(|c| c as i32)) as i16;
        }
        block
    }

    fn mirrored(axis: usize, samples: &Block) -> Block {
        block(|mut p| {
            p[axis] = 7 - p[axis];
            samples[(p[2] * 64 + p[1] * 8 + p[0]) as usize].into()
        })
    }

    /// Two blocks around zero with a step between them; some far from the surface.
    fn noisy_pair(seed: u32) -> [Block; 2] {
        let mut noise = Noise(seed);
        [-1, 1].map(|side| {
            let (base, spread) = (side * noise.below(1200), 1 + noise.below(400));
            let mut samples = [0; 512];
            samples.iter_mut().for_each(|s| *s = (base + noise.below(2 * spread) - spread) as i16);
            samples
        })
    }

    #[test]
    fn a_linear_field_stays_as_it_is() {
        for axis in 0..3 {
            let field = |first: i32| block(|p| 37 * (p[axis] + first) + 5 * p[(axis + 1) % 3] - 60);
            let (mut lower, mut upper) = (field(0), field(8));
            assert!(!smooth_face(axis, &mut lower, &mut upper, filter(25, 255, 16)));
            assert!(lower == field(0) && upper == field(8));
        }
    }

    #[test]
    fn all_lines_change_as_the_formula_says() {
        for seed in 0..60 {
            let (axis, [before_lower, before_upper]) = (seed as usize % 3, noisy_pair(seed));
            let [strength, limit] = [25, 255].map(|most| Noise(seed * 31 + most).below(most as i32 + 1));
            let (mut lower, mut upper) = (before_lower, before_upper);
            smooth_face(axis, &mut lower, &mut upper, filter(strength as u8, limit as u8, 16));
            for voxel in 0..512 {
                let depth = voxel as i32 >> (3 * axis) & 7;
                let at = |block: &Block, layer: i32| {
                    i32::from(block[(voxel as i32 + ((layer - depth) << (3 * axis))) as usize])
                };
                let (p0, q0) = (at(&before_lower, 7), at(&before_upper, 0));
                let step = 3 * (q0 - p0) + at(&before_lower, 6) - at(&before_upper, 1);
                let reached = p0.abs() <= 640 || q0.abs() <= 640;
                let most = if reached { (step.abs() * strength / 128).min(limit) } else { 0 };
                let moves = [most, most / 2, most * 13 / 64, 0, 0, 0, 0, 0].map(|m| m * step.signum());
                let at_voxel = |block: &Block| i32::from(block[voxel]);
                assert_eq!(at_voxel(&lower), at_voxel(&before_lower) + moves[7 - depth as usize]);
                assert_eq!(at_voxel(&upper), at_voxel(&before_upper) - moves[depth as usize]);
            }
        }
    }

    #[test]
    fn a_step_shrinks_and_never_turns_over() {
        for strength in 1..=FaceFilter::MAX_STRENGTH {
            for height in 0..600 {
                let (mut lower, mut upper) = (block(|p| 20 * p[0]), block(|p| 20 * (p[0] + 8) + height));
                smooth_face(0, &mut lower, &mut upper, filter(strength, 255, 16));
                let [p1, p0, q0, q1] = [lower[6], lower[7], upper[0], upper[1]].map(i32::from);
                let (before, after) = (2 * height, 3 * (q0 - p0) + p1 - q1);
                assert!((0..=before).contains(&after), "{strength}, {height}: {after}");
                assert!(after < before || before * i32::from(strength) < 128, "{strength}, {height}");
            }
        }
    }

    #[test]
    fn mirrored_or_negated_fields_give_mirrored_or_negated_results() {
        for seed in 0..30 {
            let (axis, [lower, upper]) = (seed as usize % 3, noisy_pair(seed));
            let smoothed = |mut lower: Block, mut upper: Block| {
                smooth_face(axis, &mut lower, &mut upper, filter(13, 38, 8));
                [lower, upper]
            };
            let [a, b] = smoothed(lower, upper);
            let swapped = smoothed(mirrored(axis, &upper), mirrored(axis, &lower));
            assert!(swapped == [mirrored(axis, &b), mirrored(axis, &a)], "seed {seed}");
            assert!(smoothed(lower.map(|s| -s), upper.map(|s| -s)) == [a, b].map(|f| f.map(|s| -s)));
        }
    }

    #[test]
    fn samples_far_from_the_surface_stay() {
        let (mut lower, mut upper) = (block(|_| 641), block(|_| -700));
        assert!(!smooth_face(1, &mut lower, &mut upper, filter(25, 255, 16)));
        let (mut lower, mut upper) = (block(|_| 640), block(|_| -700));
        assert!(smooth_face(1, &mut lower, &mut upper, filter(25, 255, 16)));
    }

    #[test]
    fn samples_stay_within_the_truncation_whatever_they_were() {
        let extremes = [i16::MIN, -4096, -1, 0, 1, 640, 4096, i16::MAX];
        for seed in 0..200 {
            let mut noise = Noise(seed);
            let mut pair = [[0; 512]; 2];
            pair.iter_mut().flatten().for_each(|s| *s = extremes[noise.below(8) as usize]);
            let axis = seed as usize % 3;
            let [lower, upper] = &mut pair;
            smooth_face(axis, lower, upper, filter(25, 255, 2));
            let depth = |voxel: usize| voxel >> (3 * axis) & 7;
            let touched =
                (0..512).flat_map(|v| [(depth(v) >= 5).then(|| lower[v]), (depth(v) < 3).then(|| upper[v])]);
            assert!(touched.flatten().all(|sample| (-512..=512).contains(&sample)));
        }
    }

    #[test]
    fn a_strength_that_would_turn_steps_over_is_refused() {
        let truncation = Truncation::DEFAULT;
        assert!(FaceFilter::new(25, 0, truncation).is_some());
        assert_eq!(FaceFilter::new(26, 0, truncation), None);
    }
}
