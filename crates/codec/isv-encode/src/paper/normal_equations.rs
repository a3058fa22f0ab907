//! The linear system of a Gauss-Newton step: squared residuals of a moved block and their derivatives (Eq. 12 to 14).
//!
//! The Jacobian is that of the interpolation between samples, which costs less than the finite differences of the paper and has no step to choose.

use isv_kernels::warp::StitchedReference;
use isv_volume::{BlockEdge, CODES_PER_VOXEL};

/// Damping of Eq. 14: absolute, in squared voxels of gradient summed over the block, and relative to the diagonal.
const DAMPING: f32 = 0.5;
const RELATIVE_DAMPING: f32 = 0.01;

/// `J^T J` and `J^T e` of Eq. 14 at one motion.
pub(crate) struct NormalEquations<const D: usize> {
    /// Upper triangle.
    matrix: [[f32; D]; D],
    gradient: [f32; D],
    /// Sum over the block, in squared voxels.
    pub(crate) squared_error: f32,
}

impl<const D: usize> NormalEquations<D> {
    /// The system at `motion`: translation x, y, z in voxels, then Euler angles in radians. `target` is the block to predict,
    /// in codes.
    #[inline(always)]
    pub(crate) fn build(stitched: &StitchedReference, target: &[i16], motion: &[f32; 6]) -> Self {
        match stitched.edge() {
            BlockEdge::E4 => Self::build_sized::<4>(stitched, target, motion),
            BlockEdge::E8 => Self::build_sized::<8>(stitched, target, motion),
            BlockEdge::E16 => Self::build_sized::<16>(stitched, target, motion),
        }
    }

    /// Sums over the block a row of N voxels at a time, each lane apart: arrays that compilers turn into vectors.
    #[inline(always)]
    fn build_sized<const N: usize>(stitched: &StitchedReference, target: &[i16], motion: &[f32; 6]) -> Self {
        let mut sums = LaneSums::<D, N>::zero();
        let centre = (N as f32 - 1.0) / 2.0;
        let rotation = rotation_matrix(motion);
        let middle = N as f32 + centre;
        let origin = [middle + motion[0], middle + motion[1], middle + motion[2]];
        for (row, target) in target.as_chunks::<N>().0.iter().enumerate() {
            let first = [-centre, (row % N) as f32 - centre, (row / N) as f32 - centre];
            let samples = if D == 3 {
                RowSamples::translated(
                    stitched,
                    [origin[0] + first[0], origin[1] + first[1], origin[2] + first[2]],
                )
            } else {
                RowSamples::rotated(stitched, origin, &rotation, first)
            };
            sums.add_row(&samples, target);
        }
        sums.total()
    }

    /// The damped step `-(J^T J + lambda I)^-1 J^T e`, by Cholesky; `None` if the matrix is not positive.
    pub(crate) fn solve(&self) -> Option<[f32; D]> {
        let mut factor = [[0f32; D]; D];
        for i in 0..D {
            for j in 0..=i {
                let mut sum = self.matrix[j][i];
                if i == j {
                    sum += DAMPING + RELATIVE_DAMPING * sum;
                }
                for k in 0..j {
                    sum -= factor[i][k] * factor[j][k];
                }
                factor[i][j] = if i == j {
                    if sum <= 0.0 {
                        return None;
                    }
                    sum.sqrt()
                } else {
                    sum / factor[j][j]
                };
            }
        }
        let mut step = self.gradient.map(|g| -g);
        for i in 0..D {
            for k in 0..i {
                step[i] -= factor[i][k] * step[k];
            }
            step[i] /= factor[i][i];
        }
        for i in (0..D).rev() {
            for k in i + 1..D {
                step[i] -= factor[k][i] * step[k];
            }
            step[i] /= factor[i][i];
        }
        Some(step)
    }
}

/// [`NormalEquations`] of each lane of a row.
struct LaneSums<const D: usize, const N: usize> {
    matrix: [[[f32; N]; D]; D],
    gradient: [[f32; N]; D],
    squared_error: [f32; N],
}

impl<const D: usize, const N: usize> LaneSums<D, N> {
    #[inline(always)]
    fn zero() -> Self {
        Self { matrix: [[[0.0; N]; D]; D], gradient: [[0.0; N]; D], squared_error: [0.0; N] }
    }

    #[inline(always)]
    fn add_row(&mut self, row: &RowSamples<N>, target: &[i16; N]) {
        let mut error = [0f32; N];
        for lane in 0..N {
            error[lane] = row.value[lane] - f32::from(target[lane]) / CODES_PER_VOXEL as f32;
            self.squared_error[lane] += error[lane] * error[lane];
        }
        let jacobian = row.jacobian();
        for i in 0..D {
            for lane in 0..N {
                self.gradient[i][lane] += jacobian[i][lane] * error[lane];
            }
            for j in i..D {
                for lane in 0..N {
                    self.matrix[i][j][lane] += jacobian[i][lane] * jacobian[j][lane];
                }
            }
        }
    }

    #[inline(always)]
    fn total(&self) -> NormalEquations<D> {
        let mut total = NormalEquations {
            matrix: [[0.0; D]; D],
            gradient: [0.0; D],
            squared_error: sum(&self.squared_error),
        };
        for i in 0..D {
            total.gradient[i] = sum(&self.gradient[i]);
            for j in i..D {
                total.matrix[i][j] = sum(&self.matrix[i][j]);
            }
        }
        total
    }
}

#[inline(always)]
fn sum<const N: usize>(lanes: &[f32; N]) -> f32 {
    let mut sum = 0.0;
    for lane in lanes {
        sum += lane;
    }
    sum
}

/// Trilinear samples of the reference along a row of N voxels.
struct RowSamples<const N: usize> {
    value: [f32; N],
    /// Gradient along x, y and z.
    slope: [[f32; N]; 3],
    /// Offsets from the block's centre, rotated.
    offset: [[f32; N]; 3],
}

impl<const N: usize> RowSamples<N> {
    /// A row that begins at `first`, along x: every voxel has the same fractions.
    #[inline(always)]
    fn translated(stitched: &StitchedReference, first: [f32; 3]) -> Self {
        let side = stitched.side();
        // The last cell of the cube that still has its far corners.
        let last = [side - N - 1, side - 2, side - 2];
        let (mut cell, mut fraction) = ([0; 3], [[0.0; N]; 3]);
        for axis in 0..3 {
            cell[axis] = (first[axis].max(0.0) as usize).min(last[axis]);
            fraction[axis] = [(first[axis] - cell[axis] as f32).clamp(0.0, 1.0); N];
        }
        let start = (cell[2] * side + cell[1]) * side + cell[0];
        let (mut near, mut far) = ([[0.0; N]; 4], [[0.0; N]; 4]);
        for (edge, offset) in edge_starts(side).into_iter().enumerate() {
            let row = &stitched.samples()[start + offset..][..=N];
            for lane in 0..N {
                near[edge][lane] = f32::from(row[lane]);
                far[edge][lane] = f32::from(row[lane + 1]);
            }
        }
        Self::trilinear(near, far, fraction, [[0.0; N]; 3])
    }

    /// The row of voxels whose offsets from the block's centre begin at `first`, rotated about the centre at `origin`.
    #[inline(always)]
    fn rotated(
        stitched: &StitchedReference,
        origin: [f32; 3],
        rotation: &[[f32; 3]; 3],
        first: [f32; 3],
    ) -> Self {
        let side = stitched.side();
        let (mut near, mut far) = ([[0.0; N]; 4], [[0.0; N]; 4]);
        let (mut fraction, mut offset) = ([[0.0; N]; 3], [[0.0; N]; 3]);
        for lane in 0..N {
            let mut cell = [0; 3];
            for axis in 0..3 {
                let [rx, ry, rz] = rotation[axis];
                offset[axis][lane] = rx * (first[0] + lane as f32) + ry * first[1] + rz * first[2];
                let position = (origin[axis] + offset[axis][lane]).clamp(0.0, side as f32 - 1.001);
                cell[axis] = position as usize;
                fraction[axis][lane] = position - cell[axis] as f32;
            }
            let start = (cell[2] * side + cell[1]) * side + cell[0];
            for (edge, step) in edge_starts(side).into_iter().enumerate() {
                let ends = &stitched.samples()[start + step..][..2];
                (near[edge][lane], far[edge][lane]) = (f32::from(ends[0]), f32::from(ends[1]));
            }
        }
        Self::trilinear(near, far, fraction, offset)
    }

    /// Value and gradient inside the cell of each voxel. `near`, `far`: the two ends of its four edges along x, at (y, z) = 00, 10,
    /// 01 and 11. `[a, b, c]`: the fractions along x, y and z.
    #[inline(always)]
    fn trilinear(
        near: [[f32; N]; 4],
        far: [[f32; N]; 4],
        [a, b, c]: [[f32; N]; 3],
        offset: [[f32; N]; 3],
    ) -> Self {
        const SCALE: f32 = 1.0 / CODES_PER_VOXEL as f32;
        let mut row = Self { value: [0.0; N], slope: [[0.0; N]; 3], offset };
        for i in 0..N {
            let [n00, n10, n01, n11] = [near[0][i], near[1][i], near[2][i], near[3][i]];
            let [s00, s10, s01, s11] = [far[0][i] - n00, far[1][i] - n10, far[2][i] - n01, far[3][i] - n11];
            let [v00, v10] = [n00 + a[i] * s00, n10 + a[i] * s10];
            let [v01, v11] = [n01 + a[i] * s01, n11 + a[i] * s11];
            let [s0, s1] = [s00 + b[i] * (s10 - s00), s01 + b[i] * (s11 - s01)];
            let [v0, v1] = [v00 + b[i] * (v10 - v00), v01 + b[i] * (v11 - v01)];
            row.slope[0][i] = (s0 + c[i] * (s1 - s0)) * SCALE;
            row.slope[1][i] = ((v10 - v00) + c[i] * ((v11 - v01) - (v10 - v00))) * SCALE;
            row.slope[2][i] = (v1 - v0) * SCALE;
            row.value[i] = (v0 + c[i] * (v1 - v0)) * SCALE;
        }
        row
    }

    /// Derivative of each value by translation, and by a further rotation about the block's centre.
    #[inline(always)]
    fn jacobian(&self) -> [[f32; N]; 6] {
        let [gx, gy, gz] = &self.slope;
        let [x, y, z] = &self.offset;
        let mut out = [*gx, *gy, *gz, [0.0; N], [0.0; N], [0.0; N]];
        for i in 0..N {
            out[3][i] = gz[i] * y[i] - gy[i] * z[i];
            out[4][i] = gx[i] * z[i] - gz[i] * x[i];
            out[5][i] = gy[i] * x[i] - gx[i] * y[i];
        }
        out
    }
}

/// `Rz Ry Rx`, as the decoder composes it.
fn rotation_matrix(motion: &[f32; 6]) -> [[f32; 3]; 3] {
    let [(sx, cx), (sy, cy), (sz, cz)] = [motion[3].sin_cos(), motion[4].sin_cos(), motion[5].sin_cos()];
    [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
}

/// Offsets from a cell's first corner to the beginnings of its four edges along x.
#[inline(always)]
fn edge_starts(side: usize) -> [usize; 4] {
    [0, side, side * side, side * side + side]
}
