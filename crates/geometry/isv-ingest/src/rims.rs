//! Which voxels are unobserved because their closest surface point lies on the rim of a wide hole.

use crate::holes::WideHoles;
use crate::tiles::{Band, OverLimit, TileList, VoxelMesh};
use fearless_simd::{dispatch, f32x8, prelude::*};
use glam::{DVec3, IVec3, Vec3};
use isv_kernels::simd;
use isv_volume::{BlockEdge, VoxelMask};
use rustc_hash::FxHashMap;

/// Voxels along the edge of a block.
const N: usize = 8;

/// By how much, in voxels, the distance to a rim may come out larger than that to the faces there, by rounding alone.
const SLACK: f32 = 1e-5;

/// The rims of all wide holes, by tiles.
pub(crate) struct Rims {
    segments: Vec<[DVec3; 2]>,
    tiles: FxHashMap<IVec3, Vec<u32>>,
    band: f32,
}

impl Rims {
    /// The rims that may be closest to voxels of each tile; `band`: how far they may be.
    pub(crate) fn new(holes: &WideHoles, band: &Band) -> Self {
        let segments = holes.rims.clone();
        let vertices = segments.iter().flatten().copied().collect();
        let flat: Vec<[u32; 3]> = (0..segments.len() as u32).map(|i| [2 * i, 2 * i + 1, 2 * i + 1]).collect();
        let list = TileList::build(&VoxelMesh { vertices, triangles: flat.into() }, band, usize::MAX);
        let tiles =
            |list: TileList| list.tiles().iter().map(|tile| (tile.coord, tile.faces().collect())).collect();
        Self {
            segments,
            tiles: list.map_or_else(|OverLimit| FxHashMap::default(), tiles),
            band: band.width as f32,
        }
    }

    /// The rims in a tile.
    pub(crate) fn in_tile(&self, tile: IVec3) -> impl Iterator<Item = [DVec3; 2]> {
        self.tiles.get(&tile).into_iter().flatten().map(|rim| self.segments[*rim as usize])
    }

    /// The voxels of a block of a tile that are no closer to anything else, if there are any. `first`: the centre of the block's first
    /// voxel; `distances`: those of its voxels, x fastest.
    pub(crate) fn unobserved(&self, tile: IVec3, first: DVec3, distances: &[f32]) -> Option<VoxelMask> {
        let mut squares = [self.band * self.band; N * N * N];
        for rim in self.in_tile(tile) {
            let [a, b] = rim.map(|end| end - first);
            let apart = a.min(b) - (N - 1) as f64;
            let apart = apart.max(-a.max(b)).max(DVec3::ZERO);
            if apart.length() < f64::from(self.band) {
                dispatch!(simd::level(), simd => lower(simd, &mut squares, a, b));
            }
        }
        let is_closest = |voxel: &usize| {
            let square = squares[*voxel];
            square < self.band * self.band && square.sqrt() <= distances[*voxel] + SLACK
        };
        let mut mask = None;
        for voxel in (0..distances.len()).filter(is_closest) {
            mask.get_or_insert_with(|| VoxelMask::empty(BlockEdge::E8)).insert(voxel);
        }
        mask
    }
}

/// Lowers squared distances from the voxels of a block to those from a segment, given relative to the first voxel.
#[inline(always)]
fn lower<S: Simd>(simd: S, squares: &mut [f32; N * N * N], a: DVec3, b: DVec3) {
    let length = a.distance(b);
    let way: Vec3 = ((b - a) / length).as_vec3();
    let way = if way.is_finite() { way } else { Vec3::X };
    let (a, length) = (a.as_vec3(), length as f32);
    let x = f32x8::simd_from(simd, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) - a.x;
    for row in 0..N * N {
        let (y, z) = ((row % N) as f32 - a.y, (row / N) as f32 - a.z);
        let along = (x * way.x + (y * way.y + z * way.z)).max(0.0).min(length);
        let (dx, dy, dz) = (x - along * way.x, y - along * way.y, z - along * way.z);
        let square = dx * dx + dy * dy + dz * dz;
        let known = &mut squares[row * N..][..N];
        f32x8::from_slice(simd, known).min(square).store_slice(known);
    }
}
