//! Where vertices lie on their edges.

use crate::edges::EdgeRow;
use glam::DVec3;
use isv_volume::{BlockCoord, Grid};

/// The vertices on the edges that start in a block.
pub(crate) struct EdgeZeros<'a, const SIDE: usize> {
    /// All samples of the volume.
    samples: &'a [i16],
    /// Where those of the block begin.
    block: usize,
    /// From a sample to the next one along an axis: within the block, and from its last voxel into the next block.
    steps: [[usize; 2]; 3],
    /// Coordinates of the first voxel's centre in metres.
    origin_m: DVec3,
    voxel_m: f64,
    /// The same of all voxels' along each axis.
    centres_m: [[f64; SIDE]; 3],
}

/// A vertex between a voxel and the next one along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeZero {
    /// The voxel where the edge starts.
    pub(crate) lower: [usize; 3],
    pub(crate) axis: usize,
    /// Where between the two voxel centres the field is zero, in 0..1, both ends excluded.
    pub(crate) fraction: f64,
    pub(crate) lower_inside: bool,
    /// World position in metres.
    pub(crate) position_m: DVec3,
}

impl<'a, const SIDE: usize> EdgeZeros<'a, SIDE> {
    /// Of a block and its next ones along the axes.
    #[inline(always)]
    pub(crate) fn new(
        samples: &'a [i16],
        grid: &Grid,
        coord: BlockCoord,
        block: u32,
        next: [Option<u32>; 3],
    ) -> Self {
        let first = |block: u32| block as usize * SIDE.pow(3);
        let origin_m = grid.voxel_centre_m(coord, [0; 3]);
        let voxel_m = grid.voxel_size.metres();
        let mut steps = [[0; 2]; 3];
        let mut centres_m = [[0.0; SIDE]; 3];
        for axis in 0..3 {
            let stride = SIDE.pow(axis as u32);
            // No edge crosses into a block that is not there.
            let beyond = next[axis].map_or(0, |next| first(next).wrapping_sub(first(block)));
            steps[axis] = [stride, beyond.wrapping_sub((SIDE - 1) * stride)];
            for (voxel, centre) in centres_m[axis].iter_mut().enumerate() {
                *centre = origin_m[axis] + voxel as f64 * voxel_m;
            }
        }
        Self { samples, block: first(block), steps, origin_m, voxel_m, centres_m }
    }

    /// Calls `visit` with the vertices of a row of voxels along x, in order.
    ///
    /// A vertex is the zero of the field between its voxels by linear interpolation. Code 0 counts as 1: a vertex on a voxel
    /// centre would coincide with those on the other edges from there.
    #[inline(always)]
    pub(crate) fn for_each(&self, row: EdgeRow, y: usize, z: usize, mut visit: impl FnMut(EdgeZero)) {
        for edge in row.edges() {
            let (x, axis) = (edge / 3, edge % 3);
            let lower = [x, y, z];
            let from = self.block + (z * SIDE + y) * SIDE + x;
            let to = from.wrapping_add(self.steps[axis][usize::from(lower[axis] == SIDE - 1)]);
            let [a, b] = [self.samples[from], self.samples[to]].map(|c| f64::from(if c == 0 { 1 } else { c }));
            let fraction = a / (a - b);
            let mut position_m =
                DVec3::new(self.centres_m[0][x], self.centres_m[1][y], self.centres_m[2][z]);
            position_m[axis] = self.origin_m[axis] + (lower[axis] as f64 + fraction) * self.voxel_m;
            visit(EdgeZero { lower, axis, fraction, lower_inside: a < 0.0, position_m });
        }
    }
}
