//! The signed distance close to the surfels.
//!
//! A voxel's distance is an implicit moving least squares blend (Kolluri 2005) of the heights over the
//! surfels' planes. A weighted mean of plane heights is wrong by the curvature: it puts a sphere outside of
//! the points that lie on it. Here the normal of each plane is the mean of the surfel's own normal `n` and
//! the blended one `m`. With it the height is right on every sphere:
//!
//! ```text
//! s(x) = sum w (n + m).(x - p) / sum w (1 + n.m),   m = sum w n / |sum w n|
//! ```
//!
//! All sums are moments that do not know `m` yet, so one pass over the surfels does it. The weight depends on
//! how far a voxel is beside a surfel, hardly on how high it is above it. The other side of a thin part must
//! not be blended in. So a pass before that finds the closest surfel of each voxel, and only those that face
//! the same way count.

use crate::points::bricks::{BRICK, BRICK_VOXELS, Bricks, FIRST};
use crate::points::surfels::Surfel;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, BlockEdge, VoxelMask};
use rayon::prelude::*;

/// Distances are known up to this height, in voxels: all corners of a cell with surface lie within the square root of 3.
pub(crate) const HEIGHT: f32 = 1.9;
const HEIGHT_SQ: f32 = HEIGHT * HEIGHT;

/// One over the square of the height, in voxels, at which surfels would have no weight.
const INVERSE_LEVEL_SQ: f32 = 1.0 / (1.1 * HEIGHT_SQ);

/// Sheets whose heights over each other add up to less than this, in voxels, are the same.
const SAME_SHEET: f32 = 0.5;

/// A disc counts as closest as if the voxel were above it up to this share of its reach.
const DISC_SHARE: f32 = 0.3;

/// The field in one brick.
pub(crate) struct NearBrick {
    /// Signed distances in voxels; infinite where there is no surfel near.
    pub(crate) distances: [f32; BRICK_VOXELS],
    /// Unit normals, an array an axis.
    pub(crate) normals: [[f32; BRICK_VOXELS]; 3],
    /// Voxels beside which no surfel is near enough for the surface to be certain.
    pub(crate) uncertain: VoxelMask,
}

impl NearBrick {
    pub(crate) fn normal(&self, voxel: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.normals[axis][voxel])
    }
}

/// The field in all bricks that it reaches, in Morton order.
pub(crate) fn near_field(surfels: &Bricks<Surfel>, bricks: &[BlockCoord]) -> Bricks<NearBrick> {
    let lists = bricks
        .par_iter()
        .map_init(Workspace::default, |work, coord| {
            work.gather(surfels, *coord);
            (*coord, work.field().into_iter().collect())
        })
        .collect();
    Bricks::new(lists)
}

/// A value a voxel of a row along x.
type RowValues = [f32; BRICK];

/// A value a voxel, by rows.
type Values = [RowValues; BRICK * BRICK];

const ZERO: Values = [[0.0; BRICK]; BRICK * BRICK];

/// Sums over surfels, for each voxel.
#[derive(Clone)]
struct Moments {
    weights: Values,
    /// Weighted heights, normals, and offsets from the surfels.
    heights: Values,
    normals: [Values; 3],
    offsets: [Values; 3],
    /// Smallest squared distance beside a surfel, over the square within which surface is certain.
    beside: Values,
}

/// Sums over the surfels of one brick.
struct Workspace {
    /// Surfels in reach, relative to the brick's centre.
    surfels: Vec<Surfel>,
    /// Surfels that face away from a closer one somewhere.
    opposing: Vec<Surfel>,
    /// Squared distance to the closest disc, and its normal.
    closest_sq: Values,
    closest_normals: [Values; 3],
    /// Moments of the surfels that face the way of the closest, and of the others.
    facing: Moments,
    other: Moments,
}

impl Default for Workspace {
    fn default() -> Self {
        Self {
            surfels: Vec::new(),
            opposing: Vec::new(),
            closest_sq: ZERO,
            closest_normals: [ZERO; 3],
            facing: Moments::ZERO,
            other: Moments::ZERO,
        }
    }
}

impl Workspace {
    /// Takes all surfels that reach a voxel of a brick.
    fn gather(&mut self, surfels: &Bricks<Surfel>, coord: BlockCoord) {
        self.surfels.clear();
        for (step, brick) in surfels.around(coord, 1) {
            let shift = (step * BRICK as i32).as_vec3().to_array();
            for surfel in surfels.list(brick) {
                let at = [0, 1, 2].map(|axis| surfel.at[axis] + shift[axis]);
                let gap_sq: f32 = at.iter().map(|x| (x.abs() + FIRST).max(0.0).powi(2)).sum();
                if gap_sq <= surfel.reach * surfel.reach + HEIGHT_SQ {
                    self.surfels.push(Surfel { at, ..*surfel });
                }
            }
        }
    }

    /// The field, if there is any.
    fn field(&mut self) -> Option<NearBrick> {
        if self.surfels.is_empty() {
            return None;
        }
        self.closest_sq = [[f32::INFINITY; BRICK]; BRICK * BRICK];
        self.facing = Moments::ZERO;
        self.opposing.clear();
        vectorized(
            #[inline(always)]
            || {
                for surfel in &self.surfels {
                    find_closest(&mut self.closest_sq, &mut self.closest_normals, surfel);
                }
                for surfel in &self.surfels {
                    let share = |agreement: f32| (1.0 + 2.0 * agreement).clamp(0.0, 1.0);
                    if self.facing.add(surfel, &self.closest_normals, share) {
                        self.opposing.push(*surfel);
                    }
                }
                if !self.opposing.is_empty() {
                    self.other = Moments::ZERO;
                }
                for surfel in &self.opposing {
                    let share = |agreement: f32| (-2.0 * agreement).clamp(0.0, 1.0);
                    self.other.add(surfel, &self.closest_normals, share);
                }
                self.blend()
            },
        )
    }

    /// The distances from the moments.
    #[inline(always)]
    fn blend(&self) -> Option<NearBrick> {
        let mut out = NearBrick {
            distances: [f32::INFINITY; BRICK_VOXELS],
            normals: [[0.0; BRICK_VOXELS]; 3],
            uncertain: VoxelMask::empty(BlockEdge::E8),
        };
        let mut any = false;
        for voxel in 0..BRICK_VOXELS {
            let mut sheet = self.facing.sheet(voxel);
            if !self.opposing.is_empty() && self.other.weights[voxel / BRICK][voxel % BRICK] > 0.0 {
                sheet = sheet.join(self.other.sheet(voxel));
            }
            if sheet.weight > 0.0 {
                any = true;
                out.distances[voxel] = sheet.distance.clamp(-HEIGHT, HEIGHT);
                for axis in 0..3 {
                    out.normals[axis][voxel] = sheet.normal[axis];
                }
                if sheet.beside > 1.0 {
                    out.uncertain.insert(voxel);
                }
            }
        }
        any.then_some(out)
    }
}

/// Remembers a surfel where its disc is the closest so far.
#[inline(always)]
fn find_closest(closest_sq: &mut Values, normals: &mut [Values; 3], surfel: &Surfel) {
    let reach_sq = surfel.reach * surfel.reach;
    let free_sq = DISC_SHARE * DISC_SHARE * reach_sq;
    for row in Rows::new(surfel) {
        let place = row.place(surfel);
        let old_sq = closest_sq[row.index];
        let mut distances_sq = old_sq;
        for x in 0..BRICK {
            let height_sq = place.height[x] * place.height[x];
            let distance_sq = height_sq + (place.beside_sq[x] - free_sq).max(0.0);
            let closer =
                (height_sq <= HEIGHT_SQ) & (place.beside_sq[x] <= reach_sq) & (distance_sq < old_sq[x]);
            distances_sq[x] = if closer { distance_sq } else { old_sq[x] };
        }
        closest_sq[row.index] = distances_sq;
        for axis in 0..3 {
            let normals = &mut normals[axis][row.index];
            for x in 0..BRICK {
                let closer = distances_sq[x] < old_sq[x];
                normals[x] = if closer { surfel.normal[axis] } else { normals[x] };
            }
        }
    }
}

impl Moments {
    const ZERO: Self = Self {
        weights: ZERO,
        heights: ZERO,
        normals: [ZERO; 3],
        offsets: [ZERO; 3],
        beside: [[f32::INFINITY; BRICK]; BRICK * BRICK],
    };

    /// Adds a surfel, with a share of its weight by the cosine between its normal and the closest one's. Returns whether
    /// any share was below one.
    #[inline(always)]
    fn add(&mut self, surfel: &Surfel, closest: &[Values; 3], share: impl Fn(f32) -> f32) -> bool {
        let inverse_reach_sq = 1.0 / (surfel.reach * surfel.reach);
        let inverse_certain_sq = 1.0 / (surfel.certain * surfel.certain);
        let mut least = [1f32; BRICK];
        for row in Rows::new(surfel) {
            let place = row.place(surfel);
            let [a, b, c] = [closest[0][row.index], closest[1][row.index], closest[2][row.index]];
            let mut weights = [0.0; BRICK];
            for x in 0..BRICK {
                let share =
                    share(a[x] * surfel.normal[0] + b[x] * surfel.normal[1] + c[x] * surfel.normal[2]);
                let near = (1.0 - place.beside_sq[x] * inverse_reach_sq).max(0.0);
                let height_sq = place.height[x] * place.height[x];
                let level = if height_sq <= HEIGHT_SQ { 1.0 - height_sq * INVERSE_LEVEL_SQ } else { 0.0 };
                let weight = near * near * near * near * level;
                least[x] = if weight > 0.0 { least[x].min(share) } else { least[x] };
                weights[x] = weight * share;
            }
            let beside = &mut self.beside[row.index];
            for x in 0..BRICK {
                let share = place.beside_sq[x] * inverse_certain_sq;
                let counts = (weights[x] > 0.0) & (share < beside[x]);
                beside[x] = if counts { share } else { beside[x] };
            }
            add_rows(&mut self.weights[row.index], &weights, &[1.0; BRICK]);
            add_rows(&mut self.heights[row.index], &weights, &place.height);
            for axis in 0..3 {
                add_rows(&mut self.normals[axis][row.index], &weights, &[surfel.normal[axis]; BRICK]);
                add_rows(&mut self.offsets[axis][row.index], &weights, &place.offset[axis]);
            }
        }
        least.iter().any(|share| *share < 1.0)
    }

    /// The sheet that the surfels of a voxel make.
    #[inline(always)]
    fn sheet(&self, voxel: usize) -> Sheet {
        let (row, x) = (voxel / BRICK, voxel % BRICK);
        let weight = self.weights[row][x];
        let sum = [self.normals[0][row][x], self.normals[1][row][x], self.normals[2][row][x]];
        let offset = [self.offsets[0][row][x], self.offsets[1][row][x], self.offsets[2][row][x]];
        let length = dot(sum, sum).sqrt().max(f32::MIN_POSITIVE);
        Sheet {
            weight,
            distance: (self.heights[row][x] + dot(sum, offset) / length) / (weight + length),
            normal: [sum[0] / length, sum[1] / length, sum[2] / length],
            offset: [offset[0] / weight, offset[1] / weight, offset[2] / weight],
            beside: self.beside[row][x],
        }
    }
}

/// A smooth piece of surface, seen from a voxel.
#[derive(Clone, Copy)]
struct Sheet {
    weight: f32,
    /// Signed distance to it.
    distance: f32,
    normal: [f32; 3],
    /// From its mean point to the voxel.
    offset: [f32; 3],
    beside: f32,
}

impl Sheet {
    /// The sheet that makes the surface, of two that face different ways. It is the farther outside where the
    /// two bound a convex edge or a thin part. It is the farther inside where they bound a valley or a gap.
    /// Where they cannot be told apart, normals are wrong, and the one with more weight is right.
    #[inline(always)]
    fn join(self, other: Self) -> Self {
        let mut apart = 0.0;
        for axis in 0..3 {
            apart += (self.normal[axis] - other.normal[axis]) * (self.offset[axis] - other.offset[axis]);
        }
        let takes_other = if apart.abs() < SAME_SHEET {
            other.weight > self.weight
        } else if apart < 0.0 {
            other.distance > self.distance
        } else {
            other.distance < self.distance
        };
        if takes_other { other } else { self }
    }
}

/// Adds the products of two rows to a third.
#[inline(always)]
fn add_rows(sums: &mut RowValues, weights: &RowValues, values: &RowValues) {
    for x in 0..BRICK {
        sums[x] += weights[x] * values[x];
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A row of voxels along x.
struct Row {
    index: usize,
    /// Offset from the surfel to the first voxel.
    offset: [f32; 3],
}

/// Place of the voxels of a row, seen from a surfel.
struct Place {
    offset: [RowValues; 3],
    height: RowValues,
    /// Squared distance from the surfel's normal line.
    beside_sq: RowValues,
}

impl Row {
    #[inline(always)]
    fn place(&self, surfel: &Surfel) -> Place {
        let [_, y, z] = self.offset;
        let height = y * surfel.normal[1] + z * surfel.normal[2];
        let distance_sq = y * y + z * z;
        let zero = [0.0; BRICK];
        let mut place = Place { offset: [zero, [y; BRICK], [z; BRICK]], height: zero, beside_sq: zero };
        for x in 0..BRICK {
            let along = self.offset[0] + x as f32;
            place.offset[0][x] = along;
            place.height[x] = height + surfel.normal[0] * along;
            place.beside_sq[x] = distance_sq + along * along - place.height[x] * place.height[x];
        }
        place
    }
}

/// The rows of a brick that a surfel reaches.
struct Rows<'a> {
    surfel: &'a Surfel,
    next: [usize; 2],
    lo: usize,
    hi: [usize; 2],
    reach_sq: f32,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn new(surfel: &'a Surfel) -> Self {
        let reach_sq = surfel.reach * surfel.reach + HEIGHT_SQ;
        let reach = reach_sq.sqrt();
        let last = (BRICK - 1) as f32;
        let lo = |axis: usize| (surfel.at[axis] - reach - FIRST).ceil().clamp(0.0, last + 1.0) as usize;
        let hi = |axis: usize| (surfel.at[axis] + reach - FIRST).floor().clamp(-1.0, last) + 1.0;
        Self { surfel, next: [lo(1), lo(2)], lo: lo(1), hi: [hi(1) as usize, hi(2) as usize], reach_sq }
    }
}

impl Iterator for Rows<'_> {
    type Item = Row;

    #[inline(always)]
    fn next(&mut self) -> Option<Row> {
        loop {
            if self.next[0] >= self.hi[0] {
                self.next = [self.lo, self.next[1] + 1];
            }
            let [y, z] = self.next;
            if z >= self.hi[1] || self.lo >= self.hi[0] {
                return None;
            }
            self.next[0] += 1;
            let at = self.surfel.at;
            let offset = [FIRST - at[0], FIRST - at[1] + y as f32, FIRST - at[2] + z as f32];
            let distance_sq = offset[1] * offset[1] + offset[2] * offset[2];
            if distance_sq <= self.reach_sq {
                return Some(Row { index: z * BRICK + y, offset });
            }
        }
    }
}
