//! Distances near the surface, by scattering triangles into the voxels around them.
//!
//! A triangle is looked at once for each row of voxels that it may be near to, eight voxels at a time. It costs by the number of
//! those voxels alone: nothing is asked about how triangles hang together, and nothing is searched for.

use crate::descent::LANES;
use crate::tiles::VoxelMesh;
use fearless_simd::{f32x8, prelude::*};
use glam::{DVec3, IVec3};

/// A triangle whose height is below this, in voxels, is no more than its longest side.
const FLAT: f64 = 1e-4;

/// Farther than any voxel of a tile.
const FAR_AWAY: f32 = 1e6;

/// Squared distances in voxels from the voxel centres of a tile to some triangles, x fastest: exact where they are within reach,
/// and no less elsewhere.
#[derive(Default)]
pub(crate) struct TileDistances {
    edge: usize,
    squares: Vec<f32>,
}

impl TileDistances {
    /// Forgets everything, in a tile of `edge` voxels.
    pub(crate) fn restart(&mut self, edge: usize) {
        self.edge = edge;
        self.squares.clear();
        self.squares.resize(edge.pow(3), f32::INFINITY);
    }

    /// `count` squared distances from a voxel of the tile on, along x.
    pub(crate) fn row(&self, [x, y, z]: [usize; 3], count: usize) -> &[f32] {
        &self.squares[(z * self.edge + y) * self.edge + x..][..count]
    }

    /// Lowers the distances to those of some triangles, within `reach` voxels. `first`: the centre of the tile's first voxel.
    #[inline(always)]
    pub(crate) fn scatter<S: Simd>(
        &mut self,
        simd: S,
        mesh: &VoxelMesh,
        faces: impl Iterator<Item = u32>,
        first: DVec3,
        reach: f32,
    ) {
        let last = IVec3::splat(self.edge as i32 - 1);
        for face in faces {
            let corners = mesh.corners(face).map(|corner| corner - first);
            let [a, b, c] = corners;
            let lo = (a.min(b).min(c) - f64::from(reach)).ceil().as_ivec3().max(IVec3::ZERO);
            let hi = (a.max(b).max(c) + f64::from(reach)).floor().as_ivec3().min(last);
            if lo.cmple(hi).all() {
                self.scatter_one(&Facet::new(simd, corners), lo, hi, reach);
            }
        }
    }

    /// Lowers the distances of the voxels `lo..=hi` to those of a triangle.
    #[inline(always)]
    fn scatter_one<S: Simd>(&mut self, facet: &Facet<S>, lo: IVec3, hi: IVec3, reach: f32) {
        let simd = facet.heights.simd;
        let around = (facet.radius + reach).powi(2);
        let [cx, cy, cz] = facet.centre;
        let mut x = lo.x as usize;
        while x <= hi.x as usize {
            // Eight voxels of each row that do not leave it.
            let start = x.min(self.edge - LANES);
            let along = f32x8::simd_from(simd, STEPS) + (start as f32 - cx);
            let plane = facet.heights + facet.growth[0] * start as f32;
            for z in lo.z..=hi.z {
                for y in lo.y..=hi.y {
                    let (dy, dz) = (y as f32 - cy, z as f32 - cz);
                    let beside = dy * dy + dz * dz;
                    if beside > around {
                        continue;
                    }
                    let row = (z as usize * self.edge + y as usize) * self.edge + start;
                    let known = &mut self.squares[row..][..LANES];
                    let lower = f32x8::from_slice(simd, known);
                    // No closer than its ball, it lowers nothing where that is farther away.
                    let least = lower.sqrt().min(reach) + facet.radius;
                    if (along * along + beside).simd_ge(least * least).all_true() {
                        continue;
                    }
                    let heights = plane + facet.growth[1] * y as f32 + facet.growth[2] * z as f32;
                    if !facet.is_beyond(&heights, reach) {
                        lower.min(facet.squares(heights)).store_slice(known);
                    }
                }
            }
            x = start + LANES;
        }
    }
}

/// A triangle, by the heights of a point above planes, a lane each: its own; the three that hold a side and are square to the
/// triangle, which lies above them; and the three that are square to a side, at its start.
struct Facet<S: Simd> {
    /// Heights of the tile's first voxel centre, and how much they grow along each axis.
    heights: f32x8<S>,
    growth: [f32x8<S>; 3],
    /// Growth of each height along eight voxels.
    along_x: [f32x8<S>; LANES],
    /// Half of what the first height grows from the first of them to the last.
    half_rise: f32,
    /// A ball around it.
    centre: [f32; 3],
    radius: f32,
    /// Lengths of the sides.
    lengths: [f32; 3],
    /// What the heights above the sides are at least where the closest point is inside the triangle.
    inside_from: f32,
}

/// Of eight voxels of a row, how far each is from the first.
const STEPS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Lanes of the planes.
const OWN: usize = 0;
const SIDES: usize = 1;
const STARTS: usize = 4;

impl<S: Simd> Facet<S> {
    #[inline(always)]
    fn new(simd: S, corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        let area = (b - a).cross(c - a);
        let edges = [b - a, c - b, a - c];
        let lengths = edges.map(DVec3::length);
        let longest = (0..3).fold(0, |a, b| if lengths[b] > lengths[a] { b } else { a });
        let is_flat = area.length() <= FLAT * lengths[longest];
        let normal = if is_flat {
            (edges[longest] / lengths[longest]).any_orthonormal_vector()
        } else {
            area.normalize()
        };
        let (mut heights, mut growth, mut ends) = ([0.0; LANES], [[0.0; LANES]; 3], [0.0; 3]);
        let mut set = |plane: usize, normal: DVec3, point: DVec3| {
            heights[plane] = -normal.dot(point) as f32;
            (0..3).for_each(|axis| growth[axis][plane] = normal[axis] as f32);
        };
        set(OWN, normal, a);
        for plane in 0..3 {
            // The other sides of a flat triangle may point anywhere.
            let side = if is_flat { longest } else { plane };
            let along = edges[side] / lengths[side];
            set(SIDES + plane, normal.cross(along), corners[side]);
            set(STARTS + plane, along, corners[side]);
            ends[plane] = lengths[side] as f32;
        }
        // About the smallest ball: that around the longest side, widened to the third corner.
        let centre = 0.5 * (corners[longest] + corners[(longest + 1) % 3]);
        let radius = corners.map(|corner| corner.distance(centre)).into_iter().fold(0.0, f64::max);
        let [x, ..] = growth;
        let mut along_x = [f32x8::splat(simd, 0.0); LANES];
        for (along_x, growth) in along_x.iter_mut().zip(x) {
            *along_x = f32x8::simd_from(simd, STEPS) * growth;
        }
        Self {
            heights: f32x8::simd_from(simd, heights),
            growth: growth.map(|growth| f32x8::simd_from(simd, growth)),
            along_x,
            half_rise: 0.5 * (LANES - 1) as f32 * x[OWN],
            centre: centre.as_vec3().to_array(),
            // Of a triangle larger than a tile, rounding moves the ball by less than this.
            radius: (radius * (1.0 + 1e-6) + 1e-3) as f32,
            lengths: ends,
            inside_from: if is_flat { FAR_AWAY } else { 0.0 },
        }
    }

    /// Whether eight voxels of a row are all farther than `reach` from the triangle's plane, given the heights of the first.
    #[inline(always)]
    fn is_beyond(&self, heights: &f32x8<S>, reach: f32) -> bool {
        (heights[OWN] + self.half_rise).abs() > reach + self.half_rise.abs()
    }

    /// Squared distances of eight voxels of a row, given the heights of the first.
    #[inline(always)]
    fn squares(&self, heights: f32x8<S>) -> f32x8<S> {
        let first: [f32; LANES] = heights.into();
        let height = |plane: usize| self.along_x[plane] + first[plane];
        let own = height(OWN);
        let own_sq = own * own;
        let (mut lowest, mut beside) = (height(SIDES), f32x8::splat(own.simd, f32::INFINITY));
        for side in 0..3 {
            let inward = height(SIDES + side);
            let after = height(STARTS + side);
            let outside = (-after).max(after - self.lengths[side]).max(0.0);
            lowest = lowest.min(inward);
            beside = beside.min(inward * inward + outside * outside);
        }
        let inside = lowest.simd_ge(self.inside_from);
        own_sq + inside.select(f32x8::splat(own.simd, 0.0), beside)
    }
}
