//! The field's gradient at vertices.

use crate::signs::Signs;
use crate::vertices::EdgeZero;
use glam::DVec3;
use isv_volume::{Neighbourhood, SparseVolume};

/// Voxels along the widest window: 16, one before and two after.
const MAX_WINDOW: usize = 19;

/// From a voxel of the window to the next one along each axis.
const STRIDES: [usize; 3] = [1, MAX_WINDOW, MAX_WINDOW * MAX_WINDOW];

/// Stands for a voxel that is missing or was not observed. No code is that low.
const UNKNOWN: i16 = i16::MIN;

/// The codes of a block and what is around it, one voxel before and two after along every axis: as far as the differences
/// reach at both ends of the edges that start in the block.
pub(crate) struct CodeWindow(Box<[i16; MAX_WINDOW.pow(3)]>);

impl Default for CodeWindow {
    fn default() -> Self {
        Self(Box::new([UNKNOWN; MAX_WINDOW.pow(3)]))
    }
}

impl CodeWindow {
    /// Takes in the codes around a block.
    #[inline(always)]
    pub(crate) fn gather<const SIDE: usize>(
        &mut self,
        volume: &SparseVolume,
        signs: &Signs<SIDE>,
        around: &Neighbourhood,
    ) {
        // Of the block before, this one and the next: the first voxel that is used, how many are, and where they go.
        let spans = [(SIDE - 1, 1, 0), (0, SIDE, 1), (0, 2, SIDE + 1)];
        for (slot, block) in around.iter().enumerate() {
            let [(x, x_count, x_out), (y, y_count, y_out), (z, z_count, z_out)] =
                [spans[slot % 3], spans[slot / 3 % 3], spans[slot / 9]];
            for row in 0..y_count * z_count {
                let (dy, dz) = (row % y_count, row / y_count);
                let start = ((z_out + dz) * MAX_WINDOW + y_out + dy) * MAX_WINDOW + x_out;
                let out = &mut self.0[start..][..x_count];
                let Some(block) = *block else {
                    out.fill(UNKNOWN);
                    continue;
                };
                let from = ((z + dz) * SIDE + y + dy) * SIDE + x;
                out.copy_from_slice(&volume.block(block as usize)[from..][..x_count]);
                if signs.has_unobserved(block) {
                    let observed = signs.observed(Some(block))[z + dz][y + dy] >> x;
                    for (_, code) in out.iter_mut().enumerate().filter(|(i, _)| observed >> i & 1 == 0) {
                        *code = UNKNOWN;
                    }
                }
            }
        }
    }

    /// Unit gradient of the field, pointing outside, interpolated linearly along the edge.
    #[inline(always)]
    pub(crate) fn normal(&self, zero: &EdgeZero) -> DVec3 {
        let [x, y, z] = zero.lower;
        let lower = ((z + 1) * MAX_WINDOW + y + 1) * MAX_WINDOW + x + 1;
        let [a, b] = [self.gradient(lower), self.gradient(lower + STRIDES[zero.axis])];
        let along_edge = DVec3::AXES[zero.axis] * if zero.lower_inside { 1.0 } else { -1.0 };
        a.lerp(b, zero.fraction).normalize_or(along_edge)
    }

    /// Differences of the codes around a voxel, per voxel: central where both neighbours were observed, else one-sided.
    #[inline(always)]
    fn gradient(&self, voxel: usize) -> DVec3 {
        let here = self.0[voxel];
        let mut halves = [0; 3];
        for axis in 0..3 {
            let [before, after] = [self.0[voxel - STRIDES[axis]], self.0[voxel + STRIDES[axis]]];
            halves[axis] = if before.min(after).min(here) == UNKNOWN {
                doubled_difference(before, here, after)
            } else {
                i32::from(after) - i32::from(before)
            };
        }
        DVec3::from_array(halves.map(f64::from)) * 0.5
    }
}

/// Twice the difference a voxel, of three codes some of which are unknown; 0 where it cannot be told.
#[cold]
fn doubled_difference(before: i16, here: i16, after: i16) -> i32 {
    let [before, here, after] = [before, here, after].map(|code| (code != UNKNOWN).then_some(i32::from(code)));
    match (before, here, after) {
        (Some(before), _, Some(after)) => after - before,
        (Some(before), Some(here), None) => 2 * (here - before),
        (None, Some(here), Some(after)) => 2 * (after - here),
        _ => 0,
    }
}
