//! The field's gradient at vertices.

use crate::signs::{Rows, Signs};
use crate::vertices::EdgeZero;
use glam::DVec3;
use isv_volume::{Neighbourhood, SparseVolume};

/// Voxels along the widest window: 16, one before and two after.
const MAX_WINDOW: usize = 19;

/// From a voxel of the window to the next one along each axis.
const STRIDES: [usize; 3] = [1, MAX_WINDOW, MAX_WINDOW * MAX_WINDOW];

/// Stands for a voxel that is missing or was not observed. No code is that low.
const UNKNOWN: i16 = i16::MIN;

/// The codes of a block that is not there.
static MISSING: [i16; 4096] = [UNKNOWN; 4096];

/// Codes of a block and what is around it, one voxel before and two after along every axis. That is as far as
/// the differences reach at both ends of the edges that start in the block.
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
        for (dz, (z_first, z_count, z_out)) in spans::<SIDE>().into_iter().enumerate() {
            for (dy, (y_first, y_count, y_out)) in spans::<SIDE>().into_iter().enumerate() {
                let slot = dz * 9 + dy * 3;
                let [left, middle, right] = [0, 1, 2].map(|dx| {
                    let block = around[slot + dx];
                    block.map_or(&MISSING[..SIDE.pow(3)], |block| volume.block(block as usize)).as_chunks().0
                });
                for z in 0..z_count {
                    for y in 0..y_count {
                        let row = (z_first + z) * SIDE + y_first + y;
                        let out = &mut self.0[window_index([0, y_out + y, z_out + z])..][..MAX_WINDOW];
                        let middle: &[i16; SIDE] = &middle[row];
                        let (left, right): (&[i16; SIDE], &[i16; SIDE]) = (&left[row], &right[row]);
                        out[0] = left[SIDE - 1];
                        out[1..=SIDE].copy_from_slice(middle);
                        out[SIDE + 1] = right[0];
                        out[SIDE + 2] = right[1];
                    }
                }
            }
        }
        for (slot, block) in around.iter().enumerate() {
            if let Some(block) = block.filter(|block| signs.has_unobserved(*block)) {
                self.hide(slot, signs.observed(Some(block)));
            }
        }
    }

    /// Forgets the codes of a block in the neighbourhood that were not observed.
    #[cold]
    fn hide<const SIDE: usize>(&mut self, slot: usize, observed: &Rows<SIDE>) {
        let spans = spans::<SIDE>();
        let [(x_first, x_count, x_out), (y_first, y_count, y_out), (z_first, z_count, z_out)] =
            [slot % 3, slot / 3 % 3, slot / 9].map(|place| spans[place]);
        for z in 0..z_count {
            for y in 0..y_count {
                for x in 0..x_count {
                    if observed[z_first + z][y_first + y] >> (x_first + x) & 1 == 0 {
                        self.0[window_index([x_out + x, y_out + y, z_out + z])] = UNKNOWN;
                    }
                }
            }
        }
    }

    /// Unit gradient of the field, pointing outside, interpolated linearly along the edge.
    #[inline(always)]
    pub(crate) fn normal(&self, zero: &EdgeZero) -> DVec3 {
        let [x, y, z] = zero.lower;
        let lower = window_index([x + 1, y + 1, z + 1]);
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

#[inline(always)]
fn window_index([x, y, z]: [usize; 3]) -> usize {
    (z * MAX_WINDOW + y) * MAX_WINDOW + x
}

/// Along an axis, of the block before, this one and the next: the first voxel that is used, how many are, and where they go.
#[inline(always)]
fn spans<const SIDE: usize>() -> [(usize, usize, usize); 3] {
    [(SIDE - 1, 1, 0), (0, SIDE, 1), (0, 2, SIDE + 1)]
}

/// Twice the difference a voxel, of three codes some of which are unknown; 0 where it cannot be told.
#[cold]
fn doubled_difference(before: i16, here: i16, after: i16) -> i32 {
    let [before, here, after] =
        [before, here, after].map(|code| (code != UNKNOWN).then_some(i32::from(code)));
    match (before, here, after) {
        (Some(before), _, Some(after)) => after - before,
        (Some(before), Some(here), None) => 2 * (here - before),
        (None, Some(here), Some(after)) => 2 * (after - here),
        _ => 0,
    }
}
