//! Integer 3-D DCT of a block of prediction residuals, and its inverse.
//!
//! Separable: an N-point DCT-II with a 13-bit matrix along x, then y, then z; the inverse runs z, y, x. Every pass reads and
//! writes 16-bit values and accumulates in 32 bits. A row's absolute entries sum to at most `sqrt(N) * 2^13`, so an accumulator
//! stays within `4 * 2^13 * 2^15 = 2^30`. Between passes values are rescaled by powers of two that keep the largest possible
//! residual just inside 16 bits. Larger values saturate (only a stream that no encoder makes reaches that).

use crate::simd::vectorized;
use isv_volume::{BlockEdge, Truncation};

/// Fractional bits of the transform matrix.
const MATRIX_BITS: i32 = 13;

/// `round(2^13 * sqrt(2/N) * cos(j pi / 2N))` for `j = 0 ..= N`: every entry of the N-point matrix up to sign.
/// Test `matrix_is_the_rounded_dct` recomputes them.
const COSINES_4: [i16; 5] = [5793, 5352, 4096, 2217, 0];
const COSINES_8: [i16; 9] = [4096, 4017, 3784, 3406, 2896, 2276, 1567, 799, 0];
const COSINES_16: [i16; 17] =
    [2896, 2882, 2841, 2772, 2676, 2554, 2408, 2239, 2048, 1837, 1609, 1365, 1108, 841, 565, 284, 0];

const MATRIX_4: [[i16; 4]; 4] = matrix(&COSINES_4);
const MATRIX_8: [[i16; 8]; 8] = matrix(&COSINES_8);
const MATRIX_16: [[i16; 16]; 16] = matrix(&COSINES_16);

/// Unfolds the cosine table of the N-point matrix: entry `(k, n)` is `cos((2n + 1) k pi / 2N)`, and row 0 is `cos(pi / 4)`.
///
/// With M below N these are the first M rows. They are taken not at N voxels but at the centres of M groups of N / M voxels:
/// `cos((2n + 1) k pi / 2M)`. The table has all of these values.
const fn matrix<const M: usize>(cosines: &[i16]) -> [[i16; M]; M] {
    let points = cosines.len() - 1;
    let mut rows = [[0; M]; M];
    let mut n = 0;
    while n < M {
        rows[0][n] = cosines[points / 2];
        let mut k = 1;
        while k < M {
            let angle = (2 * n + 1) * k * (points / M) % (4 * points);
            let folded = if angle > 2 * points { 4 * points - angle } else { angle };
            rows[k][n] = if folded > points { -cosines[2 * points - folded] } else { cosines[folded] };
            k += 1;
        }
        n += 1;
    }
    rows
}

/// The transform of one block edge and truncation distance.
///
/// Coefficients are `2^coefficient_exponent` times those of the orthonormal DCT-II.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockTransform {
    edge: BlockEdge,
    /// `exponents[p]`: after `p` forward passes values are `2^exponents[p]` times the orthonormal ones.
    exponents: [i32; 4],
}

impl BlockTransform {
    /// Chooses the scale after each pass: the largest power of two that keeps the largest residual within 32767. That residual is
    /// twice the truncation distance, and grows by at most `sqrt(N)` a pass.
    #[must_use]
    pub fn new(edge: BlockEdge, truncation: Truncation) -> Self {
        let largest_squared = (2 * i64::from(truncation.codes())).pow(2);
        let n = edge.voxels() as i64;
        let mut exponents = [0; 4];
        for (pass, exponent) in exponents.iter_mut().enumerate().skip(1) {
            let bound_squared = largest_squared * n.pow(pass as u32);
            // 4^e bound^2 <= 32767^2, with 4^-6 .. 4^6 moved to the side where it is whole.
            *exponent = (-6..=6)
                .rev()
                .find(|e| bound_squared << (2 * e + 12) <= (32767i64 * 32767) << 12)
                .expect("residuals of 8192 in 16^3 blocks need an exponent of -5");
        }
        Self { edge, exponents }
    }

    /// Base-2 logarithm of a coefficient's scale relative to the orthonormal DCT.
    #[must_use]
    pub fn coefficient_exponent(&self) -> i32 {
        self.exponents[3]
    }

    /// Edge of the blocks.
    #[must_use]
    pub fn edge(&self) -> BlockEdge {
        self.edge
    }

    /// Forward transform in place: residuals `[z][y][x]` become coefficients `[w][v][u]`, u along x.
    ///
    /// Residuals lie within twice the truncation distance. The transform and its inverse together return a block of edge 8 within
    /// 9 codes (root mean square 2). Coefficients are stored in units of 4 codes there, which is what that error is. Test
    /// `roundtrip_error_is_as_documented` has all edges.
    ///
    /// # Panics
    /// If `block` does not hold `edge^3` values.
    pub fn forward(&self, block: &mut [i16]) {
        assert_eq!(block.len(), self.edge.block_voxels());
        let shifts = self.forward_shifts();
        vectorized(
            #[inline(always)]
            || match self.edge {
                BlockEdge::E4 => forward(&MATRIX_4, block, shifts),
                BlockEdge::E8 => forward(&MATRIX_8, block, shifts),
                BlockEdge::E16 => forward(&MATRIX_16, block, shifts),
            },
        );
    }

    /// Inverse transform in place: coefficients `[w][v][u]` become residuals `[z][y][x]`. Defined, by saturation, for
    /// any coefficients whatever.
    ///
    /// # Panics
    /// If `block` does not hold `edge^3` values.
    pub fn inverse(&self, block: &mut [i16]) {
        assert_eq!(block.len(), self.edge.block_voxels());
        let shifts = self.inverse_shifts();
        vectorized(
            #[inline(always)]
            || match self.edge {
                BlockEdge::E4 => inverse(&MATRIX_4, block, shifts),
                BlockEdge::E8 => inverse(&MATRIX_8, block, shifts),
                BlockEdge::E16 => inverse(&MATRIX_16, block, shifts),
            },
        );
    }

    /// Bits to drop after each forward pass: along x, y and z.
    #[must_use]
    pub fn forward_shifts(&self) -> [u32; 3] {
        [0, 1, 2].map(|pass| (MATRIX_BITS - self.exponents[pass + 1] + self.exponents[pass]) as u32)
    }

    /// Bits to drop after each inverse pass: along z, y and x.
    #[must_use]
    pub fn inverse_shifts(&self) -> [u32; 3] {
        [0, 1, 2].map(|pass| (MATRIX_BITS - self.exponents[2 - pass] + self.exponents[3 - pass]) as u32)
    }
}

/// Inverse transform at reduced resolution. The lowest `(edge >> reduction)^3` coefficients of a block give its samples at the
/// centres of cubes of `2^reduction` voxels a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReducedTransform {
    full: BlockTransform,
    reduction: u32,
}

impl ReducedTransform {
    /// Largest reduction: blocks of 4 come down to one sample.
    pub const MAX_REDUCTION: u32 = 2;

    /// The reduced inverse of a transform.
    ///
    /// # Panics
    /// If `reduction` is above [`Self::MAX_REDUCTION`].
    #[must_use]
    pub fn new(full: BlockTransform, reduction: u32) -> Self {
        assert!(reduction <= Self::MAX_REDUCTION, "reduction by 2^{reduction}");
        Self { full, reduction }
    }

    /// Samples along an edge of a reduced block: 1, 2, 4, 8 or 16.
    #[must_use]
    pub fn side(&self) -> usize {
        self.full.edge.voxels() >> self.reduction
    }

    /// Inverse transform in place: coefficients `[w][v][u]`, as many along each axis as [`Self::side`], become residuals
    /// `[z][y][x]` in codes of the larger voxel. Defined, by saturation, for any coefficients whatever.
    ///
    /// # Panics
    /// If `block` does not hold `side^3` values.
    pub fn inverse(&self, block: &mut [i16]) {
        assert_eq!(block.len(), self.side().pow(3));
        let [first, second, third] = self.full.inverse_shifts();
        // A larger voxel has as many codes as a small one, so the same distance has fewer.
        let shifts = [first, second, third + self.reduction];
        vectorized(
            #[inline(always)]
            || match (self.full.edge, self.reduction) {
                (BlockEdge::E4, 0) => inverse(&MATRIX_4, block, shifts),
                (BlockEdge::E4, 1) => inverse(&const { matrix::<2>(&COSINES_4) }, block, shifts),
                (BlockEdge::E4, _) => inverse(&const { matrix::<1>(&COSINES_4) }, block, shifts),
                (BlockEdge::E8, 0) => inverse(&MATRIX_8, block, shifts),
                (BlockEdge::E8, 1) => inverse(&const { matrix::<4>(&COSINES_8) }, block, shifts),
                (BlockEdge::E8, _) => inverse(&const { matrix::<2>(&COSINES_8) }, block, shifts),
                (BlockEdge::E16, 0) => inverse(&MATRIX_16, block, shifts),
                (BlockEdge::E16, 1) => inverse(&const { matrix::<8>(&COSINES_16) }, block, shifts),
                (BlockEdge::E16, _) => inverse(&const { matrix::<4>(&COSINES_16) }, block, shifts),
            },
        );
    }
}

/// Rounds half up, drops `shift` bits and saturates to 16 bits.
#[inline(always)]
fn round_shift(sum: i32, shift: u32) -> i16 {
    ((sum + (1 << (shift - 1))) >> shift).clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
}

/// Samples are hardly ever zero, so nothing is looked for that could be passed over.
#[inline(always)]
fn forward<const N: usize>(matrix: &[[i16; N]; N], block: &mut [i16], shifts: [u32; 3]) {
    let transposed = transpose(matrix);
    rows_pass(&transposed, block, N, shifts[0]);
    for plane in block.chunks_exact_mut(N * N) {
        columns_pass::<N, false>(matrix, plane, N, N, shifts[1]);
    }
    columns_pass::<N, false>(matrix, block, N * N, N, shifts[2]);
}

/// Most coefficients are zero, those of high frequencies above all.
#[inline(always)]
fn inverse<const N: usize>(matrix: &[[i16; N]; N], block: &mut [i16], shifts: [u32; 3]) {
    let transposed = transpose(matrix);
    let used = used_layers::<N>(block, N * N);
    columns_pass::<N, true>(&transposed, block, N * N, used, shifts[0]);
    for plane in block.chunks_exact_mut(N * N) {
        let used = used_layers::<N>(plane, N);
        columns_pass::<N, true>(&transposed, plane, N, used, shifts[1]);
    }
    rows_pass(matrix, block, used_values::<N>(block), shifts[2]);
}

#[inline(always)]
fn transpose<const N: usize>(matrix: &[[i16; N]; N]) -> [[i16; N]; N] {
    std::array::from_fn(|n| std::array::from_fn(|k| matrix[k][n]))
}

/// One pass along x: each run of N values `v`, zero from value `used` on, becomes `out[j] = sum_i v[i] * weights[i][j]`.
#[inline(always)]
fn rows_pass<const N: usize>(weights: &[[i16; N]; N], block: &mut [i16], used: usize, shift: u32) {
    for row in block.as_chunks_mut::<N>().0 {
        let mut sums = [0i32; N];
        for i in 0..used {
            let value = i32::from(row[i]);
            for j in 0..N {
                sums[j] += value * i32::from(weights[i][j]);
            }
        }
        for j in 0..N {
            row[j] = round_shift(sums[j], shift);
        }
    }
}

/// From which value on all runs of N values are zero.
#[inline(always)]
fn used_values<const N: usize>(block: &[i16]) -> usize {
    let mut any = [0; N];
    for row in block.as_chunks::<N>().0 {
        for i in 0..N {
            any[i] |= row[i];
        }
    }
    N - any.iter().rev().take_while(|any| **any == 0).count()
}

/// From which of N layers of `layer` values on all are zero.
#[inline(always)]
fn used_layers<const N: usize>(block: &[i16], layer: usize) -> usize {
    let is_zero = |values: &&[i16]| {
        let mut any = 0;
        for value in *values {
            any |= value;
        }
        any == 0
    };
    N - block.chunks_exact(layer).rev().take_while(is_zero).count()
}

/// One pass across N layers of `layer` values each, zero from layer `used` on, lane by lane: `out[j] = sum_i weights[j][i] *
/// layer_i`. `SPARSE`: whether to look for runs of N lanes that are zero in all layers, which then cost nothing.
#[inline(always)]
fn columns_pass<const N: usize, const SPARSE: bool>(
    weights: &[[i16; N]; N],
    block: &mut [i16],
    layer: usize,
    used: usize,
    shift: u32,
) {
    for start in (0..layer).step_by(N) {
        let (mut input, mut any) = ([[0i32; N]; N], [0; N]);
        for i in 0..used {
            let lanes = &block[i * layer + start..][..N];
            for lane in 0..N {
                input[i][lane] = i32::from(lanes[lane]);
                any[lane] |= lanes[lane];
            }
        }
        if SPARSE && any == [0; N] {
            continue;
        }
        for j in 0..N {
            let mut sums = [0i32; N];
            for i in 0..used {
                let weight = i32::from(weights[j][i]);
                for lane in 0..N {
                    sums[lane] += weight * input[i][lane];
                }
            }
            let lanes = &mut block[j * layer + start..][..N];
            for lane in 0..N {
                lanes[lane] = round_shift(sums[lane], shift);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::SplitMix64;
    use std::f64::consts::PI;

    const EDGES: [BlockEdge; 3] = [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16];

    fn transform(edge: BlockEdge, voxels: u32) -> BlockTransform {
        BlockTransform::new(edge, Truncation::from_voxels(voxels).unwrap())
    }

    /// Orthonormal DCT-II basis value, from the definition.
    fn basis(n: usize, k: usize, x: usize) -> f64 {
        let scale = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 }.sqrt();
        scale * ((2 * x + 1) as f64 * k as f64 * PI / (2 * n) as f64).cos()
    }

    /// 3-D DCT from the definition, in f64: `n^6` products.
    fn slow_forward(n: usize, block: &[i16]) -> Vec<f64> {
        let mut out = Vec::with_capacity(block.len());
        for w in 0..n {
            for v in 0..n {
                for u in 0..n {
                    let mut sum = 0.0;
                    for (i, sample) in block.iter().enumerate() {
                        let (x, y, z) = (i % n, i / n % n, i / n / n);
                        sum += f64::from(*sample) * basis(n, u, x) * basis(n, v, y) * basis(n, w, z);
                    }
                    out.push(sum);
                }
            }
        }
        out
    }

    /// A number up to an amplitude; every test seeds its generator with a constant.
    fn noise(random: &mut SplitMix64, amplitude: i32) -> i16 {
        (random.next_u64() % (2 * amplitude as u64 + 1)) as i16 - amplitude as i16
    }

    #[test]
    fn few_coefficients_cost_less_and_give_the_same() {
        let transform = transform(BlockEdge::E8, 8);
        let shifts = transform.inverse_shifts();
        let pass = |block: &[i16; 512], stride: usize, shift: u32| -> [i16; 512] {
            std::array::from_fn(|i| {
                let (place, start) = (i / stride % 8, i - i / stride % 8 * stride);
                let sum =
                    (0..8).map(|k| i32::from(MATRIX_8[k][place]) * i32::from(block[start + k * stride]));
                round_shift(sum.sum(), shift)
            })
        };
        let mut random = SplitMix64::new(7);
        for count in 0..20 {
            let mut coefficients = [0; 512];
            for _ in 0..count {
                coefficients[usize::from(noise(&mut random, 4096).unsigned_abs()) % 512] =
                    noise(&mut random, 16000);
            }
            let expected = pass(&coefficients, 64, shifts[0]);
            let expected = pass(&pass(&expected, 8, shifts[1]), 1, shifts[2]);
            transform.inverse(&mut coefficients);
            assert!(coefficients == expected, "{count} coefficients");
        }
    }

    #[test]
    fn matrix_is_the_rounded_dct() {
        fn check<const N: usize>(matrix: &[[i16; N]; N]) {
            for k in 0..N {
                for x in 0..N {
                    assert_eq!(
                        f64::from(matrix[k][x]),
                        (8192.0 * basis(N, k, x)).round(),
                        "row {k} column {x}"
                    );
                }
            }
        }
        check(&MATRIX_4);
        check(&MATRIX_8);
        check(&MATRIX_16);
    }

    #[test]
    fn accumulators_stay_inside_31_bits() {
        fn largest_sum<const N: usize>(matrix: &[[i16; N]; N]) -> i64 {
            let rows = matrix.iter().map(|r| r.iter().map(|v| i64::from(v.abs())).sum::<i64>());
            let columns = (0..N).map(|n| matrix.iter().map(|r| i64::from(r[n].abs())).sum::<i64>());
            rows.chain(columns).max().unwrap() * 32768
        }
        for sum in [largest_sum(&MATRIX_4), largest_sum(&MATRIX_8), largest_sum(&MATRIX_16)] {
            assert!(sum + (1 << 18) < 1 << 31, "{sum}");
        }
    }

    #[test]
    fn scales_for_the_papers_block_and_band() {
        assert_eq!(transform(BlockEdge::E8, 8).exponents, [0, 1, -1, -2]);
        assert_eq!(transform(BlockEdge::E16, 16).exponents, [0, -1, -3, -5]);
    }

    #[test]
    fn forward_agrees_with_the_definition() {
        for edge in [BlockEdge::E4, BlockEdge::E8] {
            let transform = transform(edge, 8);
            let scale = 2f64.powi(transform.coefficient_exponent());
            let mut random = SplitMix64::new(1);
            for amplitude in [40, 300, 4096] {
                let block: Vec<i16> =
                    (0..edge.block_voxels()).map(|_| noise(&mut random, amplitude)).collect();
                let exact = slow_forward(edge.voxels(), &block);
                let mut fast = block.clone();
                transform.forward(&mut fast);
                let worst = exact
                    .iter()
                    .zip(&fast)
                    .map(|(e, f)| (e * scale - f64::from(*f)).abs())
                    .fold(0.0, f64::max);
                assert!(worst <= 4.0, "edge {edge:?}, amplitude {amplitude}: {worst} units");
            }
        }
    }

    #[test]
    fn roundtrip_error_is_as_documented() {
        // Worst and root-mean-square error in codes over 100 blocks of noise and 100 of full-scale checks, seed 7.
        for (edge, worst_allowed, rms_allowed) in
            [(EDGES[0], 6.0, 1.5), (EDGES[1], 9.0, 2.0), (EDGES[2], 32.0, 5.5)]
        {
            let transform = transform(edge, 8);
            let (mut worst, mut squares, mut count, mut random) = (0f64, 0f64, 0f64, SplitMix64::new(7));
            for round in 0..200 {
                let block: Vec<i16> = (0..edge.block_voxels())
                    .map(|_| {
                        if round % 2 == 0 {
                            noise(&mut random, 300)
                        } else {
                            noise(&mut random, 1).signum() * 4096
                        }
                    })
                    .collect();
                let mut back = block.clone();
                transform.forward(&mut back);
                transform.inverse(&mut back);
                for (a, b) in block.iter().zip(&back) {
                    let error = f64::from(a - b);
                    worst = worst.max(error.abs());
                    squares += error * error;
                    count += 1.0;
                }
            }
            let rms = (squares / count).sqrt();
            println!("{edge:?}: worst {worst} codes, rms {rms:.2}");
            assert!(worst <= worst_allowed && rms <= rms_allowed, "{edge:?}: worst {worst}, rms {rms}");
        }
    }

    /// The cosine series of a block's lowest coefficients, at the centres of cubes of voxels, from the definition.
    #[test]
    fn the_reduced_inverse_is_the_series_at_the_centres() {
        for (edge, reduction) in EDGES.into_iter().flat_map(|edge| [0, 1, 2].map(|r| (edge, r))) {
            let full = transform(edge, 8);
            let reduced = ReducedTransform::new(full, reduction);
            let (n, m) = (edge.voxels(), reduced.side());
            let unit = 2f64.powi(-full.coefficient_exponent());
            let mut random = SplitMix64::new(5);
            let coefficients: Vec<i16> = (0..m.pow(3)).map(|_| noise(&mut random, 1000 / m as i32)).collect();
            let mut samples = coefficients.clone();
            reduced.inverse(&mut samples);
            let at = |k: usize, j: usize| {
                let centre = (j as f64 + 0.5) * f64::from(1 << reduction) - 0.5;
                let scale = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 }.sqrt();
                scale * ((2.0 * centre + 1.0) * k as f64 * PI / (2 * n) as f64).cos()
            };
            let rows: Vec<Vec<f64>> = (0..m).map(|j| (0..m).map(|k| at(k, j)).collect()).collect();
            for (i, sample) in samples.iter().enumerate() {
                let [x, y, z] = [i % m, i / m % m, i / m / m].map(|j| &rows[j]);
                let term = |(j, c): (usize, &i16)| f64::from(*c) * x[j % m] * y[j / m % m] * z[j / m / m];
                let exact =
                    coefficients.iter().enumerate().map(term).sum::<f64>() * unit / f64::from(1 << reduction);
                let bound = if edge == BlockEdge::E16 { 12.0 } else { 3.0 };
                assert!((exact - f64::from(*sample)).abs() < bound, "{edge:?} / {m}: {sample} for {exact}");
            }
        }
    }

    #[test]
    fn inverse_saturates_on_hostile_coefficients() {
        for edge in EDGES {
            for value in [i16::MIN, i16::MAX] {
                let mut block = vec![value; edge.block_voxels()];
                transform(edge, 16).inverse(&mut block);
                for reduction in 0..=ReducedTransform::MAX_REDUCTION {
                    let reduced = ReducedTransform::new(transform(edge, 16), reduction);
                    reduced.inverse(&mut vec![value; reduced.side().pow(3)]);
                }
            }
        }
    }
}
