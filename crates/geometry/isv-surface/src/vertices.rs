//! Places of vertices on their edges.

use glam::DVec3;
use isv_volume::{Neighbourhood, OCTET_SLOTS, SparseVolume};

/// The vertices on the edges that start in a block.
pub(crate) struct EdgeZeros<'a, const SIDE: usize> {
    /// The samples of the block, then those of the next one along each axis. No edge crosses into a block that is not there.
    blocks: [&'a [i16]; 4],
    /// Coordinates of the first voxel's centre in metres.
    origin_m: DVec3,
    voxel_m: f64,
    /// Centres of all voxels along each axis, in metres.
    centres_m: [[f64; SIDE]; 3],
}

/// A vertex between a voxel and the next one along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeZero {
    /// The voxel where the edge starts.
    pub(crate) lower: [usize; 3],
    pub(crate) axis: usize,
    /// Share of the way between the two voxel centres at which the field is zero, in 0..1, both ends
    /// excluded.
    pub(crate) fraction: f64,
    pub(crate) lower_inside: bool,
}

impl<'a, const SIDE: usize> EdgeZeros<'a, SIDE> {
    /// Vertices of a block, given those around it.
    #[inline(always)]
    pub(crate) fn new(volume: &'a SparseVolume, block: u32, around: &Neighbourhood) -> Self {
        let samples = |block: u32| volume.block(block as usize);
        let origin_m = volume.grid().voxel_centre_m(volume.coords()[block as usize], [0; 3]);
        let voxel_m = volume.grid().voxel_size.metres();
        let mut blocks = [samples(block); 4];
        let mut centres_m = [[0.0; SIDE]; 3];
        for axis in 0..3 {
            if let Some(next) = around[OCTET_SLOTS[1 << axis]] {
                blocks[1 + axis] = samples(next);
            }
            for voxel in 0..SIDE {
                centres_m[axis][voxel] = origin_m[axis] + voxel as f64 * voxel_m;
            }
        }
        Self { blocks, origin_m, voxel_m, centres_m }
    }

    /// The vertex between a voxel of the block and the next one along an axis: the zero of the field by linear interpolation.
    ///
    /// Code 0 counts as 1: a vertex on a voxel centre would coincide with those on the other edges from there.
    #[inline(always)]
    pub(crate) fn on_edge(&self, lower: [usize; 3], axis: usize) -> EdgeZero {
        let [x, y, z] = lower;
        let (from, stride) = ((z * SIDE + y) * SIDE + x, [1, SIDE, SIDE * SIDE][axis]);
        let (next, to) = match lower[axis] == SIDE - 1 {
            true => (1 + axis, from - (SIDE - 1) * stride),
            false => (0, from + stride),
        };
        let [a, b] =
            [self.blocks[0][from], self.blocks[next][to]].map(|c| f64::from(if c == 0 { 1 } else { c }));
        EdgeZero { lower, axis, fraction: a / (a - b), lower_inside: a < 0.0 }
    }

    /// Writes the world position of a vertex in metres.
    #[inline(always)]
    pub(crate) fn place(&self, zero: &EdgeZero, position_m: &mut DVec3) {
        let [x, y, z] = zero.lower;
        *position_m = DVec3::new(self.centres_m[0][x], self.centres_m[1][y], self.centres_m[2][z]);
        let voxels = zero.lower[zero.axis] as f64 + zero.fraction;
        position_m[zero.axis] = self.origin_m[zero.axis] + voxels * self.voxel_m;
    }
}
