//! Warping at reduced resolution, so that it stays close to what the full decoder does.
//!
//! The full decoder interpolates linearly between its own voxels. Linear interpolation between larger voxels errs by four
//! (sixteen) times as much on a curved field. It errs always to the same side, and from frame to frame that adds up.
//!
//! In each direction, the full decoder interpolates between two of the stream's positions. So these two are first found by cubic
//! interpolation of the larger voxels, and then blended as it does. The result is exact wherever the field is a cubic polynomial.

/// Fractional bits of [`WEIGHTS`].
const WEIGHT_BITS: u32 = 13;
/// Fractional bits kept between the three axes. With weights whose magnitudes sum to at most 1.25, a sum stays below
/// `1.25^3 * 2^12 * 2^4 * 2^13 < 2^31`.
const KEPT_BITS: u32 = 4;
/// Voxels of the widest block at reduced resolution, and the ones its filter reaches beyond.
const MAX_SIDE: usize = 8;
const MAX_REACH: usize = MAX_SIDE + 3;

/// Cubic (Lagrange) weights of the samples at -1, 0, 1 and 2 for positions 0, 1/4, 1/2, 3/4 and 1, times `2^7`.
const CUBIC: [[i32; 4]; 5] =
    [[0, 128, 0, 0], [-7, 105, 35, -5], [-8, 72, 72, -8], [-5, 35, 105, -7], [0, 0, 128, 0]];

/// Weights of the samples at -1, 0, 1 and 2 for each 64th of a voxel, by reduction (2 and 4 of the stream's voxels).
const WEIGHTS: [[[i32; 4]; 64]; 2] = [weights(1), weights(2)];

const fn weights(reduction: u32) -> [[i32; 4]; 64] {
    let mut table = [[0; 4]; 64];
    let mut position = 0;
    while position < 64 {
        let scaled = position << reduction;
        let (voxel, fraction) = (scaled >> 6, (scaled & 63) as i32);
        let (here, next) = (CUBIC[voxel << (2 - reduction)], CUBIC[(voxel + 1) << (2 - reduction)]);
        let mut tap = 0;
        while tap < 4 {
            table[position][tap] = here[tap] * (64 - fraction) + next[tap] * fraction;
            tap += 1;
        }
        position += 1;
    }
    table
}

/// A cube of samples in larger voxels, x fastest.
pub(crate) struct Cube<'a> {
    pub(crate) samples: &'a [i16],
    /// Samples along an edge.
    pub(crate) side: usize,
    /// Base-2 logarithm of the stream's voxels to one of the cube: 1 or 2.
    pub(crate) reduction: u32,
}

impl Cube<'_> {
    /// Samples at `origin + (x, y, z)` for a block of `block_side` voxels; `origin` in 1/64 voxel from the cube's first.
    pub(crate) fn translate(&self, origin: [i32; 3], block_side: usize, out: &mut [i16]) {
        let reach = block_side + 3;
        let [x, y, z] = origin.map(|o| self.taps(o));
        let mut rows = [0; MAX_REACH * MAX_REACH * MAX_SIDE];
        for (row, values) in rows.chunks_exact_mut(block_side).take(reach * reach).enumerate() {
            let (from_y, from_z) = (y.voxels[row % reach], z.voxels[row / reach]);
            let start = (from_z * self.side + from_y) * self.side;
            for (i, value) in values.iter_mut().enumerate() {
                let sum = (0..4).map(|tap| x.weights[tap] * self.sample(start + x.voxels[i + tap])).sum();
                *value = round_shift(sum, WEIGHT_BITS - KEPT_BITS);
            }
        }
        let mut planes = [0; MAX_REACH * MAX_SIDE * MAX_SIDE];
        let plane = block_side * block_side;
        for (row, values) in planes.chunks_exact_mut(block_side).take(reach * block_side).enumerate() {
            let first = (row / block_side * reach + row % block_side) * block_side;
            for (i, value) in values.iter_mut().enumerate() {
                let sum = (0..4).map(|tap| y.weights[tap] * rows[first + tap * block_side + i]).sum();
                *value = round_shift(sum, WEIGHT_BITS);
            }
        }
        for (i, value) in out.iter_mut().enumerate() {
            let sum = (0..4).map(|tap| z.weights[tap] * planes[i + tap * plane]).sum();
            *value = round_shift(sum, WEIGHT_BITS + KEPT_BITS) as i16;
        }
    }

    /// The sample at a position in 1/64 voxel.
    pub(crate) fn at(&self, position: [i32; 3]) -> i16 {
        let mut out = [0];
        self.translate(position, 1, &mut out);
        out[0]
    }

    fn sample(&self, index: usize) -> i32 {
        i32::from(self.samples[index])
    }

    /// Weights of a position along an axis, and the voxels that a run of positions from there on reads, kept in the cube.
    fn taps(&self, origin: i32) -> Taps {
        let (first, last) = ((origin >> 6) - 1, self.side as i32 - 1);
        let mut voxels = [0; MAX_REACH];
        for (voxel, i) in voxels.iter_mut().zip(first..) {
            *voxel = i.clamp(0, last) as usize;
        }
        Taps { weights: WEIGHTS[self.reduction as usize - 1][(origin & 63) as usize], voxels }
    }
}

/// The filter along one axis.
struct Taps {
    weights: [i32; 4],
    voxels: [usize; MAX_REACH],
}

/// Rounds half up and drops `shift` bits.
fn round_shift(sum: i32, shift: u32) -> i32 {
    (sum + (1 << (shift - 1))) >> shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_weights_are_lagranges() {
        for (i, weights) in CUBIC.iter().enumerate() {
            let x = i as f64 / 4.0;
            for (weight, node) in weights.iter().zip([-1.0, 0.0, 1.0, 2.0]) {
                let others = [-1.0, 0.0, 1.0, 2.0].into_iter().filter(|other| *other != node);
                let lagrange: f64 = others.map(|other| (x - other) / (node - other)).product();
                assert_eq!(f64::from(*weight), 128.0 * lagrange);
            }
        }
    }

    #[test]
    fn weights_sum_to_one_and_stay_inside_their_bound() {
        for weights in WEIGHTS.as_flattened() {
            assert_eq!(weights.iter().sum::<i32>(), 1 << WEIGHT_BITS);
            assert!(weights.iter().map(|w| w.abs()).sum::<i32>() <= 5 << (WEIGHT_BITS - 2));
        }
    }

    /// A cubic field over the stream's voxels, interpolated linearly there, against the filter over larger voxels.
    #[test]
    fn cubic_fields_move_as_in_the_full_decoder() {
        for reduction in [1, 2] {
            let (side, size) = (12, f64::from(1 << reduction));
            let along = |x: f64, scale: f64| scale * ((x / size - 5.0).powi(3) - 9.0 * (x / size - 5.0));
            // Fine positions, in the stream's voxels from the first one's centre.
            let field = |p: [f64; 3]| along(p[0], 3.0) + along(p[1], -2.0) + along(p[2], 1.5) + p[0] * p[1];
            let centre = |voxel: usize| size * voxel as f64 + (size - 1.0) / 2.0;
            let samples: Vec<i16> = (0..side * side * side)
                .map(|i| field([i % side, i / side % side, i / side / side].map(centre)).round() as i16)
                .collect();
            let cube = Cube { samples: &samples, side, reduction };
            for steps in [[1, 2, 3], [-7, 6, 0], [4, -3, 5]] {
                let origin = steps.map(|t: i32| (4 << 6) + t * (16 >> reduction));
                let mut out = [0; 64];
                cube.translate(origin, 4, &mut out);
                for (i, sample) in out.iter().enumerate() {
                    let at = [i % 4, i / 4 % 4, i / 16];
                    let moved: [f64; 3] =
                        std::array::from_fn(|axis| centre(4 + at[axis]) + f64::from(steps[axis]) / 4.0);
                    let exact = linear(&field, moved, steps.map(|t| f64::from(t.rem_euclid(4)) / 4.0));
                    assert!((exact - f64::from(*sample)).abs() < 1.5, "{steps:?}: {sample} for {exact}");
                }
            }
        }
    }

    /// A field interpolated linearly at a position, between the two positions a voxel apart that it lies between.
    fn linear(field: &impl Fn([f64; 3]) -> f64, position: [f64; 3], fraction: [f64; 3]) -> f64 {
        (0..8)
            .map(|corner| {
                let far = [0, 1, 2].map(|axis| corner >> axis & 1 != 0);
                let weight: f64 =
                    (0..3).map(|a| if far[a] { fraction[a] } else { 1.0 - fraction[a] }).product();
                let at: [f64; 3] =
                    std::array::from_fn(|a| position[a] - fraction[a] + f64::from(u8::from(far[a])));
                weight * field(at)
            })
            .sum()
    }

    #[test]
    fn full_scale_samples_do_not_overflow() {
        let checks: Vec<i16> =
            (0..12i16.pow(3)).map(|i| if (i + i / 12 + i / 144) % 2 == 0 { 4096 } else { -4096 }).collect();
        for (samples, reduction) in [(vec![4096; 1728], 1), (vec![-4096; 1728], 2), (checks, 1)] {
            let cube = Cube { samples: &samples, side: 12, reduction };
            for position in [[32; 3], [0, 16, 703], [351, 17, 48]] {
                let sample = cube.at(position);
                assert!(sample.abs() <= 8000 && (samples[0] != samples[1] || sample == samples[0]));
            }
        }
    }
}
