//! The closest site of every voxel of a brick.
//!
//! A site `q` is closer than `r` to somewhere in a cube only if it is closer at one of the cube's corners.
//! The difference of the squared distances is linear, so that corner is known. In a cube of half edge `h`
//! around `c`, `q` matters only if `|c - q|^2 - |c - r|^2 < 2 h |q - r|_1`. With `r` the site closest to the
//! centre, this narrows the sites of a brick down to those of cubes of 4, then 2 voxels. There the few that
//! are left are measured.

use crate::points::bricks::{BRICK, BRICK_VOXELS, Bricks, FIRST};
use crate::points::sites::Site;
use isv_kernels::simd::vectorized;
use isv_volume::BlockCoord;

/// Octants of a cube.
const LANES: usize = 8;
/// Slack of comparisons in squared voxels, above `f32` rounding.
const SLACK: f32 = 1e-3;

/// One value an octant.
type Lanes = [f32; LANES];

/// Buffers of one thread, and the results for one brick.
#[derive(Default)]
pub(crate) struct ClosestSites {
    /// Sites in reach, relative to the brick's centre.
    pub(crate) sites: Vec<Site>,
    positions: Vec<[f32; 3]>,
    whole: Vec<u32>,
    levels: [[Vec<u32>; 8]; 2],
    /// Squared distances of the sites of a list to the centres of eight octants.
    table: Vec<Lanes>,
    /// For each voxel the position of its closest site in `sites`, and its distance.
    pub(crate) closest: Vec<u32>,
    pub(crate) distances: Vec<f32>,
}

impl ClosestSites {
    /// Finds the closest sites of a brick among those within `width` voxels of it; `false` if there are none.
    pub(crate) fn find(&mut self, sites: &Bricks<Site>, coord: BlockCoord, width: f32) -> bool {
        self.gather(sites, coord, width);
        if self.sites.is_empty() {
            return false;
        }
        self.closest.resize(BRICK_VOXELS, 0);
        self.distances.resize(BRICK_VOXELS, 0.0);
        vectorized(
            #[inline(always)]
            || {
                self.narrow_whole();
                let [above, below] = std::mem::take(&mut self.levels);
                let mut levels = [above, below];
                let whole = std::mem::take(&mut self.whole);
                let (first, second) = levels.split_at_mut(1);
                self.split(&whole, [0.0; 3], BRICK, &mut first[0]);
                for (octant, list) in first[0].iter().enumerate() {
                    let centre = octant_centre([0.0; 3], BRICK, octant);
                    self.split(list, centre, BRICK / 2, &mut second[0]);
                    for (inner, list) in second[0].iter().enumerate() {
                        self.measure(list, octant_centre(centre, BRICK / 2, inner));
                    }
                }
                (self.levels, self.whole) = (levels, whole);
            },
        );
        true
    }

    fn gather(&mut self, sites: &Bricks<Site>, coord: BlockCoord, width: f32) {
        self.sites.clear();
        self.positions.clear();
        for (step, brick) in sites.around(coord, (width / BRICK as f32).ceil() as i32) {
            let shift = (step * BRICK as i32).as_vec3().to_array();
            for site in sites.list(brick) {
                let at = [0, 1, 2].map(|axis| site.at[axis] + shift[axis]);
                let gap_sq: f32 = at.iter().map(|x| (x.abs() + FIRST).max(0.0).powi(2)).sum();
                if gap_sq <= width * width {
                    self.sites.push(Site { at, ..*site });
                    self.positions.push(at);
                }
            }
        }
    }

    /// Lists the sites that matter anywhere in the brick.
    #[inline(always)]
    fn narrow_whole(&mut self) {
        let from_centre = |p: &[f32; 3]| p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        let (mut least, mut nearest) = (f32::INFINITY, [0.0; 3]);
        for p in &self.positions {
            let d = from_centre(p);
            (least, nearest) = if d < least { (d, *p) } else { (least, nearest) };
        }
        self.whole.clear();
        let reach = (BRICK - 1) as f32;
        for (i, p) in self.positions.iter().enumerate() {
            let apart = (p[0] - nearest[0]).abs() + (p[1] - nearest[1]).abs() + (p[2] - nearest[2]).abs();
            if from_centre(p) - least <= reach * apart + SLACK {
                self.whole.push(i as u32);
            }
        }
    }

    /// Sorts the sites `list` of the cube of `edge` voxels around `centre` into its octants.
    #[inline(always)]
    fn split(&mut self, list: &[u32], centre: [f32; 3], edge: usize, octants: &mut [Vec<u32>; 8]) {
        let centres = corners(centre, edge as f32 / 4.0);
        let (least, nearest) = self.nearest(list, &centres);
        octants.iter_mut().for_each(|octant| octant.resize(list.len(), 0));
        let mut lengths = [0; LANES];
        let reach = (edge / 2 - 1) as f32;
        for (i, distances) in list.iter().zip(&self.table) {
            let p = self.positions[*i as usize];
            let mut kept = [false; LANES];
            for lane in 0..LANES {
                let apart = (p[0] - nearest[0][lane]).abs()
                    + (p[1] - nearest[1][lane]).abs()
                    + (p[2] - nearest[2][lane]).abs();
                kept[lane] = distances[lane] - least[lane] <= reach * apart + SLACK;
            }
            // Which octants keep a site is hardly predictable: each list is written on always, and lengthened if it counts.
            for lane in 0..LANES {
                octants[lane][lengths[lane]] = *i;
                lengths[lane] += usize::from(kept[lane]);
            }
        }
        for (octant, length) in octants.iter_mut().zip(lengths) {
            octant.truncate(length);
        }
    }

    /// Fills the table; returns the least squared distance to each centre, and the site that has it.
    #[inline(always)]
    fn nearest(&mut self, list: &[u32], centres: &[Lanes; 3]) -> (Lanes, [Lanes; 3]) {
        self.table.clear();
        let (mut least, mut nearest) = ([f32::INFINITY; LANES], [[0.0; LANES]; 3]);
        for i in list {
            let p = self.positions[*i as usize];
            let distances = distances_sq(p, centres);
            for lane in 0..LANES {
                let closer = distances[lane] < least[lane];
                least[lane] = if closer { distances[lane] } else { least[lane] };
                for axis in 0..3 {
                    nearest[axis][lane] = if closer { p[axis] } else { nearest[axis][lane] };
                }
            }
            self.table.push(distances);
        }
        (least, nearest)
    }

    /// Measures the cube of 2 x 2 x 2 voxels around `centre`.
    #[inline(always)]
    fn measure(&mut self, list: &[u32], centre: [f32; 3]) {
        let voxels = corners(centre, 0.5);
        let (mut least, mut nearest) = ([f32::INFINITY; LANES], [0; LANES]);
        for i in list {
            let distances = distances_sq(self.positions[*i as usize], &voxels);
            for lane in 0..LANES {
                let closer = distances[lane] < least[lane];
                least[lane] = if closer { distances[lane] } else { least[lane] };
                nearest[lane] = if closer { *i } else { nearest[lane] };
            }
        }
        let first = centre.map(|c| (c - 0.5 - FIRST) as usize);
        for lane in 0..LANES {
            let [x, y, z] = [0, 1, 2].map(|axis| first[axis] + (lane >> axis & 1));
            let voxel = (z * BRICK + y) * BRICK + x;
            self.closest[voxel] = nearest[lane];
            self.distances[voxel] = least[lane].sqrt();
        }
    }
}

#[inline(always)]
fn distances_sq(p: [f32; 3], centres: &[Lanes; 3]) -> Lanes {
    let mut out = [0.0; LANES];
    for lane in 0..LANES {
        let [x, y, z] = [centres[0][lane] - p[0], centres[1][lane] - p[1], centres[2][lane] - p[2]];
        out[lane] = x * x + y * y + z * z;
    }
    out
}

/// The eight points `centre +- half`, by octant: bit 0 of its number is the upper half along x, bit 1 y, bit 2 z.
#[inline(always)]
fn corners(centre: [f32; 3], half: f32) -> [Lanes; 3] {
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
fn octant_centre(centre: [f32; 3], edge: usize, octant: usize) -> [f32; 3] {
    let quarter = edge as f32 / 4.0;
    let side = |axis: usize| if octant >> axis & 1 == 0 { -quarter } else { quarter };
    [centre[0] + side(0), centre[1] + side(1), centre[2] + side(2)]
}
