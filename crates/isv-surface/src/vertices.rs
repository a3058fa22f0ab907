//! Where vertices lie on their edges, and the field's gradient there.

use crate::bits::SignRows;
use glam::DVec3;
use isv_volume::{Neighbourhood, SparseVolume};

/// The samples of a block and its neighbours.
pub(crate) struct Sampler<'a> {
    pub(crate) volume: &'a SparseVolume,
    pub(crate) signs: &'a SignRows<'a>,
    pub(crate) around: &'a Neighbourhood,
}

/// A vertex between a voxel and the next one along an axis.
pub(crate) struct Crossing {
    lower: [i32; 3],
    axis: usize,
    /// Where between the two voxel centres the field is zero, in 0..1, both ends excluded.
    fraction: f64,
    lower_inside: bool,
}

impl Sampler<'_> {
    /// The zero of the field between voxel `lower` of the block and the next one along `axis`, by linear interpolation.
    ///
    /// Code 0 counts as 1: a vertex on a voxel centre would coincide with those on the other edges from there.
    pub(crate) fn crossing(&self, lower: [usize; 3], axis: usize) -> Crossing {
        let lower = lower.map(|c| c as i32);
        let [a, b] = [lower, step(lower, axis, 1)].map(|voxel| {
            let code = self.code(voxel).expect("crossing edges lie between observed voxels");
            f64::from(if code == 0 { 1 } else { code })
        });
        Crossing { lower, axis, fraction: a / (a - b), lower_inside: a < 0.0 }
    }

    /// Unit gradient of the field, pointing outside, interpolated linearly along the edge.
    pub(crate) fn normal(&self, crossing: &Crossing) -> DVec3 {
        let [a, b] = [0, 1].map(|by| self.gradient(step(crossing.lower, crossing.axis, by)));
        let along_edge = DVec3::AXES[crossing.axis] * if crossing.lower_inside { 1.0 } else { -1.0 };
        a.lerp(b, crossing.fraction).normalize_or(along_edge)
    }

    /// Differences of the codes around a voxel, per voxel: central where both neighbours were observed, else one-sided.
    fn gradient(&self, voxel: [i32; 3]) -> DVec3 {
        let here = self.code(voxel);
        DVec3::from_array([0, 1, 2].map(|axis| {
            let [before, after] = [-1, 1].map(|by| self.code(step(voxel, axis, by)));
            let difference = |from: i16, to: i16| f64::from(to) - f64::from(from);
            match (before, here, after) {
                (Some(before), _, Some(after)) => difference(before, after) / 2.0,
                (Some(before), Some(here), None) => difference(before, here),
                (None, Some(here), Some(after)) => difference(here, after),
                _ => 0.0,
            }
        }))
    }

    /// Code of a voxel at most one block away from the block; `None` if missing or unobserved.
    fn code(&self, voxel: [i32; 3]) -> Option<i16> {
        let edge = self.volume.grid().edge;
        let [bx, by, bz] = voxel.map(|c| ((c >> edge.log2()) + 1) as usize);
        let [x, y, z] = voxel.map(|c| c as usize & (edge.voxels() - 1));
        let block = self.around[bz * 9 + by * 3 + bx]? as usize;
        let index = edge.voxel_index(x, y, z);
        self.signs.observed(block, index).then(|| self.volume.block(block)[index])
    }
}

impl Crossing {
    /// World position in metres, given that of voxel `[0, 0, 0]` of the block and the voxel edge.
    pub(crate) fn position_m(&self, origin_m: DVec3, voxel_m: f64) -> DVec3 {
        let mut voxels = DVec3::from_array(self.lower.map(f64::from));
        voxels[self.axis] += self.fraction;
        origin_m + voxels * voxel_m
    }
}

fn step(mut voxel: [i32; 3], axis: usize, by: i32) -> [i32; 3] {
    voxel[axis] += by;
    voxel
}
