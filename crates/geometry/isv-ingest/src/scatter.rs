//! Distances near the surface, by scattering triangles into the voxels around them.
//!
//! Voxels are lowered in cubes of 2 x 2 x 2, eight at a time. A cube takes part if the ball around a triangle
//! and its plane are near enough. The cost goes by the number of those cubes alone. Nothing is asked about
//! how triangles hang together, and nothing is searched for. What is known of a voxel already is not asked
//! either: whatever depends on what the triangle before has stored waits for it. On request, the closest
//! triangle and its feature are kept beside each distance ([`Closest`]).

use crate::descent::LANES;
use crate::facet::{Facet, OWN, SIDES, STARTS};
use crate::tiles::{TILE_BLOCKS, VoxelMesh};
use fearless_simd::{f32x8, prelude::*, u32x8};
use glam::{DVec3, IVec3};
use isv_spatial::Feature;

/// Voxels along the edge of a block.
pub(crate) const N: usize = 8;
/// Cubes along the edge of a block, and of a tile.
pub(crate) const BLOCK_CUBES: usize = N / 2;
const EDGE: usize = TILE_BLOCKS as usize * BLOCK_CUBES;

/// From the centre of a cube to those of its voxels, in voxels; and some slack for rounding.
const HALF_DIAGONAL: f32 = 0.867;

/// By how much rounding may change the height above a plane, in voxels.
const SLACK: f32 = 1e-3;

/// Distances of the voxels of a cube from the first along each axis, and the same for eight cubes in a row.
pub(crate) const OFFSETS: [[f32; LANES]; 3] = [
    [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
];
const CUBES: [f32; LANES] = [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0];

/// Numbers of features: the face, its edges from here, and its corners from here.
const EDGES: u32 = 1;
const CORNERS: u32 = 4;

/// Triangle and feature that are closest to a voxel, as one number. It is eight times the triangle's place in
/// the list of its tile, plus the number of the feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Closest(pub(crate) u32);

impl Closest {
    /// Marks a voxel without a known triangle.
    pub(crate) const NONE: u32 = u32::MAX;

    /// Place of the triangle in the list of its tile.
    pub(crate) fn place(self) -> usize {
        (self.0 >> 3) as usize
    }

    /// Number of the feature, 0 to 6.
    pub(crate) fn number(self) -> usize {
        (self.0 & 7) as usize
    }

    /// The feature with a number.
    pub(crate) fn feature(number: usize) -> Feature {
        match number as u32 {
            0 => Feature::Face,
            edge @ 1..CORNERS => Feature::Edge((edge - EDGES) as u8),
            corner => Feature::Vertex((corner - CORNERS) as u8),
        }
    }
}

/// Squared distances in voxels from the voxel centres of a tile to some triangles: exact where they are within reach, and no less
/// elsewhere.
pub(crate) struct TileDistances {
    /// By cubes, x fastest, and in each by its voxels.
    cubes: Vec<[f32; LANES]>,
    /// Closest triangle and feature of each voxel ([`Closest`]); empty until asked for.
    closest: Vec<[u32; LANES]>,
    /// The blocks that have a distance, a bit each, x lowest.
    touched: u64,
}

impl Default for TileDistances {
    fn default() -> Self {
        Self { cubes: vec![[f32::INFINITY; LANES]; EDGE.pow(3)], closest: Vec::new(), touched: 0 }
    }
}

/// A triangle, relative to the tile's first voxel centre, and the cubes that it may be near to.
#[derive(Clone, Copy)]
struct Near {
    corners: [DVec3; 3],
    /// Place in the list of the tile.
    place: u32,
    lo: IVec3,
    hi: IVec3,
}

impl Near {
    /// None if no cube of the tile is near to the triangle.
    #[inline(always)]
    fn to_tile(place: u32, corners: [DVec3; 3], reach: f32) -> Option<Self> {
        let [a, b, c] = corners;
        // In cubes, of which the first has its centre at half a voxel along each axis.
        let lo = 0.5 * (a.min(b).min(c) - f64::from(reach) - 1.0);
        let hi = 0.5 * (a.max(b).max(c) + f64::from(reach));
        let lo = lo.ceil().as_ivec3().max(IVec3::ZERO);
        let hi = hi.floor().as_ivec3().min(IVec3::splat(EDGE as i32 - 1));
        lo.cmple(hi).all().then_some(Self { corners, place, lo, hi })
    }
}

impl TileDistances {
    /// Takes the distances of the block at a position in the tile, x fastest. Leaves them alone and returns
    /// false if none is within `reach`. Either way the tile has forgotten them.
    #[inline(always)]
    pub(crate) fn take<S: Simd>(
        &mut self,
        simd: S,
        position: [i32; 3],
        reach: f32,
        distances: &mut Vec<f32>,
    ) -> bool {
        if !self.forget_touch(position) {
            return false;
        }
        distances.resize(N.pow(3), 0.0);
        let pairs = distances.as_chunks_mut::<2>().0;
        let unknown = f32x8::splat(simd, f32::INFINITY);
        let mut least = unknown;
        for place in 0..BLOCK_CUBES.pow(3) {
            let [cx, cy, cz] = [place % 4, place / 4 % 4, place / 16];
            let cube = cube_in_tile(position, [cx, cy, cz]);
            let squares = f32x8::simd_from(simd, self.cubes[cube]);
            least = least.min(squares);
            let known: [f32; LANES] = squares.sqrt().into();
            for half in 0..LANES / 2 {
                let row = (2 * cz + half / 2) * N + 2 * cy + half % 2;
                pairs[row * (N / 2) + cx] = [known[2 * half], known[2 * half + 1]];
            }
            self.cubes[cube] = [f32::INFINITY; LANES];
        }
        least.simd_le(reach * reach).any_true()
    }

    /// Takes the distances of the block at a position in the tile, and what they are to, by cubes, x fastest. Returns false, and leaves
    /// them alone, if none is within `reach`. Either way the tile has forgotten them.
    #[inline(always)]
    pub(crate) fn take_closest<S: Simd>(
        &mut self,
        simd: S,
        position: [i32; 3],
        reach: f32,
        taken: &mut [([f32; LANES], [u32; LANES]); BLOCK_CUBES.pow(3)],
    ) -> bool {
        if !self.forget_touch(position) {
            return false;
        }
        let mut least = f32x8::splat(simd, f32::INFINITY);
        for (place, taken) in taken.iter_mut().enumerate() {
            let cube = cube_in_tile(position, [place % 4, place / 4 % 4, place / 16]);
            least = least.min(f32x8::simd_from(simd, self.cubes[cube]));
            *taken = (self.cubes[cube], self.closest[cube]);
            self.cubes[cube] = [f32::INFINITY; LANES];
            self.closest[cube] = [Closest::NONE; LANES];
        }
        least.simd_le(reach * reach).any_true()
    }

    /// Forgets that the block at a position in the tile has a distance. Returns whether it had one.
    #[inline(always)]
    fn forget_touch(&mut self, position: [i32; 3]) -> bool {
        let [x, y, z] = position.map(|c| c as usize);
        let bit = 1 << ((z * 4 + y) * 4 + x);
        let had = self.touched & bit != 0;
        self.touched &= !bit;
        had
    }

    /// Lowers the distances to those of some triangles, within `reach` voxels, and keeps what they are to if `CLOSEST`. `first`: the centre
    /// of the tile's first voxel.
    #[inline(always)]
    pub(crate) fn scatter<S: Simd, const CLOSEST: bool>(
        &mut self,
        simd: S,
        mesh: &VoxelMesh,
        faces: &[u32],
        first: DVec3,
        reach: f32,
    ) {
        if CLOSEST {
            self.closest.resize(EDGE.pow(3), [Closest::NONE; LANES]);
        }
        let mut faces = faces.iter().zip(0..);
        let nothing = Near { corners: [DVec3::ZERO; 3], place: 0, lo: IVec3::ZERO, hi: IVec3::ZERO };
        let mut batch = [nothing; LANES];
        loop {
            let mut count = 0;
            while count < LANES
                && let Some((face, place)) = faces.next()
            {
                let corners = mesh.corners(*face).map(|corner| corner - first);
                if let Some(near) = Near::to_tile(place, corners, reach) {
                    batch[count] = near;
                    count += 1;
                }
            }
            if count == 0 {
                return;
            }
            self.scatter_batch::<S, CLOSEST>(simd, &batch, count, reach);
        }
    }

    /// Lowers the distances to those of the first `count` of eight triangles.
    #[inline(always)]
    fn scatter_batch<S: Simd, const CLOSEST: bool>(
        &mut self,
        simd: S,
        batch: &[Near; LANES],
        count: usize,
        reach: f32,
    ) {
        let mut triangles = [[DVec3::ZERO; 3]; LANES];
        for lane in 0..LANES {
            triangles[lane] = batch[lane].corners;
        }
        let facets = Facet::of_eight(simd, &triangles);
        for (near, facet) in batch[..count].iter().zip(&facets) {
            self.scatter_one::<S, CLOSEST>(simd, facet, near, reach);
        }
    }

    /// Lowers the distances of the voxels of the cubes near a triangle to those of that triangle.
    #[inline(always)]
    fn scatter_one<S: Simd, const CLOSEST: bool>(&mut self, simd: S, facet: &Facet, near: &Near, reach: f32) {
        let Near { place, lo, hi, .. } = *near;
        let planes = Planes::new(simd, facet);
        let [cx, cy, cz] = facet.centre;
        let around = (facet.radius + reach + HALF_DIAGONAL).powi(2);
        let (first, last) = (lo.x as usize, hi.x as usize);
        let mut x = first;
        while x <= last {
            // Eight cubes of each row that do not leave it.
            let start = x.min(EDGE - LANES);
            let wanted = ((2u64 << (last - start).min(LANES - 1)) - 1) & !((1 << (x - start)) - 1);
            let steps = f32x8::simd_from(simd, CUBES);
            let along = steps + (2.0 * start as f32 + 0.5 - cx);
            let along_sq = along * along;
            let rises = steps * facet.growth[0][OWN];
            let column = planes.heights + planes.growth[0] * (2 * start) as f32;
            for z in lo.z..=hi.z {
                let dz = 2.0 * z as f32 + 0.5 - cz;
                let layer = column + planes.growth[2] * (2 * z) as f32;
                for y in lo.y..=hi.y {
                    let dy = 2.0 * y as f32 + 0.5 - cy;
                    let heights = layer + planes.growth[1] * (2 * y) as f32;
                    let own = rises + (heights[OWN] + planes.half_rise);
                    let is_near = (along_sq + (dy * dy + dz * dz)).simd_le(around)
                        & own.abs().simd_le(reach + planes.half_spread);
                    let mut cubes = is_near.to_bitmask() & wanted;
                    let row = (z as usize * EDGE + y as usize) * EDGE + start;
                    while cubes != 0 {
                        let cube = cubes.trailing_zeros() as usize;
                        cubes &= cubes - 1;
                        let heights = heights + planes.growth[0] * (2 * cube) as f32;
                        let known = &mut self.cubes[row + cube];
                        if CLOSEST {
                            planes.lower(facet, place, heights, known, &mut self.closest[row + cube]);
                        } else {
                            let squares = planes.squares(facet, heights);
                            *known = squares.min(f32x8::simd_from(simd, *known)).into();
                        }
                        let block = (start + cube) / BLOCK_CUBES;
                        self.touched |=
                            1 << (16 * (z as usize / BLOCK_CUBES) + 4 * (y as usize / BLOCK_CUBES) + block);
                    }
                }
            }
            x = start + LANES;
        }
    }
}

/// Place in its tile of a cube at a place in the block at a position.
#[inline(always)]
fn cube_in_tile([x, y, z]: [i32; 3], [cx, cy, cz]: [usize; 3]) -> usize {
    ((z as usize * BLOCK_CUBES + cz) * EDGE + y as usize * BLOCK_CUBES + cy) * EDGE
        + x as usize * BLOCK_CUBES
        + cx
}

/// A triangle ready for cubes.
pub(crate) struct Planes<S: Simd> {
    /// Heights of the tile's first voxel centre above the planes, a lane each, and how much they grow along each axis.
    heights: f32x8<S>,
    growth: [f32x8<S>; 3],
    /// How much each height grows from the first voxel of a cube to all of them.
    rises: [f32x8<S>; LANES],
    /// How much the first height grows from the first voxel of a cube to its centre, and at most from there to a voxel.
    half_rise: f32,
    half_spread: f32,
}

impl<S: Simd> Planes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, facet: &Facet) -> Self {
        let [x, y, z] = facet.growth;
        let [i, j, k] = OFFSETS;
        let [i, j, k] = [f32x8::simd_from(simd, i), f32x8::simd_from(simd, j), f32x8::simd_from(simd, k)];
        let mut rises = [f32x8::splat(simd, 0.0); LANES];
        for plane in 0..LANES {
            rises[plane] = i * x[plane] + j * y[plane] + k * z[plane];
        }
        Self {
            heights: f32x8::simd_from(simd, facet.heights),
            growth: [f32x8::simd_from(simd, x), f32x8::simd_from(simd, y), f32x8::simd_from(simd, z)],
            rises,
            half_rise: 0.5 * (x[OWN] + y[OWN] + z[OWN]),
            half_spread: 0.5 * (x[OWN].abs() + y[OWN].abs() + z[OWN].abs()) + SLACK,
        }
    }

    /// Squared distances of the voxels of a cube, given the heights of the first.
    #[inline(always)]
    fn squares(&self, facet: &Facet, heights: f32x8<S>) -> f32x8<S> {
        let first: [f32; LANES] = heights.into();
        let height = |plane: usize| self.rises[plane] + first[plane];
        let own = height(OWN);
        let (mut lowest, mut beside) = (height(SIDES), f32x8::splat(own.simd, f32::INFINITY));
        for side in 0..3 {
            let inward = height(SIDES + side);
            let after = height(STARTS + side);
            let outside = (-after).max(after - facet.lengths[side]).max(0.0);
            lowest = lowest.min(inward);
            beside = beside.min(inward * inward + outside * outside);
        }
        let inside = lowest.simd_ge(facet.inside_from);
        own * own + inside.select(f32x8::splat(own.simd, 0.0), beside)
    }

    /// Heights of the first voxel of a cube above the planes, given its place in the tile in voxels.
    #[inline(always)]
    pub(crate) fn heights_at(&self, [x, y, z]: [f32; 3]) -> f32x8<S> {
        self.heights + self.growth[0] * x + self.growth[1] * y + self.growth[2] * z
    }

    /// Lowers the squared distances of the voxels of a cube to those of this triangle, and notes what of it
    /// is closest. The triangle has a place in the list of its tile.
    #[inline(always)]
    pub(crate) fn lower(
        &self,
        facet: &Facet,
        place: u32,
        heights: f32x8<S>,
        known: &mut [f32; LANES],
        closest: &mut [u32; LANES],
    ) {
        let simd = heights.simd;
        let first: [f32; LANES] = heights.into();
        let height = |plane: usize| self.rises[plane] + first[plane];
        let face = u32x8::splat(simd, place << 3);
        let own = height(OWN);
        let (mut lowest, mut beside) = (height(SIDES), f32x8::splat(simd, f32::INFINITY));
        let mut part = face;
        for side in 0..3 {
            let inward = height(SIDES + side);
            let along = height(STARTS + side);
            let (before, after) = (-along, along - facet.lengths[side]);
            let outside = before.max(after).max(0.0);
            let square = inward * inward + outside * outside;
            let (edge, start) = (face + (EDGES + side as u32), face + (CORNERS + side as u32));
            let end = face + (CORNERS + (side as u32 + 1) % 3);
            let edge_or_end = after.simd_gt(0.0).select(end, edge);
            let which = before.simd_gt(0.0).select(start, edge_or_end);
            part = square.simd_lt(beside).select(which, part);
            lowest = lowest.min(inward);
            beside = beside.min(square);
        }
        let inside = lowest.simd_ge(facet.inside_from);
        let squares = own * own + inside.select(f32x8::splat(simd, 0.0), beside);
        let part = inside.select(face, part);
        let before = f32x8::simd_from(simd, *known);
        let closer = squares.simd_lt(before);
        *known = closer.select(squares, before).into();
        *closest = closer.select(part, u32x8::simd_from(simd, *closest)).into();
    }
}
