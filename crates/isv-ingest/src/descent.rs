//! From a cube that a cell may reach into to its octants, down to 2 x 2 x 2 voxels.
//!
//! All that is asked of a cell are the heights of points above its planes. Those of the eight centres of a cube's octants are
//! those of its own centre, more or less the same eight differences on every level, only halved from level to level. So a
//! cell is taken down to voxels in one go, eight points at a time, with a multiplication and an addition for each plane.

use crate::cells::{Cells, EDGE_PLANES, FACE_PLANES, MOST_PLANES, Plane, VERTEX_PLANES};
use fearless_simd::{f32x8, prelude::*};
use glam::DVec3;

/// Points evaluated together.
pub(crate) const LANES: usize = 8;

/// How far, in voxels, a point may lie outside a cell and still be taken for inside: well above `f32` rounding at the size of
/// a tile (1e-5 voxels), so that no point falls between two cells.
const SLACK: f32 = 1e-4;

/// Levels of a descent at most: 16 voxels to 8 to 4 to 2.
const MOST_LEVELS: usize = 3;

/// Heights of eight points above each plane of a cell, level after level of a descent.
type Heights = [[[f32; LANES]; MOST_PLANES]; MOST_LEVELS + 1];

/// A cube to descend into.
#[derive(Clone, Copy)]
pub(crate) struct Cube {
    /// Relative to the origin of the cells.
    pub(crate) centre: DVec3,
    /// In voxels.
    pub(crate) edge: usize,
    /// How often it is to be halved, at most [`MOST_LEVELS`].
    pub(crate) levels: usize,
}

/// A cell on its way down. The number of a point among eight tells on which side it lies: bit 0 along x, bit 1 along y,
/// bit 2 along z.
struct Descent<'a, S: Simd, const AXES: usize, const PLANES: usize> {
    /// By how much the corners of a cube whose edge is 2 are higher above each plane than its centre.
    rises: [f32x8<S>; PLANES],
    /// The largest of those.
    spreads: [f32; PLANES],
    heights: &'a mut Heights,
}

impl<'a, S: Simd, const AXES: usize, const PLANES: usize> Descent<'a, S, AXES, PLANES> {
    #[inline(always)]
    fn new(simd: S, planes: &[Plane], centre: DVec3, heights: &'a mut Heights) -> Self {
        const SIGNS: [[f32; LANES]; 3] = [
            [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
            [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0],
            [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
        ];
        let [x, y, z] = [0, 1, 2].map(|axis: usize| f32x8::simd_from(simd, SIGNS[axis]));
        let (mut rises, mut spreads) = ([x; PLANES], [0.0; PLANES]);
        for i in 0..PLANES {
            let plane = &planes[i];
            let normal = plane.normal.as_vec3();
            rises[i] = x * normal.x + y * normal.y + z * normal.z;
            spreads[i] = normal.x.abs() + normal.y.abs() + normal.z.abs();
            heights[0][i][0] = (plane.height + plane.normal.dot(centre)) as f32;
        }
        Self { rises, spreads, heights }
    }

    /// Calls `visit` for all cubes at the end of the descent that the cell may have a voxel of in it, within `band` voxels of
    /// its part. A cube's number is made of the numbers of octants, that of the largest in the highest bits.
    #[inline(always)]
    fn run(&mut self, cube: &Cube, band: f32, mut visit: impl FnMut(usize, &Self, usize)) {
        let mut octants = [1u64, 0, 0, 0];
        let (mut level, mut number, mut edge) = (0, 0, cube.edge as f32);
        loop {
            if octants[level] == 0 {
                if level == 0 {
                    return;
                }
                level -= 1;
                number >>= 3;
                edge *= 2.0;
                continue;
            }
            let octant = octants[level].trailing_zeros() as usize % LANES;
            octants[level] &= octants[level] - 1;
            let here = number << 3 | octant;
            if level == cube.levels {
                visit(here, self, octant);
            } else {
                octants[level + 1] = self.split(level, octant, edge, band);
                level += 1;
                number = here;
                edge /= 2.0;
            }
        }
    }

    /// Finds the octants that the cell may reach into, a bit each, of octant `octant` on a level, whose edge is given.
    #[inline(always)]
    fn split(&mut self, level: usize, octant: usize, edge: f32, band: f32) -> u64 {
        let (quarter, half) = (edge / 4.0, (edge / 2.0 - 1.0) / 2.0);
        let reach = band + half * 3f32.sqrt() + SLACK;
        let simd = self.rises[0].simd;
        let (mut distances_sq, mut depths) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 0.0));
        let (above, below) = self.heights.split_at_mut(level + 1);
        let (above, below) = (&above[level], &mut below[0]);
        for plane in 0..PLANES {
            let centres = self.rises[plane] * quarter + above[plane][octant];
            if plane < AXES {
                distances_sq += centres * centres;
            } else {
                depths = depths.min(centres + self.spreads[plane] * half);
            }
            below[plane] = centres.into();
        }
        (distances_sq.simd_le(reach * reach) & depths.simd_ge(-SLACK)).to_bitmask()
    }

    /// Squared distances from the cell's part of the voxels of a cube of 2 x 2 x 2, which is octant `octant` on a level;
    /// infinite for those outside the cell.
    #[inline(always)]
    fn distances_sq(&self, level: usize, octant: usize) -> f32x8<S> {
        let simd = self.rises[0].simd;
        let (mut distances_sq, mut depths) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 0.0));
        for plane in 0..PLANES {
            let voxels = self.rises[plane] * 0.5 + self.heights[level][plane][octant];
            if plane < AXES {
                distances_sq += voxels * voxels;
            } else {
                depths = depths.min(voxels);
            }
        }
        depths.simd_ge(-SLACK).select(distances_sq, f32x8::splat(simd, f32::INFINITY))
    }
}

/// Lists the cells in the octants of octants of a cube that they may reach into; `lists` by their numbers.
#[inline(always)]
pub(crate) fn list_cells<S: Simd>(simd: S, cells: &Cells, cube: &Cube, band: f32, lists: &mut [Vec<u32>; 64]) {
    let mut heights = [[[0.0; LANES]; MOST_PLANES]; MOST_LEVELS + 1];
    for index in 0..cells.count() {
        let cell = cells.get(index);
        macro_rules! list {
            ($axes:literal, $planes:expr) => {
                Descent::<S, $axes, { $planes }>::new(simd, cell.planes, cube.centre, &mut heights)
                    .run(cube, band, |number, _, _| lists[number % 64].push(index))
            };
        }
        match cell.axes {
            1 => list!(1, FACE_PLANES),
            2 => list!(2, EDGE_PLANES),
            _ => list!(3, VERTEX_PLANES),
        }
    }
}

/// Lowers the squared distances of the voxels of a cube to those from the parts of the cells that `list` names; `nearest` of
/// all, `on_hole` of parts on a wide hole. Both are in cubes of 2 x 2 x 2 voxels, by their numbers.
#[inline(always)]
pub(crate) fn measure_cells<S: Simd>(
    simd: S,
    (cells, list): (&Cells, &[u32]),
    cube: &Cube,
    band: f32,
    nearest: &mut [[f32; LANES]],
    on_hole: &mut [[f32; LANES]],
) {
    let mut heights = [[[0.0; LANES]; MOST_PLANES]; MOST_LEVELS + 1];
    let lower = |cube: &mut [f32; LANES], to: f32x8<S>| *cube = f32x8::simd_from(simd, *cube).min(to).into();
    for index in list {
        let cell = cells.get(*index);
        macro_rules! measure {
            ($axes:literal, $planes:expr) => {
                Descent::<S, $axes, { $planes }>::new(simd, cell.planes, cube.centre, &mut heights).run(
                    cube,
                    band,
                    |number, descent, octant| {
                        let distances_sq = descent.distances_sq(cube.levels, octant);
                        lower(&mut nearest[number], distances_sq);
                        if cell.on_hole {
                            lower(&mut on_hole[number], distances_sq);
                        }
                    },
                )
            };
        }
        match cell.axes {
            1 => measure!(1, FACE_PLANES),
            2 => measure!(2, EDGE_PLANES),
            _ => measure!(3, VERTEX_PLANES),
        }
    }
}
