//! Spatial prediction of a block: a quadric through the surface of the blocks around it, by weighted least squares.
//!
//! Near the surface a signed distance is smooth, and a block that the surface enters continues what its neighbours hold.
//! [`SurfaceFit`] gathers the voxels of decoded neighbours that lie within four layers of the block. Their weights are
//! `exp(-|s| - far / 2)` (`s` the sample and `far` the layer, in voxels). It fits
//! `k0 + kx x + ky y + kz z + kxx x^2 + ... + kyz y z` to them with a small ridge. The block's prediction is that quadric.
//!
//! All of it is integers. Positions are odd numbers of half voxels from the block's centre, -15 to 15. In the equations they
//! count block edges, so that no monomial exceeds 1 and the matrix is well conditioned. Edge 8 only (`docs/spec/format.md`,
//! spatial prediction).

use crate::block8::{Block, EDGE};
use crate::simd::vectorized;
use std::ops::Range;

/// Positions along an axis: the block's eight and four on either side.
const POSITIONS: usize = 16;
/// Coefficients of a quadric in space.
const TERMS: usize = 10;
/// A fit to fewer voxels than these is none.
const FEWEST_VOXELS: i32 = 8;

/// The distance, in codes, at which a weight has fallen to 0.02 of that at 0; voxels farther away do not count.
const FARTHEST: i32 = 1001;
/// `256 log2(e)`.
const LOG2_E: i32 = 369;

/// Fraction bits of the matrix: weights of all voxels together stay below `2^21` (see [`SurfaceFit`]).
const MATRIX_BITS: u32 = 10;
/// Fraction bits of the right side: products of weight and sample sum to less than `2^28`.
const RIGHT_BITS: u32 = 3;
/// Fraction bits of an elimination factor.
const FACTOR_BITS: u32 = 20;
/// Fraction bits of the coefficients while they are solved for, in codes.
const SOLVE_BITS: u32 = 10;
/// Fraction bits of the coefficients that are evaluated.
const COEFFICIENT_BITS: u32 = 4;
/// Evaluated coefficients stay below this: monomials over `2^8` sum to at most `256 + 3 * 7 * 16 + 6 * 49 = 886`, and
/// `886 * 2^21 + 2^11 < 2^31`.
const COEFFICIENT_LIMIT: i64 = (1 << 21) - 1;

/// Exponents of the basis `1, x, y, z, x^2, y^2, z^2, xy, xz, yz`, each as `a + 5 b + 25 c` for `x^a y^b z^c`. No exponent of a
/// product of two exceeds 4, so its index is the sum of theirs.
const MONOMIALS: [usize; TERMS] = [0, 1, 5, 25, 2, 10, 50, 6, 26, 30];
/// Added to the diagonal: 1/1000, 1/50 and 30 voxels of full weight in units of voxels, here in those of the matrix.
/// No pivot is less in exact arithmetic, nor is one taken to be.
const RIDGE: [i32; TERMS] = [2097, 655, 655, 655, 15360, 15360, 15360, 15360, 15360, 15360];

/// What a block's neighbours say about the surface inside it: moments of their weighted voxels.
///
/// For each of 16 positions along x it holds `sum w y^b z^c` and `sum w s y^b z^c`. Weights, 2048 at a distance of 0, are at most
/// 1238, 755, 458 and 277 in the layers 1 to 4. These layers have 488, 728, 1016 and 1352 voxels, so weights sum to less than
/// `2^21`. Products of weight and sample are at most 117648, 71022, 43200 and 26361 there and sum to less than `2^28`. With the
/// powers of y and z no sum over the voxels of one x exceeds `3/4 2^31` (test `sums_stay_within_their_bounds`).
#[derive(Clone, Debug)]
pub struct SurfaceFit {
    /// `[c][b][column]`, `b + c <= 4`.
    weights: [[[i32; POSITIONS]; 5]; 5],
    /// `[c][b][column]`, `b + c <= 2`.
    products: [[[i32; POSITIONS]; 3]; 3],
    /// Voxels that count.
    count: i32,
    /// Bit `(dz + 1) * 9 + (dy + 1) * 3 + dx + 1` of the neighbours that were added.
    added: u32,
}

impl Default for SurfaceFit {
    fn default() -> Self {
        Self::new()
    }
}

impl SurfaceFit {
    /// No neighbours yet.
    #[must_use]
    pub fn new() -> Self {
        Self { weights: [[[0; POSITIONS]; 5]; 5], products: [[[0; POSITIONS]; 3]; 3], count: 0, added: 0 }
    }

    /// Adds the block at `offset` `[x, y, z]`, in blocks, from the one to be predicted: its `8^3` samples, x fastest, any
    /// values. The order of neighbours does not matter.
    ///
    /// # Panics
    /// If `samples` is not a block, or `offset` is zero, out of -1 to 1 or was added before.
    pub fn add_neighbour(&mut self, offset: [i32; 3], samples: &[i16]) {
        assert!(offset != [0; 3] && offset.iter().all(|d| d.abs() <= 1), "{offset:?} is not a neighbour");
        let bit = 1 << ((offset[2] + 1) * 9 + (offset[1] + 1) * 3 + offset[0] + 1);
        assert!(self.added & bit == 0, "{offset:?} was added before");
        self.added |= bit;
        let samples: &Block = samples.try_into().expect("a block of 8^3 samples");
        vectorized(
            #[inline(always)]
            || match (offset[0], offset[1]) {
                (0, 0) => self.add_pillars::<8, 8, 64>(offset, samples),
                (0, _) => self.add_pillars::<8, 4, 32>(offset, samples),
                (_, 0) => self.add_pillars::<4, 8, 32>(offset, samples),
                _ => self.add_pillars::<4, 4, 16>(offset, samples),
            },
        );
    }

    /// The quadric at the voxels of the block, clamped to `limit` codes on either side of 0. False, and `out` is as it was, if
    /// fewer than 8 voxels count.
    ///
    /// # Panics
    /// If `limit` is negative or `out` is not a block.
    pub fn predict(&self, limit: i16, out: &mut [i16]) -> bool {
        assert!(limit >= 0, "limit {limit} is negative");
        let out: &mut Block = out.try_into().expect("a block of 8^3 samples");
        if self.count < FEWEST_VOXELS {
            return false;
        }
        vectorized(
            #[inline(always)]
            || evaluate(&solve(self.equations()), i32::from(limit), out),
        );
        true
    }

    /// Adds a neighbour that has `X` by `Y` pillars near the block, `N` in all.
    #[inline(always)]
    fn add_pillars<const X: usize, const Y: usize, const N: usize>(
        &mut self,
        offset: [i32; 3],
        samples: &Block,
    ) {
        let pillars = Pillars::<N>::new::<X>(offset, samples);
        let column = (position(near(offset[0]).start, offset[0]) + 15) as usize / 2;
        let mut y_powers = [[0; Y]; 5];
        for row in 0..Y {
            let row_powers = powers(position(near(offset[1]).start + row, offset[1]));
            for b in 0..5 {
                y_powers[b][row] = row_powers[b];
            }
        }
        for c in 0..5 {
            for b in 0..5 - c {
                let sums = &mut self.weights[c][b][column..column + X];
                add_rows::<X, Y, N>(sums, &pillars.weights[c], &y_powers[b]);
            }
        }
        for c in 0..3 {
            for b in 0..3 - c {
                let sums = &mut self.products[c][b][column..column + X];
                add_rows::<X, Y, N>(sums, &pillars.products[c], &y_powers[b]);
            }
        }
        for i in 0..N {
            self.count += pillars.counts[i];
        }
    }

    /// The normal equations, one a row: the matrix and, last, the right side. Rows are padded to a multiple of four.
    #[inline(always)]
    fn equations(&self) -> [[i32; ROW]; TERMS] {
        let mut moments = [0; 125];
        for c in 0..5 {
            for b in 0..5 - c {
                for a in 0..5 - b - c {
                    let degree = (a + b + c) as u32;
                    moments[a + 5 * b + 25 * c] =
                        scaled(along_x(&self.weights[c][b], a), MATRIX_BITS, degree);
                }
            }
        }
        let mut right = [0; 125];
        for c in 0..3 {
            for b in 0..3 - c {
                for a in 0..3 - b - c {
                    let degree = (a + b + c) as u32;
                    right[a + 5 * b + 25 * c] = scaled(along_x(&self.products[c][b], a), RIGHT_BITS, degree);
                }
            }
        }
        let mut rows = [[0; ROW]; TERMS];
        for (i, row) in rows.iter_mut().enumerate() {
            for j in 0..TERMS {
                row[j] = moments[MONOMIALS[i] + MONOMIALS[j]];
            }
            row[i] += RIDGE[i];
            row[TERMS] = right[MONOMIALS[i]];
        }
        rows
    }
}

/// `[a][column]`: `x^a`.
const X_POWERS: [[i32; POSITIONS]; 5] = {
    let mut powers = [[1; POSITIONS]; 5];
    let mut i = 0;
    while i < 4 * POSITIONS {
        let (a, column) = (i / POSITIONS, i % POSITIONS);
        powers[a + 1][column] = powers[a][column] * (2 * column as i32 - 15);
        i += 1;
    }
    powers
};

/// Length of a row of the equations.
const ROW: usize = 12;

/// Sums over z in one neighbour, for each x and y of its voxels near the block, x fastest.
struct Pillars<const N: usize> {
    /// `[c][pillar]`: `sum w z^c`.
    weights: [[i32; N]; 5],
    /// `[c][pillar]`: `sum w s z^c`.
    products: [[i32; N]; 3],
    /// Voxels that count.
    counts: [i32; N],
}

impl<const N: usize> Pillars<N> {
    /// Sums over z in a neighbour with `X` pillars a row.
    #[inline(always)]
    fn new<const X: usize>(offset: [i32; 3], samples: &Block) -> Self {
        let [x0, y0] = [near(offset[0]).start, near(offset[1]).start];
        // The larger of |x| and |y|.
        let mut reach = [0; N];
        for (i, reach) in reach.iter_mut().enumerate() {
            *reach = position(x0 + i % X, offset[0]).abs().max(position(y0 + i / X, offset[1]).abs());
        }
        let mut pillars = Self { weights: [[0; N]; 5], products: [[0; N]; 3], counts: [0; N] };
        for voxel_z in near(offset[2]) {
            let mut layer = [0; N];
            for (row, values) in layer.as_chunks_mut::<X>().0.iter_mut().enumerate() {
                let start = (voxel_z * EDGE + y0 + row) * EDGE + x0;
                values.copy_from_slice(&samples[start..start + X]);
            }
            pillars.add_layer(position(voxel_z, offset[2]), &reach, &layer);
        }
        pillars
    }

    /// Adds the voxels of one z.
    #[inline(always)]
    fn add_layer(&mut self, z: i32, reach: &[i32; N], layer: &[i16; N]) {
        let (mut weights, mut products) = ([0; N], [0; N]);
        for i in 0..N {
            let sample = i32::from(layer[i]);
            // A layer of two half voxels adds half a voxel to the distance: 64 codes for each half voxel.
            weights[i] = weight(sample.abs() + 64 * (reach[i].max(z.abs()) - 7));
            products[i] = weights[i] * sample;
        }
        let z_powers = powers(z);
        for c in 0..5 {
            for i in 0..N {
                self.weights[c][i] += weights[i] * z_powers[c];
            }
        }
        for c in 0..3 {
            for i in 0..N {
                self.products[c][i] += products[i] * z_powers[c];
            }
        }
        for i in 0..N {
            self.counts[i] += weights[i].min(1);
        }
    }
}

/// Adds `Y` rows of `X` terms, each times its factor.
#[inline(always)]
fn add_rows<const X: usize, const Y: usize, const N: usize>(
    sums: &mut [i32],
    terms: &[i32; N],
    factors: &[i32; Y],
) {
    let mut totals = [0; X];
    for (row, factor) in terms.as_chunks::<X>().0.iter().zip(factors) {
        for i in 0..X {
            totals[i] += row[i] * factor;
        }
    }
    for i in 0..X {
        sums[i] += totals[i];
    }
}

/// Voxels along an axis that lie within four layers of the block to be predicted, in a block `d` blocks from it.
#[inline(always)]
fn near(d: i32) -> Range<usize> {
    match d {
        0 => 0..EDGE,
        1 => 0..EDGE / 2,
        _ => EDGE / 2..EDGE,
    }
}

/// Position in half voxels from the centre of the block to be predicted.
#[inline(always)]
fn position(voxel: usize, d: i32) -> i32 {
    2 * voxel as i32 + 16 * d - 7
}

/// `2048 exp(-distance / 256)` for a distance in codes of at least 128, 0 beyond [`FARTHEST`]: a power of two, its fraction by a
/// parabola, rounded half up.
#[inline(always)]
fn weight(distance: i32) -> i32 {
    let octaves = (distance.min(FARTHEST) * LOG2_E + 128) >> 8;
    let fraction = octaves & 255;
    let mantissa = 4096 - 8 * fraction - ((fraction * (256 - fraction) * 11) >> 10);
    // A mask instead of a branch, for vectors: all ones up to FARTHEST, else 0.
    (((mantissa >> (octaves >> 8)) + 1) >> 1) & ((distance - FARTHEST - 1) >> 31)
}

/// The powers 0 to 4 of a position.
#[inline(always)]
fn powers(p: i32) -> [i32; 5] {
    [1, p, p * p, p * p * p, p * p * p * p]
}

/// `sum x^a` times the columns.
#[inline(always)]
fn along_x(columns: &[i32; POSITIONS], a: usize) -> i64 {
    let mut sum = 0;
    for i in 0..POSITIONS {
        sum += i64::from(columns[i]) * i64::from(X_POWERS[a][i]);
    }
    sum
}

/// A moment of half voxels to that of 16 half voxels, with `bits` fraction bits. All monomials are within 1 then, so the bounds of
/// weights and products hold: both fit 32 bits, the matrix with its ridge too.
#[inline(always)]
fn scaled(moment: i64, bits: u32, degree: u32) -> i32 {
    let scaled = match bits.checked_sub(4 * degree) {
        Some(up) => moment << up,
        None => round_shift(moment, 4 * degree - bits),
    };
    debug_assert!(i32::try_from(scaled).is_ok(), "{scaled} in 32 bits");
    scaled as i32
}

/// Gaussian elimination without exchanges, as the matrix is symmetric and positive: coefficients in codes, with
/// [`COEFFICIENT_BITS`].
///
/// Entries and factors saturate at 32 bits. So products stay within `2^62` and nothing overflows, whatever the rounding does.
#[inline(always)]
fn solve(mut rows: [[i32; ROW]; TERMS]) -> [i32; TERMS] {
    let mut inverses = [(0, 0); TERMS];
    let mut factors = [[0; TERMS]; TERMS];
    for k in 0..TERMS {
        let (inverse, shift) = reciprocal(rows[k][k].max(RIDGE[k]));
        inverses[k] = (inverse, shift);
        let pivot_row = rows[k];
        for i in k + 1..TERMS {
            let factor = saturate(round_shift(i64::from(pivot_row[i]) * inverse, shift - FACTOR_BITS));
            factors[k][i] = factor;
            for j in 0..ROW {
                let change = round_shift(i64::from(factor) * i64::from(pivot_row[j]), FACTOR_BITS);
                rows[i][j] = saturate(i64::from(rows[i][j]) - change);
            }
        }
    }
    let mut solution = [0; TERMS];
    for k in (0..TERMS).rev() {
        let (inverse, shift) = inverses[k];
        // The right side has MATRIX_BITS - RIGHT_BITS fraction bits fewer than the pivot.
        let mut value =
            round_shift(i64::from(rows[k][TERMS]) * inverse, shift + RIGHT_BITS - MATRIX_BITS - SOLVE_BITS);
        for i in k + 1..TERMS {
            value -= round_shift(i64::from(factors[k][i]) * i64::from(solution[i]), FACTOR_BITS);
        }
        solution[k] = saturate(value);
    }
    solution.map(|value| {
        let rounded = round_shift(i64::from(value), SOLVE_BITS - COEFFICIENT_BITS);
        rounded.clamp(-COEFFICIENT_LIMIT, COEFFICIENT_LIMIT) as i32
    })
}

/// A number of `2^30` to `2^31` and a shift, 40 to 61: the first over 2 to the power of the second is `1 / pivot`.
#[inline(always)]
fn reciprocal(pivot: i32) -> (i64, u32) {
    let up = pivot.leading_zeros() - 1;
    ((1 << 61) / i64::from(pivot << up), 61 - up)
}

/// Writes the quadric's values at the voxels of the block.
#[inline(always)]
fn evaluate(quadric: &[i32; TERMS], limit: i32, out: &mut Block) {
    let [one, x1, y1, z1, xx, yy, zz, xy, xz, yz] = *quadric;
    let shift = COEFFICIENT_BITS + 8;
    for (row, values) in out.as_chunks_mut::<EDGE>().0.iter_mut().enumerate() {
        let [y, z] = [position(row % EDGE, 0), position(row / EDGE, 0)];
        let constant = 256 * one + 16 * (y1 * y + z1 * z) + yy * y * y + zz * z * z + yz * y * z;
        let slope = 16 * x1 + xy * y + xz * z;
        for (i, value) in values.iter_mut().enumerate() {
            let x = position(i, 0);
            let sum = constant + slope * x + xx * x * x;
            *value = ((sum + (1 << (shift - 1))) >> shift).clamp(-limit, limit) as i16;
        }
    }
}

/// Rounds half up and drops `shift` bits.
#[inline(always)]
fn round_shift(value: i64, shift: u32) -> i64 {
    (value + (1 << (shift - 1))) >> shift
}

/// The nearest 32-bit number.
#[inline(always)]
fn saturate(value: i64) -> i32 {
    value.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block8::SAMPLES;
    use isv_volume::SplitMix64;

    const MU: i16 = 2048;

    /// All 26 offsets.
    fn offsets() -> Vec<[i32; 3]> {
        (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]).filter(|d| *d != [0; 3]).collect()
    }

    /// A block of a field of positions in voxels from the predicted block's centre, in codes, clamped.
    fn block(field: &dyn Fn([f64; 3]) -> f64, offset: [i32; 3]) -> Vec<i16> {
        (0..SAMPLES)
            .map(|i| {
                let voxel = [i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE];
                let at = [0, 1, 2].map(|axis| f64::from(position(voxel[axis], offset[axis])) / 2.0);
                field(at).round().clamp(f64::from(-MU), f64::from(MU)) as i16
            })
            .collect()
    }

    fn fit(blocks: &[([i32; 3], Vec<i16>)]) -> SurfaceFit {
        let mut fit = SurfaceFit::new();
        blocks.iter().for_each(|(offset, samples)| fit.add_neighbour(*offset, samples));
        fit
    }

    /// Numbers of 0 to 1.
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut random = SplitMix64::new(seed);
        move || random.next_f64()
    }

    /// Prediction by the same fit in real numbers, in codes and without the clamp. Positions and samples are in voxels.
    fn real_prediction(blocks: &[([i32; 3], Vec<i16>)]) -> Option<Vec<f64>> {
        let basis = |[x, y, z]: [f64; 3]| [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z];
        let mut rows = [[0.0; TERMS + 1]; TERMS];
        for (i, row) in rows.iter_mut().enumerate() {
            row[i] = [1e-3, 0.02, 30.0][usize::from(i > 0) + usize::from(i > 3)];
        }
        let mut count = 0;
        for (offset, samples) in blocks {
            for (i, sample) in samples.iter().enumerate() {
                let voxel = [i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE];
                if (0..3).any(|axis| !near(offset[axis]).contains(&voxel[axis])) {
                    continue;
                }
                let at = [0, 1, 2].map(|axis| f64::from(position(voxel[axis], offset[axis])) / 2.0);
                let far = at.iter().fold(0.0, |far: f64, p| far.max(p.abs() - 3.5));
                let sample = f64::from(*sample) / 256.0;
                let weight = (-sample.abs() - far / 2.0).exp();
                if weight < 0.02 || sample.abs() > 4.0 {
                    continue;
                }
                count += 1;
                let q = basis(at);
                for i in 0..TERMS {
                    (0..TERMS).for_each(|j| rows[i][j] += weight * q[i] * q[j]);
                    rows[i][TERMS] += weight * q[i] * sample;
                }
            }
        }
        for k in 0..TERMS {
            let pivot_row = rows[k];
            for (_, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
                let factor = row[k] / pivot_row[k];
                (0..=TERMS).for_each(|j| row[j] -= factor * pivot_row[j]);
            }
        }
        let value = |i: usize| {
            let at = [i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE].map(|v| f64::from(position(v, 0)) / 2.0);
            (0..TERMS).map(|k| rows[k][TERMS] / rows[k][k] * basis(at)[k]).sum::<f64>() * 256.0
        };
        (count >= 8).then(|| (0..SAMPLES).map(value).collect())
    }

    /// Sum and largest of the differences from real numbers where those are within 1024 codes, and how many these are.
    fn difference(blocks: &[([i32; 3], Vec<i16>)]) -> (f64, f64, usize) {
        let Some(real) = real_prediction(blocks) else { return (0.0, 0.0, 0) };
        let mut out = [0; SAMPLES];
        assert!(fit(blocks).predict(MU, &mut out));
        let pairs = real.iter().zip(out).filter(|(real, _)| real.abs() < 1024.0);
        let differences: Vec<f64> = pairs.map(|(real, sample)| (f64::from(sample) - real).abs()).collect();
        (differences.iter().sum(), differences.iter().copied().fold(0.0, f64::max), differences.len())
    }

    /// A plane (kind 0), sphere (1) or cylinder (2) that passes near the block.
    fn shape(kind: usize, random: &mut impl FnMut() -> f64) -> Box<dyn Fn([f64; 3]) -> f64> {
        let mut signed = |scale: f64| (random() - 0.5) * 2.0 * scale;
        let direction = [signed(1.0), signed(1.0), signed(1.0)];
        let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
        let normal = direction.map(|d| d / length);
        let (distance, radius) = (signed(5.0), 4.0 + 40.0 * signed(1.0).powi(2));
        let centre = normal.map(|n| n * (distance + radius));
        let kept: [f64; 3] = if kind == 2 { [1.0, 1.0, 0.0] } else { [1.0; 3] };
        Box::new(move |p| {
            let along: f64 = (0..3).map(|i| p[i] * normal[i]).sum();
            let round: f64 =
                (0..3).map(|i| kept[i] * (p[i] - centre[i]).powi(2)).sum::<f64>().sqrt() - radius;
            256.0 * if kind == 0 { along - distance } else { round }
        })
    }

    /// Some of the neighbours of a block in a field, with noise of about that many codes.
    fn some_neighbours(
        field: &dyn Fn([f64; 3]) -> f64,
        noise: f64,
        random: &mut impl FnMut() -> f64,
    ) -> Vec<([i32; 3], Vec<i16>)> {
        let share = 0.05 + 0.5 * random();
        let chosen: Vec<[i32; 3]> = offsets().into_iter().filter(|_| random() < share).collect();
        let mut noisy = |sample: i16| {
            let error = (random() + random() - 1.0) * noise * 6f64.sqrt();
            (sample + error as i16).clamp(-MU, MU)
        };
        chosen.into_iter().map(|d| (d, block(field, d).into_iter().map(&mut noisy).collect())).collect()
    }

    #[test]
    fn fits_are_those_of_real_numbers() {
        for noise in [0.0, 20.0, 80.0] {
            let (mut sum, mut largest, mut voxels) = (0.0, 0.0, 0);
            for case in 0..600 {
                let mut random = random(case as u64 + 1);
                let field = shape(case % 3, &mut random);
                let (of_case, most, count) = difference(&some_neighbours(&field, noise, &mut random));
                (sum, largest, voxels) = (sum + of_case, f64::max(largest, most), voxels + count);
            }
            let mean = sum / voxels as f64;
            println!("noise {noise}: mean {mean:.3} codes, largest {largest:.1}, {voxels} voxels");
            assert!(voxels > 100_000 && mean < 0.5 && largest < 10.0, "noise {noise}: {mean}, {largest}");
        }
    }

    /// But for what the ridge pulls, 1/16 voxel at most.
    #[test]
    fn planes_are_continued() {
        let mut out = [0; SAMPLES];
        for (normal, distance) in [([0.0, 0.0, 1.0], 0.0), ([0.6, 0.0, 0.8], 1.5), ([-0.48, 0.6, 0.64], -2.0)]
        {
            let plane = |p: [f64; 3]| 256.0 * ((0..3).map(|i| p[i] * normal[i]).sum::<f64>() - distance);
            let faces = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]].map(|d| (d, block(&plane, d)));
            assert!(fit(&faces).predict(MU, &mut out));
            let real = real_prediction(&faces).unwrap();
            for (i, exact) in block(&plane, [0; 3]).into_iter().enumerate().filter(|(_, s)| s.abs() < 1024) {
                assert!((out[i] - exact).abs() <= 16, "{normal:?}: {} for {exact}", out[i]);
                assert!((f64::from(out[i]) - real[i]).abs() < 1.0, "{normal:?}: {} for {}", out[i], real[i]);
            }
        }
    }

    #[test]
    fn order_does_not_matter() {
        let mut random = random(7);
        let field = shape(1, &mut random);
        let mut blocks = some_neighbours(&field, 50.0, &mut random);
        assert!(blocks.len() > 2);
        let mut outs = [[0; SAMPLES]; 2];
        assert!(fit(&blocks).predict(MU, &mut outs[0]));
        blocks.reverse();
        blocks.rotate_left(1);
        assert!(fit(&blocks).predict(MU, &mut outs[1]));
        assert_eq!(outs[0], outs[1]);
    }

    /// Overflow checks are on in tests.
    #[test]
    fn hostile_samples_do_not_overflow() {
        let mut random = random(3);
        // Heaviest weights, largest products of weight and sample, the ends of the range and of the weights, noise.
        let ranges =
            [[0, 0], [256, 256], [-256, -256], [-256, 256], [-1, 1], [i16::MIN, i16::MAX], [i16::MIN; 2]];
        let more = [[873, 873], [-874, 873], [i16::MAX; 2], [-1001, 1001], [-300, 900]];
        for (case, [low, high]) in ranges.into_iter().chain(more).cycle().take(1200).enumerate() {
            let share = [1.0, 0.5, 0.1][case % 3];
            let mut sample = || match case / 12 % 3 {
                0 => [low, high][usize::from(random() < 0.5)],
                1 => (f64::from(low) + random() * (f64::from(high) - f64::from(low))).round() as i16,
                _ => [low, high, i16::MAX, i16::MIN][(random() * 4.0 * share) as usize],
            };
            let every = [1, 2, 7, 26][case / 36 % 4];
            let blocks: Vec<_> = offsets()
                .into_iter()
                .skip(case % every)
                .step_by(every)
                .map(|d| (d, (0..SAMPLES).map(|_| sample()).collect()))
                .collect();
            for limit in [0, 512, i16::MAX] {
                let mut out = [0; SAMPLES];
                fit(&blocks).predict(limit, &mut out);
                assert!(out.iter().all(|s| s.unsigned_abs() <= limit.unsigned_abs()));
            }
        }
    }

    /// Equations that no samples give: the solver's bounds are its own.
    #[test]
    fn the_solver_saturates() {
        let mut random = random(5);
        for case in 0..2000 {
            let mut rows = [[0; ROW]; TERMS];
            for entry in rows.as_flattened_mut() {
                *entry = match case % 3 {
                    0 => [i32::MIN, i32::MAX, 0, -1][(random() * 4.0) as usize],
                    1 => ((random() - 0.5) * 2f64.powi(32)) as i32,
                    _ => ((random() - 0.5) * 2f64.powf(32.0 * random())) as i32,
                };
            }
            let quadric = solve(rows);
            assert!(quadric.iter().all(|k| i64::from(k.abs()) <= COEFFICIENT_LIMIT));
        }
        for sign in [-1, 1] {
            let mut out = [0; SAMPLES];
            evaluate(&[sign * COEFFICIENT_LIMIT as i32; TERMS], i32::from(i16::MAX), &mut out);
            assert_eq!(out[SAMPLES - 1], sign as i16 * i16::MAX);
        }
    }

    #[test]
    fn too_few_voxels_are_no_prediction() {
        let mut samples = vec![2000; SAMPLES];
        samples[..7].fill(0);
        let mut out = [77; SAMPLES];
        assert!(!SurfaceFit::new().predict(MU, &mut out));
        assert!(!fit(&[([0, 1, 0], samples.clone())]).predict(MU, &mut out));
        assert_eq!(out, [77; SAMPLES]);
        samples[7] = -873;
        assert!(fit(&[([0, 1, 0], samples.clone())]).predict(MU, &mut out));
        samples[7] = -874;
        assert!(!fit(&[([0, 1, 0], samples)]).predict(MU, &mut out));
    }

    #[test]
    fn weights_are_exponentials() {
        for distance in 128..=FARTHEST {
            let exact = 2048.0 * (-f64::from(distance) / 256.0).exp();
            assert!((f64::from(weight(distance)) - exact).abs() < 5.0, "{distance}: {}", weight(distance));
        }
        assert_eq!([FARTHEST, FARTHEST + 1, 40_000].map(weight), [41, 0, 0]);
    }

    /// What [`SurfaceFit`] says of its bounds, by the heaviest weight and the largest product in each layer.
    #[test]
    fn sums_stay_within_their_bounds() {
        let heaviest = [0, 1, 2, 3, 4].map(|layer| i64::from(weight(128 * layer)));
        let largest = [0, 1, 2, 3, 4]
            .map(|layer| i64::from((0..FARTHEST).map(|s| weight(s + 128 * layer) * s).max().unwrap()));
        let positions = || (-15i64..=15).step_by(2);
        let (mut weights, mut products) = (0, 0);
        for x in positions() {
            let (mut column_weights, mut column_products) = ([0; 2], 0);
            for (y, z) in positions().flat_map(|y| positions().map(move |z| (y, z))) {
                let layer = (y.abs().max(z.abs()).max(x.abs()) - 7) / 2;
                if layer > 0 {
                    weights += heaviest[layer as usize];
                    products += largest[layer as usize];
                    column_weights[0] += heaviest[layer as usize] * y.pow(4);
                    column_weights[1] += heaviest[layer as usize] * y.pow(2) * z.pow(2);
                    column_products += largest[layer as usize] * y.pow(2);
                }
            }
            assert!(column_weights.iter().all(|sum| *sum < 3 << 29) && column_products < 3 << 29);
        }
        assert!(weights << MATRIX_BITS < (1 << 31) - (1 << 25) && products << RIGHT_BITS < 3 << 29);
    }

    /// The example of the format document.
    #[test]
    fn predictions_are_those_of_the_format_document() {
        let left = (0..512).map(|i| 90 * (i % 8) + 30 * (i / 8 % 8) - 60 * (i / 64) - 400).collect();
        let below = (0..512).map(|i| (i % 8 - 3) * (i / 8 % 8 - 4) * 9 + 200 * (i / 64) - 1100).collect();
        let mut out = [0; SAMPLES];
        assert!(fit(&[([-1, 0, 0], left), ([0, 1, -1], below)]).predict(1024, &mut out));
        assert_eq!(out[..8], [171, 198, 219, 234, 245, 250, 250, 244]);
        assert_eq!(out[504..], [170, 290, 405, 515, 620, 719, 813, 902]);
    }
}
