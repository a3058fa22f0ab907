//! From the triangles of a cube to those of its eight halves, down to 2 x 2 x 2 voxels.
//!
//! In a cube, let `t` be the triangle closest to the centre. Another triangle is needed only if some voxel is closer to
//! it than to `t`. The distance to a triangle is convex, so it is nowhere below its tangent plane at the centre, and
//! that plane minus the distance to `t` is concave, so it is smallest at a corner of the cube: where the tangent plane
//! stays above the distance to `t` at all eight corners, the triangle cannot matter. Unlike a bound by radii this uses
//! directions, and far from a flat surface it keeps few of the many triangles that are almost equally far.

use crate::distance::{Gradient, LANES, LocalTriangle, Points};
use fearless_simd::{Simd, dispatch};

/// Slack of all comparisons, in voxels: well above `f32` rounding at the size of a tile (1e-5 voxels).
const SLACK: f32 = 1e-3;

/// In cubes of 4 voxels, lists up to this long are cheaper to measure than to narrow.
const SHORT_LIST: usize = 3;

/// Lists of the eight octants of a cube, reused from cube to cube.
#[derive(Default)]
pub(crate) struct Level {
    gradients: Vec<Gradient>,
    /// Triangles of each octant: bit 0 of its number is the upper half along x, bit 1 along y, bit 2 along z.
    pub(crate) octants: [Vec<u32>; 8],
}

/// The eight points `centre +- half`, by octant.
#[inline(always)]
pub(crate) fn corners(centre: [f32; 3], half: f32) -> Points {
    let mut points = [[0.0; LANES]; 3];
    for axis in 0..3 {
        for lane in 0..LANES {
            points[axis][lane] = centre[axis] + if lane >> axis & 1 == 0 { -half } else { half };
        }
    }
    points
}

/// The centre of an octant of the cube of `edge` voxels around `centre`.
#[inline(always)]
pub(crate) fn octant_centre(centre: [f32; 3], edge: usize, octant: usize) -> [f32; 3] {
    let quarter = edge as f32 / 4.0;
    [0, 1, 2].map(|axis| centre[axis] + if octant >> axis & 1 == 0 { -quarter } else { quarter })
}

impl Level {
    /// Sorts the triangles `list` of the cube of `edge` voxels (4 or more) around `centre` into its octants: those that
    /// may be closest to a voxel and within `band` voxels of it.
    pub(crate) fn split(
        &mut self,
        triangles: &[LocalTriangle],
        list: &[u32],
        centre: [f32; 3],
        edge: usize,
        band: f32,
    ) {
        dispatch!(fearless_simd::Level::new(), simd => simd.vectorize(
            #[inline(always)]
            || self.split_lanes(triangles, list, centre, edge, band)
        ));
    }

    /// [`Self::split`], to be compiled for one instruction set.
    #[inline(always)]
    fn split_lanes(
        &mut self,
        triangles: &[LocalTriangle],
        list: &[u32],
        centre: [f32; 3],
        edge: usize,
        band: f32,
    ) {
        self.octants.iter_mut().for_each(Vec::clear);
        let centres = corners(centre, edge as f32 / 4.0);
        let half = (edge / 2 - 1) as f32 / 2.0;
        if list.len() == 1 || (edge == 4 && list.len() <= SHORT_LIST) {
            self.copy(triangles, list, &centres, band + half * 3f32.sqrt() + SLACK);
            return;
        }
        let closest = self.measure(triangles, list, &centres);
        let bounds = transpose(std::array::from_fn(|octant| {
            let around = corners(octant_centre(centre, edge, octant), half);
            triangles[list[closest[octant]] as usize].distances_sq(&around).map(f32::sqrt)
        }));
        // Which octants keep a triangle is hardly predictable: each list is written on always, and lengthened if it counts.
        self.octants.iter_mut().for_each(|octant| octant.resize(list.len(), 0));
        let mut lengths = [0; 8];
        for (t, gradient) in list.iter().zip(&self.gradients) {
            let kept = may_matter(gradient, half, &bounds, band);
            for octant in 0..8 {
                self.octants[octant][lengths[octant]] = *t;
                lengths[octant] += usize::from(kept[octant]);
            }
        }
        for (octant, length) in self.octants.iter_mut().zip(lengths) {
            octant.truncate(length);
        }
    }

    /// Gives each octant the triangles whose distance from its centre is within `reach`.
    #[inline(always)]
    fn copy(&mut self, triangles: &[LocalTriangle], list: &[u32], centres: &Points, reach: f32) {
        for t in list {
            let distances_sq = triangles[*t as usize].distances_sq(centres);
            for octant in 0..8 {
                if distances_sq[octant] <= reach * reach {
                    self.octants[octant].push(*t);
                }
            }
        }
    }

    /// Measures all triangles at the octants' centres; returns the position in the list of the closest to each.
    #[inline(always)]
    fn measure(&mut self, triangles: &[LocalTriangle], list: &[u32], centres: &Points) -> [usize; LANES] {
        self.gradients.clear();
        let (mut closest, mut least) = ([0u32; LANES], [f32::INFINITY; LANES]);
        for (position, t) in list.iter().enumerate() {
            let gradient = triangles[*t as usize].gradient(centres);
            for lane in 0..LANES {
                let closer = gradient.distance[lane] < least[lane];
                least[lane] = if closer { gradient.distance[lane] } else { least[lane] };
                closest[lane] = if closer { position as u32 } else { closest[lane] };
            }
            self.gradients.push(gradient);
        }
        closest.map(|position| position as usize)
    }
}

/// For each octant whether the tangent plane of a distance comes down to the band, and to `bounds` at a corner;
/// `bounds[corner][octant]`.
///
/// All values are taken times the distance at the octant's centre, which spares the division that the plane's unit
/// normal would need.
#[inline(always)]
fn may_matter(gradient: &Gradient, half: f32, bounds: &[[f32; LANES]; 8], band: f32) -> [bool; LANES] {
    let mut kept = [false; LANES];
    for octant in 0..LANES {
        let distance = gradient.distance[octant];
        let at_centre = distance * (distance - SLACK);
        let [x, y, z] = [0, 1, 2].map(|axis| gradient.offset[axis][octant] * half);
        let mut lowest = f32::INFINITY;
        for corner in 0..8 {
            let along_x = if corner & 1 == 0 { at_centre - x } else { at_centre + x };
            let along_y = if corner & 2 == 0 { along_x - y } else { along_x + y };
            let along_z = if corner & 4 == 0 { along_y - z } else { along_y + z };
            let above = along_z - distance * bounds[corner][octant];
            lowest = if above < lowest { above } else { lowest };
        }
        let in_band = at_centre - x.abs() - y.abs() - z.abs() <= band * distance;
        kept[octant] = in_band & (lowest <= 0.0);
    }
    kept
}

/// Exchanges rows and columns.
#[inline(always)]
fn transpose(rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
    std::array::from_fn(|column| rows.map(|row| row[column]))
}
