//! Motion-compensated block warping: resampling the reference at a block's rigidly moved voxel centres (Sec. 3.5, Fig. 7).
//!
//! Positions are kept in 1/64 voxel, so trilinear interpolation of samples within +-4096 codes needs
//! `12 + 3 * 6 = 30` bits and is exact up to one final rounding.

use crate::reduced_warp::Cube;
use crate::simd::vectorized;
use isv_volume::BlockEdge;

/// Sample positions are whole multiples of 1/64 voxel.
const POSITION_BITS: u32 = 6;
/// Half of the weights' sum.
const ROUNDING: i32 = 1 << (3 * POSITION_BITS - 1);
/// One step of a translation component is a quarter voxel.
pub const STEPS_PER_VOXEL: i32 = 4;
/// One step of a rotation component is 1/32 radian.
pub const STEPS_PER_RADIAN: i32 = 32;
/// Largest rotation component in steps: one radian.
pub const ROTATION_LIMIT: i32 = STEPS_PER_RADIAN;

const ANGLE_BITS: u32 = 14;

/// `round(2^14 * sin(i / 32))` for `i = 0 ..= 32`; test `angle_tables_are_rounded_sines` recomputes both tables.
const SINES: [i16; 33] = [
    0, 512, 1023, 1534, 2043, 2550, 3054, 3555, 4053, 4547, 5037, 5522, 6001, 6474, 6942, 7402, 7855, 8300,
    8738, 9166, 9586, 9997, 10397, 10788, 11168, 11537, 11895, 12241, 12575, 12897, 13207, 13503, 13787,
];
/// `round(2^14 * cos(i / 32))`.
const COSINES: [i16; 33] = [
    16384, 16376, 16352, 16312, 16256, 16184, 16097, 15994, 15875, 15740, 15590, 15425, 15245, 15050, 14841,
    14617, 14378, 14126, 13860, 13580, 13287, 12981, 12662, 12331, 11988, 11633, 11267, 10890, 10502, 10104,
    9696, 9279, 8852,
];

/// Rigid motion of one block: where in the reference its samples come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotionVector {
    /// Translation `[x, y, z]` in quarter voxels.
    pub translation: [i8; 3],
    /// Rotation about the block's centre, Euler angles `[x, y, z]` in 1/32 radian, applied in that order.
    pub rotation: [i8; 3],
}

impl MotionVector {
    /// No motion.
    pub const ZERO: Self = Self { translation: [0; 3], rotation: [0; 3] };

    /// Largest translation component for a block edge, in steps: one voxel less than the edge. So a translated block and the far
    /// corners of its interpolation cells stay inside the stitched neighbourhood.
    #[must_use]
    pub fn translation_limit(edge: BlockEdge) -> i32 {
        (edge.voxels() as i32 - 1) * STEPS_PER_VOXEL
    }

    /// Whether every component is within its limit.
    #[must_use]
    pub fn in_range(&self, edge: BlockEdge) -> bool {
        let limit = Self::translation_limit(edge);
        self.translation.iter().all(|t| i32::from(*t).abs() <= limit)
            && self.rotation.iter().all(|r| i32::from(*r).abs() <= ROTATION_LIMIT)
    }

    /// Rotation matrix `Rz Ry Rx`, entries times `2^14`, each product of two rounded back to 14 bits.
    #[must_use]
    pub fn rotation_matrix(&self) -> [[i32; 3]; 3] {
        let sine = |r: i8| i32::from(SINES[r.unsigned_abs() as usize]) * i32::from(r.signum());
        let cosine = |r: i8| i32::from(COSINES[r.unsigned_abs() as usize]);
        let product = |a: i32, b: i32| (a * b + (1 << (ANGLE_BITS - 1))) >> ANGLE_BITS;
        let [sx, sy, sz] = self.rotation.map(sine);
        let [cx, cy, cz] = self.rotation.map(cosine);
        let (sysx, sycx) = (product(sy, sx), product(sy, cx));
        [
            [product(cz, cy), product(cz, sysx) - product(sz, cx), product(cz, sycx) + product(sz, sx)],
            [product(sz, cy), product(sz, sysx) + product(cz, cx), product(sz, sycx) - product(cz, sx)],
            [-sy, product(cy, sx), product(cy, cx)],
        ]
    }
}

/// A block's 3x3x3 neighbourhood in the reference, stitched into one cube of `3 * edge` voxels a side, x fastest.
/// The block itself begins at `(edge, edge, edge)`.
///
/// At a reduced resolution the edge counts larger voxels, and may be 1 or 2; motion vectors still count the stream's.
#[derive(Clone, Debug)]
pub struct StitchedReference {
    edge: BlockEdge,
    /// Base-2 logarithm of the stream's voxels to one here.
    reduction: u32,
    samples: Vec<i16>,
}

impl StitchedReference {
    /// A neighbourhood of zeros.
    #[must_use]
    pub fn new(edge: BlockEdge) -> Self {
        Self::reduced(edge, 0)
    }

    /// A neighbourhood of zeros in voxels of `2^reduction` times the size.
    ///
    /// # Panics
    /// If a block has no such voxel.
    #[must_use]
    pub fn reduced(edge: BlockEdge, reduction: u32) -> Self {
        assert!(reduction <= edge.log2(), "a block of {} has no voxel of 2^{reduction}", edge.voxels());
        Self { edge, reduction, samples: vec![0; 27 * (edge.voxels() >> reduction).pow(3)] }
    }

    /// Edge of the stream's blocks, which bounds motion vectors.
    #[must_use]
    pub fn edge(&self) -> BlockEdge {
        self.edge
    }

    /// Voxels along an edge of a block.
    #[must_use]
    pub fn block_side(&self) -> usize {
        self.edge.voxels() >> self.reduction
    }

    /// Edge of the cube in voxels.
    #[must_use]
    pub fn side(&self) -> usize {
        3 * self.block_side()
    }

    /// All samples, x fastest.
    #[must_use]
    pub fn samples(&self) -> &[i16] {
        &self.samples
    }

    /// Copies a block into slot `(dz + 1) * 9 + (dy + 1) * 3 + (dx + 1)` of the neighbourhood.
    pub fn put_block(&mut self, slot: usize, block: &[i16]) {
        let n = self.block_side();
        for (row, values) in block.chunks_exact(n).enumerate() {
            let start = self.row_start(slot, row);
            self.samples[start..start + n].copy_from_slice(values);
        }
    }

    /// Fills a slot with one value.
    pub fn fill_block(&mut self, slot: usize, value: i16) {
        let n = self.block_side();
        for row in 0..n * n {
            let start = self.row_start(slot, row);
            self.samples[start..start + n].fill(value);
        }
    }

    /// Index of the first sample of row `row = z * edge + y` of a slot.
    fn row_start(&self, slot: usize, row: usize) -> usize {
        let (n, side) = (self.block_side(), self.side());
        let (sx, sy, sz) = (slot % 3, slot / 3 % 3, slot / 9);
        ((sz * n + row / n) * side + sy * n + row % n) * side + sx * n
    }

    /// The block's motion-compensated prediction: its `edge^3` samples, x fastest, taken at the moved positions.
    ///
    /// Position of voxel `p` in 1/64 voxel, from the cube's first voxel: `64 (edge + c) + 16 t + R (p - c) * 64`, with `c` the
    /// block's centre `(edge - 1) / 2`. The rotated part is rounded half up, and the position is clamped into the cube. In voxels
    /// of `2^reduction` times the size `16 t` is as many times less, which is still whole. Samples there can exceed those of the
    /// reference, by a quarter along each axis.
    ///
    /// # Panics
    /// If `out` does not hold a block or `motion` is out of range.
    pub fn warp(&self, motion: MotionVector, out: &mut [i16]) {
        assert!(out.len() == self.block_side().pow(3) && motion.in_range(self.edge));
        if motion == MotionVector::ZERO {
            self.copy_centre(out);
        } else if motion.rotation == [0; 3] {
            self.translate(motion.translation, out);
        } else {
            self.rotate_and_translate(motion, out);
        }
    }

    /// A step of a translation in 1/64 voxel: a quarter of the stream's voxel.
    fn step(&self) -> i32 {
        ((1 << POSITION_BITS) / STEPS_PER_VOXEL) >> self.reduction
    }

    /// [`Self::warp`] without motion: the block itself.
    fn copy_centre(&self, out: &mut [i16]) {
        let n = self.block_side();
        for (row, values) in out.chunks_exact_mut(n).enumerate() {
            values.copy_from_slice(&self.samples[self.row_start(13, row)..][..n]);
        }
    }

    /// [`Self::warp`] with one fraction for all voxels.
    fn translate(&self, translation: [i8; 3], out: &mut [i16]) {
        if let Some(cube) = self.reduced_cube() {
            let side = self.block_side();
            let origin = translation.map(|t| ((side as i32) << POSITION_BITS) + i32::from(t) * self.step());
            return cube.translate(origin, side, out);
        }
        vectorized(
            #[inline(always)]
            || match self.edge {
                BlockEdge::E4 => self.translate_sized::<4>(translation, out),
                BlockEdge::E8 => self.translate_sized::<8>(translation, out),
                BlockEdge::E16 => self.translate_sized::<16>(translation, out),
            },
        );
    }

    #[inline(always)]
    fn translate_sized<const N: usize>(&self, translation: [i8; 3], out: &mut [i16]) {
        let quarter = (1 << POSITION_BITS) / STEPS_PER_VOXEL;
        let origin = translation.map(|t| ((N as i32) << POSITION_BITS) + i32::from(t) * quarter);
        let [x, y, z] = origin.map(|o| (o >> POSITION_BITS) as usize);
        let weights = corner_weights(origin.map(|o| o & ((1 << POSITION_BITS) - 1)));
        let side = self.side();
        for (row, values) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
            let start = ((z + row / N) * side + y + row % N) * side + x;
            let mut sums = [ROUNDING; N];
            for (edge, offset) in [0, side, side * side, side * side + side].into_iter().enumerate() {
                let samples = &self.samples[start + offset..][..=N];
                for lane in 0..N {
                    sums[lane] += i32::from(samples[lane]) * weights[2 * edge];
                    sums[lane] += i32::from(samples[lane + 1]) * weights[2 * edge + 1];
                }
            }
            for lane in 0..N {
                values[lane] = (sums[lane] >> (3 * POSITION_BITS)) as i16;
            }
        }
    }

    fn rotate_and_translate(&self, motion: MotionVector, out: &mut [i16]) {
        let n = self.block_side() as i32;
        let rotation = motion.rotation_matrix();
        let centre = motion.translation.map(|t| n * 64 + (n - 1) * 32 + i32::from(t) * self.step());
        let limit = ((self.side() as i32 - 1) << POSITION_BITS) - 1;
        let mut voxel = 0;
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    // Twice the offset from the centre, so that it is whole; 2^14 * 32 of it is 64 voxels' sixty-fourths.
                    let offset = [2 * x + 1 - n, 2 * y + 1 - n, 2 * z + 1 - n];
                    let position: [i32; 3] = std::array::from_fn(|axis| {
                        let dot: i32 = (0..3).map(|k| rotation[axis][k] * offset[k]).sum();
                        let rotated = (dot * 32 + (1 << (ANGLE_BITS - 1))) >> ANGLE_BITS;
                        (centre[axis] + rotated).clamp(0, limit)
                    });
                    out[voxel] = self.sample(position);
                    voxel += 1;
                }
            }
        }
    }

    /// The cube, if it is one of larger voxels.
    fn reduced_cube(&self) -> Option<Cube<'_>> {
        let cube = Cube { samples: &self.samples, side: self.side(), reduction: self.reduction };
        (self.reduction > 0).then_some(cube)
    }

    /// Trilinear sample at a position in 1/64 voxel inside the cube; at reduced resolution, what stands for it there.
    fn sample(&self, position: [i32; 3]) -> i16 {
        if let Some(cube) = self.reduced_cube() {
            return cube.at(position);
        }
        let side = self.side();
        let [x, y, z] = position.map(|p| (p >> POSITION_BITS) as usize);
        let start = (z * side + y) * side + x;
        let corners = std::array::from_fn(|c| {
            self.samples[start
                + (c & 1)
                + if c & 2 != 0 { side } else { 0 }
                + if c & 4 != 0 { side * side } else { 0 }]
        });
        interpolate(&corners, &corner_weights(position.map(|p| p & ((1 << POSITION_BITS) - 1))))
    }
}

/// Weights of the eight corners of a cell, x in the lowest bit of the corner number; they sum to `2^18`.
fn corner_weights(fraction: [i32; 3]) -> [i32; 8] {
    let one = 1 << POSITION_BITS;
    std::array::from_fn(|corner| {
        (0..3)
            .map(|axis| if corner >> axis & 1 != 0 { fraction[axis] } else { one - fraction[axis] })
            .product()
    })
}

/// Weighted mean of the corners, halves up. Corners within +-4096 keep the sum inside 31 bits.
fn interpolate(corners: &[i16; 8], weights: &[i32; 8]) -> i16 {
    let sum: i32 = corners.iter().zip(weights).map(|(c, w)| i32::from(*c) * w).sum();
    ((sum + ROUNDING) >> (3 * POSITION_BITS)) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGES: [BlockEdge; 3] = [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16];

    /// A neighbourhood whose samples are `field(x, y, z)`, coordinates in voxels from the block's own first voxel.
    fn stitched(edge: BlockEdge, field: impl Fn(f64, f64, f64) -> f64) -> StitchedReference {
        stitched_reduced(edge, 0, field)
    }

    fn stitched_reduced(
        edge: BlockEdge,
        reduction: u32,
        field: impl Fn(f64, f64, f64) -> f64,
    ) -> StitchedReference {
        let mut reference = StitchedReference::reduced(edge, reduction);
        let n = reference.block_side();
        for slot in 0..27 {
            let origin = [slot % 3, slot / 3 % 3, slot / 9].map(|s| (s * n) as f64 - n as f64);
            let block: Vec<i16> = (0..n.pow(3))
                .map(|i| {
                    let [x, y, z] = [i % n, i / n % n, i / n / n].map(|v| v as f64);
                    field(origin[0] + x, origin[1] + y, origin[2] + z).round() as i16
                })
                .collect();
            reference.put_block(slot, &block);
        }
        reference
    }

    fn rough(x: f64, y: f64, z: f64) -> f64 {
        4000.0 * (0.9 * x + 1.3 * y).sin() * (0.7 * z - 0.4 * x).cos()
    }

    /// The warp in f64: exact angles, positions and interpolation of the integer samples.
    fn slow_warp(reference: &StitchedReference, motion: MotionVector) -> Vec<f64> {
        slow_positions(reference, motion).iter().map(|position| slow_sample(reference, position)).collect()
    }

    /// Positions where the warp samples, in voxels from the cube's first.
    fn slow_positions(reference: &StitchedReference, motion: MotionVector) -> Vec<[f64; 3]> {
        let n = reference.block_side();
        let c = (n as f64 - 1.0) / 2.0;
        let [rx, ry, rz] = motion.rotation.map(|r| f64::from(r) / 32.0);
        let t = motion.translation.map(|t| f64::from(t) / f64::from(4 << reference.reduction));
        let mut out = Vec::new();
        for i in 0..n * n * n {
            let [x, y, z] = [i % n, i / n % n, i / n / n].map(|v| v as f64 - c);
            let (y, z) = (y * rx.cos() - z * rx.sin(), y * rx.sin() + z * rx.cos());
            let (x, z) = (x * ry.cos() + z * ry.sin(), -x * ry.sin() + z * ry.cos());
            let (x, y) = (x * rz.cos() - y * rz.sin(), x * rz.sin() + y * rz.cos());
            out.push([x + t[0], y + t[1], z + t[2]].map(|p| p + c + n as f64));
        }
        out
    }

    fn slow_sample(reference: &StitchedReference, position: &[f64]) -> f64 {
        let side = reference.side();
        let clamped: Vec<f64> =
            position.iter().map(|p| p.clamp(0.0, side as f64 - 1.0 - 1.0 / 64.0)).collect();
        let mut sum = 0.0;
        for corner in 0..8usize {
            let (mut weight, mut index) = (1.0, 0);
            for axis in (0..3).rev() {
                let (cell, fraction) = (clamped[axis].floor(), clamped[axis].fract());
                let far = corner >> axis & 1;
                weight *= if far == 1 { fraction } else { 1.0 - fraction };
                index = index * side + cell as usize + far;
            }
            sum += weight * f64::from(reference.samples()[index]);
        }
        sum
    }

    #[test]
    fn angle_tables_are_rounded_sines() {
        for i in 0..33 {
            let angle = i as f64 / f64::from(STEPS_PER_RADIAN);
            assert_eq!(f64::from(SINES[i]), (16384.0 * angle.sin()).round());
            assert_eq!(f64::from(COSINES[i]), (16384.0 * angle.cos()).round());
        }
    }

    #[test]
    fn no_motion_gives_the_block_itself() {
        for edge in EDGES {
            let reference = stitched(edge, rough);
            let mut out = vec![0; edge.block_voxels()];
            reference.warp(MotionVector::ZERO, &mut out);
            let n = edge.voxels();
            for (i, value) in out.iter().enumerate() {
                let [x, y, z] = [i % n, i / n % n, i / n / n].map(|v| v as f64);
                assert_eq!(*value, rough(x, y, z).round() as i16);
            }
        }
    }

    #[test]
    fn translation_is_exact_trilinear_interpolation() {
        for edge in EDGES {
            let reference = stitched(edge, rough);
            let limit = MotionVector::translation_limit(edge) as i8;
            for translation in [[limit, -limit, 0], [-limit, limit, limit], [1, -2, 3], [limit - 1, 5, -7]] {
                let motion = MotionVector { translation, rotation: [0; 3] };
                let mut out = vec![0; edge.block_voxels()];
                reference.warp(motion, &mut out);
                for (fast, slow) in out.iter().zip(slow_warp(&reference, motion)) {
                    assert_eq!(f64::from(*fast), (slow + 0.5).floor(), "{edge:?} {translation:?}");
                }
            }
        }
    }

    #[test]
    fn rotation_samples_within_a_64th_of_a_voxel() {
        // On a field of slope 256 codes a voxel along each axis, 1/128 voxel of position rounding on each of three axes
        // and the 14-bit matrix cost at most a dozen codes.
        for edge in [BlockEdge::E4, BlockEdge::E8] {
            let reference = stitched(edge, |x, y, z| 100.0 * (x + 1.4 * y - z));
            for rotation in [[3, 0, 0], [0, -5, 0], [0, 0, 32], [4, -7, 2], [-32, 32, -32]] {
                let motion = MotionVector { translation: [2, -1, 3], rotation };
                let mut out = vec![0; edge.block_voxels()];
                reference.warp(motion, &mut out);
                for (fast, slow) in out.iter().zip(slow_warp(&reference, motion)) {
                    assert!(
                        (f64::from(*fast) - slow).abs() < 6.0,
                        "{edge:?} {rotation:?}: {fast} against {slow}"
                    );
                }
            }
        }
    }

    /// On a field without curvature the cubic interpolation of larger voxels is the linear one.
    #[test]
    fn reduced_blocks_move_by_the_same_lengths() {
        for (edge, reduction) in EDGES.into_iter().flat_map(|edge| [1, 2].map(|r| (edge, r))) {
            let reference = stitched_reduced(edge, reduction, |x, y, z| 100.0 * (x + 1.4 * y - z));
            let (side, third) = (reference.side(), reference.block_side());
            // The filter reaches a voxel farther than the cube where a block moves by its whole edge.
            let inner = |v: f64| v >= 1.0 && v <= side as f64 - 3.0;
            let mut compared = 0;
            for translation in [[1, -2, 3], [-3, 3, 2]] {
                for rotation in [[0; 3], [4, -7, 2], [-32, 32, -32]] {
                    let motion = MotionVector { translation, rotation };
                    let mut out = vec![0; third.pow(3)];
                    reference.warp(motion, &mut out);
                    let slow = slow_warp(&reference, motion);
                    for (fast, (slow, position)) in
                        out.iter().zip(slow.iter().zip(slow_positions(&reference, motion)))
                    {
                        if position.into_iter().all(inner) {
                            assert!((f64::from(*fast) - slow).abs() < 6.0, "{edge:?} {reduction} {motion:?}");
                            compared += 1;
                        }
                    }
                }
            }
            assert!(compared > 0 || third == 1, "{edge:?} {reduction}");
        }
    }

    #[test]
    fn full_scale_samples_do_not_overflow() {
        for value in [-4096.0, 4096.0] {
            let reference = stitched(BlockEdge::E8, |_, _, _| value);
            let mut out = vec![0; 512];
            for motion in [
                MotionVector { translation: [3, 2, 1], rotation: [0; 3] },
                MotionVector { translation: [28, -28, 27], rotation: [32, -32, 31] },
            ] {
                reference.warp(motion, &mut out);
                assert!(out.iter().all(|v| f64::from(*v) == value));
            }
        }
    }
}
