//! Which parts of a cube a cell reaches into, and how far its voxels are from the cell's part.
//!
//! The descent asks of a cell only the heights of points above its planes. Those of the eight centres of a
//! cube's octants are that of its own centre plus eight differences. The differences are the same at every
//! size, only scaled with the cube. So going down from a cube to its octants costs a few additions for each
//! plane, eight at a time. At the end of it eight voxels are measured at once.

use crate::cells::{Cells, EDGE_PLANES, FACE_PLANES, Plane, VERTEX_PLANES};
use fearless_simd::{f32x8, prelude::*};
use glam::Vec3;

/// Points evaluated together.
pub(crate) const LANES: usize = 8;

/// Farthest that a point may lie outside a cell and still be taken for inside, in voxels. It is well above
/// `f32` rounding at the size of a tile (1e-5 voxels), so that no point falls between two cells.
pub(crate) const SLACK: f32 = 1e-4;

/// How many of a cell's sides bound its part, by its axes: three a face, two an edge, none a vertex.
const BOUNDS: [usize; 3] = [3, 2, 0];

/// Parts of a cube, four along each axis: the octants of its octants. The number of a part is that of its octant times eight plus
/// that in the octant.
pub(crate) const PARTS: usize = 4 * 4 * 4;

/// The position of a part of a cube, by its number.
pub(crate) fn part_position(part: usize) -> [i32; 3] {
    [0, 1, 2].map(|axis| (part >> axis & 1 | part >> (axis + 3) << 1 & 2) as i32)
}

/// A cube of voxels.
#[derive(Clone, Copy)]
pub(crate) struct Cube {
    /// Relative to the origin of the cells.
    pub(crate) centre: Vec3,
    /// In voxels.
    pub(crate) edge: usize,
}

/// A cell made ready for cubes. The number of a point among eight tells on which side it lies: bit 0 along x, bit 1 along y,
/// bit 2 along z.
struct Probe<S: Simd, const AXES: usize, const PLANES: usize> {
    /// By how much the corners of a cube whose edge is 2 are higher above each plane than its centre.
    rises: [f32x8<S>; PLANES],
    /// The largest of those, of each plane.
    spreads: [f32; PLANES],
}

/// Squared distances of the voxels of a cube, in cubes of 2 x 2 x 2 voxels by their Morton numbers, while they are lowered.
struct Target<'a> {
    /// To any part.
    nearest: &'a mut [[f32; LANES]],
    /// To parts on a wide hole, if the part at hand is one.
    on_hole: Option<&'a mut [[f32; LANES]]>,
}

impl Target<'_> {
    #[inline(always)]
    fn lower<S: Simd>(&mut self, number: usize, distances_sq: f32x8<S>) {
        let simd = distances_sq.simd;
        let lower = &mut self.nearest[number];
        *lower = f32x8::simd_from(simd, *lower).min(distances_sq).into();
        if let Some(on_hole) = &mut self.on_hole {
            let lower = &mut on_hole[number];
            *lower = f32x8::simd_from(simd, *lower).min(distances_sq).into();
        }
    }
}

impl<S: Simd, const AXES: usize, const PLANES: usize> Probe<S, AXES, PLANES> {
    /// Readies a cell; returns the heights of a point above its planes with it.
    #[inline(always)]
    fn new(simd: S, planes: &[Plane; PLANES], point: Vec3) -> (Self, [f32; PLANES]) {
        const SIGNS: [[f32; LANES]; 3] = [
            [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
            [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0],
            [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
        ];
        let x = f32x8::simd_from(simd, SIGNS[0]);
        let y = f32x8::simd_from(simd, SIGNS[1]);
        let z = f32x8::simd_from(simd, SIGNS[2]);
        let (mut rises, mut spreads, mut heights) = ([x; PLANES], [0.0; PLANES], [0.0; PLANES]);
        for i in 0..PLANES {
            let Plane { normal, height, spread } = planes[i];
            rises[i] = x * normal.x + y * normal.y + z * normal.z;
            spreads[i] = spread;
            heights[i] = height + normal.dot(point);
        }
        (Self { rises, spreads }, heights)
    }

    /// Heights of the centres of the octants of a cube of `edge` voxels.
    #[inline(always)]
    fn octants(&self, heights: &[f32; PLANES], edge: f32) -> [f32x8<S>; PLANES] {
        let mut octants = self.rises;
        for plane in 0..PLANES {
            octants[plane] = self.rises[plane] * (edge / 4.0) + heights[plane];
        }
        octants
    }

    /// Octants of a cube of `edge` voxels in which the cell may have a voxel within `band` voxels of its
    /// part: a bit each.
    #[inline(always)]
    fn octants_reached(&self, octants: &[f32x8<S>; PLANES], edge: f32, band: f32) -> u64 {
        let simd = self.rises[0].simd;
        let around = (edge / 2.0 - 1.0) / 2.0;
        let farthest = band + around * 3f32.sqrt() + SLACK;
        let (mut distances_sq, mut depths) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 0.0));
        for plane in 0..AXES {
            distances_sq += octants[plane] * octants[plane];
        }
        for plane in AXES..PLANES {
            depths = depths.min(octants[plane] + self.spreads[plane] * around);
        }
        (distances_sq.simd_le(farthest * farthest) & depths.simd_ge(-SLACK)).to_bitmask()
    }

    /// Calls `visit` for those octants, with their numbers and the heights of their centres.
    #[inline(always)]
    fn each_octant(
        &self,
        heights: &[f32; PLANES],
        edge: f32,
        band: f32,
        mut visit: impl FnMut(usize, &[f32; PLANES]),
    ) {
        let centres = self.octants(heights, edge);
        let mut reached = self.octants_reached(&centres, edge, band);
        let mut octants = [[0.0; LANES]; PLANES];
        for plane in 0..PLANES {
            octants[plane] = centres[plane].into();
        }
        while reached != 0 {
            let octant = reached.trailing_zeros() as usize % LANES;
            reached &= reached - 1;
            let mut heights = [0.0; PLANES];
            for plane in 0..PLANES {
                heights[plane] = octants[plane][octant];
            }
            visit(octant, &heights);
        }
    }

    /// Lowers the squared distances of the voxels of a cube of `edge` voxels, 8 to 32, to those from the cell's part.
    #[inline(always)]
    fn measure(&self, heights: &[f32; PLANES], edge: usize, band: f32, target: &mut Target<'_>) {
        match edge {
            8 => self.measure_eight(heights, 0, band, target),
            16 => self.measure_sixteen(heights, 0, band, target),
            _ => self.each_octant(
                heights,
                32.0,
                band,
                #[inline(always)]
                |octant, heights| self.measure_sixteen(heights, LANES * PARTS * octant, band, target),
            ),
        }
    }

    /// Measures a cube of 16 voxels, whose cubes of 2 x 2 x 2 voxels are numbered from `first`.
    #[inline(always)]
    fn measure_sixteen(&self, heights: &[f32; PLANES], first: usize, band: f32, target: &mut Target<'_>) {
        self.each_octant(
            heights,
            16.0,
            band,
            #[inline(always)]
            |octant, heights| self.measure_eight(heights, first + PARTS * octant, band, target),
        );
    }

    /// Measures a cube of 8 voxels, whose cubes of 2 x 2 x 2 voxels are numbered from `first`.
    #[inline(always)]
    fn measure_eight(&self, heights: &[f32; PLANES], first: usize, band: f32, target: &mut Target<'_>) {
        self.each_octant(
            heights,
            8.0,
            band,
            #[inline(always)]
            |octant, heights| {
                let first = first + LANES * octant;
                self.each_octant(
                    heights,
                    4.0,
                    band,
                    #[inline(always)]
                    |octant, heights| target.lower(first + octant, self.inside(heights)),
                );
            },
        );
    }

    /// Squared distances from the cell's part of the voxels of a cube of 2 x 2 x 2. They are infinite for
    /// voxels that the part has no foot for. The other sides of the cell only cut off what is closer to
    /// another part, and there is nothing to fear from that.
    #[inline(always)]
    fn inside(&self, heights: &[f32; PLANES]) -> f32x8<S> {
        let simd = self.rises[0].simd;
        let (mut distances_sq, mut depths) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 0.0));
        for plane in 0..AXES {
            let heights = self.rises[plane] * 0.5 + heights[plane];
            distances_sq += heights * heights;
        }
        for plane in AXES..AXES + BOUNDS[AXES - 1] {
            depths = depths.min(self.rises[plane] * 0.5 + heights[plane]);
        }
        depths.simd_ge(-SLACK).select(distances_sq, f32x8::splat(simd, f32::INFINITY))
    }
}

/// Lists the cells in the octants of a cube that they may reach into, those within `band` voxels.
#[inline(always)]
pub(crate) fn list_cells<S: Simd>(
    simd: S,
    cells: &Cells,
    cube: &Cube,
    band: f32,
    lists: &mut [Vec<u32>; LANES],
) {
    let edge = cube.edge as f32;
    for index in 0..cells.count() {
        let cell = cells.get(index);
        macro_rules! octants {
            ($axes:literal, $planes:expr) => {{
                let (probe, heights) =
                    Probe::<S, $axes, { $planes }>::new(simd, cells.planes(cell), cube.centre);
                probe.octants_reached(&probe.octants(&heights, edge), edge, band)
            }};
        }
        let mut octants = match cell.axes {
            1 => octants!(1, FACE_PLANES),
            2 => octants!(2, EDGE_PLANES),
            _ => octants!(3, VERTEX_PLANES),
        };
        while octants != 0 {
            lists[octants.trailing_zeros() as usize % LANES].push(index);
            octants &= octants - 1;
        }
    }
}

/// Lowers the squared distances of the voxels of a cube of 8, 16 or 32 voxels. The new distances are those
/// from the parts of the cells that `list` names. `nearest` is of all parts, `on_hole` of parts on a wide
/// hole. Both are in cubes of 2 x 2 x 2 voxels by their Morton numbers.
#[inline(always)]
pub(crate) fn measure_cells<S: Simd>(
    simd: S,
    (cells, list): (&Cells, &[u32]),
    cube: &Cube,
    band: f32,
    nearest: &mut [[f32; LANES]],
    on_hole: &mut [[f32; LANES]],
) {
    for index in list {
        let cell = cells.get(*index);
        let mut target = Target { nearest, on_hole: cell.on_hole.then_some(&mut *on_hole) };
        macro_rules! measure {
            ($axes:literal, $planes:expr) => {{
                let (probe, heights) =
                    Probe::<S, $axes, { $planes }>::new(simd, cells.planes(cell), cube.centre);
                // A function by itself: all of them in one loop take the compiler minutes for the fallback.
                simd.vectorize(
                    #[inline(always)]
                    || probe.measure(&heights, cube.edge, band, &mut target),
                );
            }};
        }
        match cell.axes {
            1 => measure!(1, FACE_PLANES),
            2 => measure!(2, EDGE_PLANES),
            _ => measure!(3, VERTEX_PLANES),
        }
    }
}
