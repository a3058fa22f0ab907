//! Which triangles matter where.
//!
//! Space is cut into tiles of 4 x 4 x 4 blocks. Every triangle is listed in each tile that it may bring a
//! voxel of into the band; tiles no triangle reaches do not exist. A tile is the unit of parallel work. It is
//! small enough that its triangles stay in cache, and large enough that a triangle is listed only a few
//! times. That is three or four times on a human at 5 mm.

use glam::{DVec3, IVec3};
use isv_spatial::closest_on_triangle;
use isv_volume::{BlockCoord, Grid, MortonCode};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::borrow::Cow;

/// Blocks along the edge of a tile.
pub(crate) const TILE_BLOCKS: i32 = 4;

/// Blocks in a tile.
const TILE_VOLUME: usize = (TILE_BLOCKS * TILE_BLOCKS * TILE_BLOCKS) as usize;

/// Triangles are taken in batches expected to make at most this many list entries. Between batches the
/// numbers of tiles and of entries are checked against their limits. Until its batch is done, an entry takes
/// up to a hundred bytes, where no tile has another one; from then on, up to twenty.
const BATCH_ENTRIES: f64 = 4_194_304.0;

/// List entries of large triangles for each block that is allowed. Triangles that lie over one another share
/// their blocks. Without this limit they could be as many as a file has room for, each in all tiles. The
/// blocks of a tile that a surface passes through are sixteen or more. So this lets 64 triangles into every
/// tile of the largest volume.
const ENTRIES_PER_BLOCK: usize = 4;

/// No fewer blocks than these count: few blocks are no reason to refuse a fan of slivers.
const LEAST_BLOCKS: usize = 1 << 18;

/// Triangles that are listed together.
const TOGETHER: usize = 4096;

/// Tiles whose numbers are at hand while triangles are listed.
const RECENT: usize = 16;

/// Triangles longer than this share of a tile along an axis are listed by where they are, others by their bounding boxes.
const LARGE: f64 = 0.5;

/// Diagonal of the cubes of 2 x 2 x 2 voxels in which all of the band is measured. Some voxels of a cube are
/// up to that much farther away than the band is wide. Those are to be found close to the same part of the
/// mesh in every tile.
const CUBE_DIAGONAL: f64 = 1.75;

/// Elsewhere only rounding may take a voxel beyond.
const ROUNDING: f64 = 1e-3;

/// A mesh in voxel units: positions divided by the voxel size.
#[derive(Clone, PartialEq)]
pub(crate) struct VoxelMesh<'a> {
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) triangles: Cow<'a, [[u32; 3]]>,
}

impl VoxelMesh<'_> {
    pub(crate) fn corners(&self, face: u32) -> [DVec3; 3] {
        let [a, b, c] = self.triangles[face as usize];
        [self.vertices[a as usize], self.vertices[b as usize], self.vertices[c as usize]]
    }

    /// The mesh with data of its own, which lives as long as one likes.
    pub(crate) fn into_owned(self) -> VoxelMesh<'static> {
        VoxelMesh { vertices: self.vertices, triangles: Cow::Owned(self.triangles.into_owned()) }
    }
}

/// What decides the reach of a triangle, all in voxels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Band {
    /// Unsigned distance up to which a voxel is in the band.
    pub(crate) width: f64,
    /// Distance up to which triangles matter.
    listed: f64,
    /// Edge of a block.
    pub(crate) edge: i32,
}

impl Band {
    pub(crate) fn new(grid: &Grid, offset_voxels: f64) -> Self {
        let width = f64::from(grid.truncation.voxels()) + offset_voxels;
        Self { width, listed: width + CUBE_DIAGONAL, edge: grid.edge.voxels() as i32 }
    }

    /// The band with another width, to be measured voxel by voxel.
    pub(crate) fn within(&self, width: f64) -> Self {
        Self { width, listed: width + ROUNDING, ..*self }
    }

    /// Edge of a tile.
    pub(crate) fn tile_edge(&self) -> i32 {
        TILE_BLOCKS * self.edge
    }

    /// A cube of `edge` voxels has a voxel in the band only if its centre is closer to the surface than this.
    fn reach(&self, edge: f64) -> f64 {
        self.width + 0.5 * (edge - 1.0) * 3f64.sqrt()
    }

    /// Whether a triangle with these bounds is so small that they say where it is.
    fn is_small(&self, lo: DVec3, hi: DVec3) -> bool {
        (hi - lo).max_element() <= LARGE * f64::from(self.tile_edge())
    }

    /// Bound on the number of tiles that a small triangle is listed in.
    fn most_tiles_of_small(&self) -> f64 {
        ((LARGE + 2.0 * self.listed / f64::from(self.tile_edge())).ceil() + 1.0).powi(3)
    }

    /// Most tiles that any triangle reaches: a volume over that of a tile. The volume is that of the triangle
    /// grown by the reach and the half diagonal of a tile (Steiner's formula).
    fn most_tiles(&self, [a, b, c]: &[DVec3; 3]) -> f64 {
        let edge = f64::from(self.tile_edge());
        let r = self.reach(edge) + 0.5 * edge * 3f64.sqrt();
        let perimeter = a.distance(*b) + b.distance(*c) + c.distance(*a);
        let area = 0.5 * (*b - *a).cross(*c - *a).length();
        let pi = std::f64::consts::PI;
        (2.0 * r * area + pi / 2.0 * r * r * perimeter + 4.0 / 3.0 * pi * r * r * r) / edge.powi(3)
    }

    /// Bound from below on the number of blocks a triangle needs. No plane cuts more than sqrt(2) of a unit
    /// cube, and every tile that is cut has a voxel in the band.
    fn fewest_blocks(&self, [a, b, c]: &[DVec3; 3]) -> f64 {
        let area = 0.5 * (*b - *a).cross(*c - *a).length();
        area / (2f64.sqrt() * f64::from(self.tile_edge()).powi(2))
    }
}

/// The triangles of one tile.
#[derive(Clone, Copy)]
pub(crate) struct Tile<'a> {
    /// Position on the grid of tiles.
    pub(crate) coord: IVec3,
    /// Indices of the triangles, ascending.
    pub(crate) faces: &'a [u32],
}

impl Tile<'_> {
    /// Morton code of the tile's first block. It is larger than that of any block of an earlier tile, and
    /// smaller than that of any block of a later one.
    pub(crate) fn code(&self) -> MortonCode {
        code(self.coord)
    }

    /// Whether a block is one of its.
    pub(crate) fn has(&self, block: BlockCoord) -> bool {
        block.to_array().map(|c| c.div_euclid(TILE_BLOCKS)) == self.coord.to_array()
    }

    /// Indices of the triangles, ascending.
    pub(crate) fn faces(&self) -> impl ExactSizeIterator<Item = u32> + Clone {
        self.faces.iter().copied()
    }
}

/// Tiles with their triangles.
pub(crate) struct TileList {
    /// The tiles, each once and in Morton order if these are all, each with the end of its triangles.
    tiles: Vec<(MortonCode, usize)>,
    /// Triangles, tile after tile.
    faces: Vec<u32>,
}

/// More blocks than allowed, or so many triangles over one another that they would cost as much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OverLimit;

impl TileList {
    /// Lists the triangles of all tiles, unless that shows more than `limit` blocks to be needed or to be worked for.
    ///
    /// Every coordinate must be in the range of block coordinates.
    pub(crate) fn build(mesh: &VoxelMesh, band: &Band, limit: usize) -> Result<Self, OverLimit> {
        let mut lists: Vec<TileList> = Vec::new();
        let mut certain: FxHashSet<MortonCode> = FxHashSet::default();
        let (mut entries, most_entries) = (0, most_entries(mesh, band, limit));
        let mut start = 0;
        while start < mesh.triangles.len() {
            let end = batch_end(mesh, band, start, limit)?;
            let list = |first: usize| {
                let mut listing = Listing::default();
                for face in first..end.min(first + TOGETHER) {
                    listing.add(face as u32, mesh.corners(face as u32), band);
                }
                listing
            };
            let parts: Vec<Listing> = (start..end).into_par_iter().step_by(TOGETHER).map(list).collect();
            certain.extend(parts.iter().flat_map(|part| &part.certain));
            let first_new = lists.len();
            lists.par_extend(parts.into_par_iter().map(Listing::close));
            entries += lists[first_new..].iter().map(|list| list.faces.len()).sum::<usize>();
            if certain.len() > limit || entries > most_entries {
                return Err(OverLimit);
            }
            start = end;
        }
        Ok(Self::gather(&lists))
    }

    /// Puts the triangles of each tile behind one another, given those of some triangles after those of others.
    fn gather(lists: &[Self]) -> Self {
        let parts = lists.iter().zip(0u32..).flat_map(|(list, number)| {
            let mut start = 0;
            list.tiles
                .iter()
                .map(move |&(tile, end)| (tile, number, &list.faces[std::mem::replace(&mut start, end)..end]))
        });
        let mut parts: Vec<(MortonCode, u32, &[u32])> = parts.collect();
        parts.sort_unstable_by_key(|(tile, number, _)| (*tile, *number));
        let mut list = Self {
            tiles: Vec::new(),
            faces: Vec::with_capacity(parts.iter().map(|(.., faces)| faces.len()).sum()),
        };
        for tile in parts.chunk_by(|a, b| a.0 == b.0) {
            tile.iter().for_each(|(.., faces)| list.faces.extend_from_slice(faces));
            list.tiles.push((tile[0].0, list.faces.len()));
        }
        list
    }

    /// The tiles in Morton order.
    pub(crate) fn tiles(&self) -> Vec<Tile<'_>> {
        let mut start = 0;
        let tile = |&(tile, end): &(MortonCode, usize)| {
            let coord = IVec3::from_array(tile.coord().to_array()) / TILE_BLOCKS;
            Tile { coord, faces: &self.faces[std::mem::replace(&mut start, end)..end] }
        };
        self.tiles.iter().map(tile).collect()
    }
}

/// How many entries the lists of a mesh may have: as many as small triangles can ask for, and those of [`ENTRIES_PER_BLOCK`].
fn most_entries(mesh: &VoxelMesh, band: &Band, limit: usize) -> usize {
    let of_small = mesh.triangles.len().saturating_mul(band.most_tiles_of_small() as usize);
    limit.max(LEAST_BLOCKS).saturating_mul(ENTRIES_PER_BLOCK).saturating_add(of_small)
}

/// The end of the batch of triangles that begins at `start`.
fn batch_end(mesh: &VoxelMesh, band: &Band, start: usize, limit: usize) -> Result<usize, OverLimit> {
    let (mut expected, most_of_small) = (0.0, band.most_tiles_of_small());
    for face in start..mesh.triangles.len() {
        let corners = mesh.corners(face as u32);
        let [a, b, c] = corners;
        if band.is_small(a.min(b).min(c), a.max(b).max(c)) {
            expected += most_of_small;
        } else {
            if band.fewest_blocks(&corners) > limit as f64 {
                return Err(OverLimit);
            }
            expected += band.most_tiles(&corners);
        }
        if expected > BATCH_ENTRIES {
            return Ok(face + 1);
        }
    }
    Ok(mesh.triangles.len())
}

/// A triangle to be listed.
struct Triangle {
    face: u32,
    corners: [DVec3; 3],
    /// Bounds of the triangle.
    lo: DVec3,
    hi: DVec3,
    /// Whether its bounds say too little about where it is.
    is_large: bool,
}

/// The tiles of some triangles.
#[derive(Default)]
struct Listing {
    /// The triangles of each.
    tiles: Vec<(IVec3, Vec<u32>)>,
    numbers: FxHashMap<IVec3, u32>,
    /// Most triangles are in the tiles of those just before them.
    recent: [Option<(IVec3, u32)>; RECENT],
    /// Tiles that are sure to have a voxel in the band, each giving at least one block.
    certain: FxHashSet<MortonCode>,
    /// The last of those found by a small triangle.
    last: Option<IVec3>,
}

impl Listing {
    fn add(&mut self, face: u32, corners: [DVec3; 3], band: &Band) {
        let [a, b, c] = corners;
        let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
        let is_large = !band.is_small(lo, hi);
        // Tiles have a power of two of voxels: nothing is rounded.
        let scale = 1.0 / f64::from(band.tile_edge());
        let [first, last] = [(lo - band.listed) * scale, (hi + band.listed) * scale].map(floor);
        if first == last && !is_large {
            self.push(first, face);
        } else {
            self.add_range(first, last, &Triangle { face, corners, lo, hi, is_large }, band);
        }
        // Any point of a tile is less than a voxel from a voxel centre there, and bands are wider.
        let home = floor(a * scale);
        if !is_large && self.last != Some(home) {
            self.last = Some(home);
            self.certain.insert(code(home));
        }
    }

    /// What is listed, as a list of tiles in the order in which they were found.
    fn close(self) -> TileList {
        let entries = self.tiles.iter().map(|(_, faces)| faces.len()).sum();
        let mut list =
            TileList { tiles: Vec::with_capacity(self.tiles.len()), faces: Vec::with_capacity(entries) };
        for (tile, faces) in self.tiles {
            list.faces.extend(faces);
            list.tiles.push((code(tile), list.faces.len()));
        }
        list
    }

    /// Lists a triangle in a tile.
    fn push(&mut self, tile: IVec3, face: u32) {
        let slot = &mut self.recent[(tile.x + 3 * tile.y + 5 * tile.z).rem_euclid(RECENT as i32) as usize];
        let (_, number) = slot.filter(|(known, _)| *known == tile).unwrap_or_else(|| {
            let number = *self.numbers.entry(tile).or_insert_with(|| {
                self.tiles.push((tile, Vec::new()));
                self.tiles.len() as u32 - 1
            });
            *slot.insert((tile, number))
        });
        self.tiles[number as usize].1.push(face);
    }

    /// Adds the tiles of the inclusive range `lo..=hi` that the triangle reaches. Ranges of more than a few
    /// tiles are halved and culled as wholes. So a long diagonal triangle costs by its area, not by its
    /// bounding box. The recursion halves 21-bit ranges and is at most 63 deep.
    fn add_range(&mut self, lo: IVec3, hi: IVec3, triangle: &Triangle, band: &Band) {
        let size = hi - lo + 1;
        if size.max_element() <= 2 {
            for z in lo.z..=hi.z {
                for y in lo.y..=hi.y {
                    for x in lo.x..=hi.x {
                        self.add_tile(IVec3::new(x, y, z), triangle, band);
                    }
                }
            }
            return;
        }
        let edge = f64::from(band.tile_edge());
        let centre = (lo + hi + 1).as_dvec3() * (0.5 * edge);
        let reach = band.listed + 0.5 * edge * size.as_dvec3().length();
        if distance(centre, &triangle.corners) > reach {
            return;
        }
        let axis = size.max_position();
        let middle = lo[axis] + size[axis] / 2;
        let (mut lower, mut upper) = (hi, lo);
        lower[axis] = middle - 1;
        upper[axis] = middle;
        self.add_range(lo, lower, triangle, band);
        self.add_range(upper, hi, triangle, band);
    }

    /// Adds a tile if the bounds of the triangle come close enough to its voxels, and the triangle itself, if it is large.
    fn add_tile(&mut self, tile: IVec3, triangle: &Triangle, band: &Band) {
        let edge = f64::from(band.tile_edge());
        let first = tile.as_dvec3() * edge + 0.5;
        let last = first + (edge - 1.0);
        let apart = (triangle.lo - last).max(first - triangle.hi).max(DVec3::ZERO);
        if apart.length_squared() > (band.listed).powi(2) {
            return;
        }
        if triangle.is_large {
            let d = distance((tile.as_dvec3() + 0.5) * edge, &triangle.corners);
            if d > band.reach(edge) {
                return;
            }
            // Walking half an edge towards the surface, less the distance to a voxel centre, stays inside the tile.
            if d <= band.width + 0.5 * edge - 2.0 {
                self.certain.insert(code(tile));
            }
        }
        self.push(tile, triangle.face);
    }
}

/// The whole numbers below.
fn floor(p: DVec3) -> IVec3 {
    // Library rounding is a call for each number on plain x86-64.
    let near = p.as_ivec3();
    let above = near.as_dvec3().cmpgt(p);
    near - IVec3::new(above.x.into(), above.y.into(), above.z.into())
}

/// A tile as the Morton code of its first block.
fn code(tile: IVec3) -> MortonCode {
    BlockCoord::from((tile * TILE_BLOCKS).to_array()).morton()
}

fn distance(p: DVec3, corners: &[DVec3; 3]) -> f64 {
    closest_on_triangle(p, corners).0.distance(p)
}

/// Bound on the number of active blocks, without evaluating a voxel: those whose centre is within reach of the surface.
/// Where even all blocks of all tiles stay within `enough`, that number is good enough and returned instead.
pub(crate) fn count_blocks(mesh: &VoxelMesh, band: &Band, tiles: &[Tile], enough: usize) -> usize {
    let all = tiles.len() * TILE_VOLUME;
    if all <= enough { all } else { tiles.par_iter().map(|tile| count_tile(mesh, band, tile)).sum() }
}

fn count_tile(mesh: &VoxelMesh, band: &Band, tile: &Tile) -> usize {
    let edge = f64::from(band.edge);
    let reach = band.reach(edge);
    let first = tile.coord * TILE_BLOCKS;
    let mut found = [false; TILE_VOLUME];
    for face in tile.faces() {
        let corners = mesh.corners(face);
        let [a, b, c] = corners;
        let block_of = |p: DVec3| (p / edge).floor().as_ivec3() - first;
        let lo = block_of(a.min(b).min(c) - band.width).max(IVec3::ZERO);
        let hi = block_of(a.max(b).max(c) + band.width).min(IVec3::splat(TILE_BLOCKS - 1));
        for z in lo.z..=hi.z {
            for y in lo.y..=hi.y {
                for x in lo.x..=hi.x {
                    let slot = &mut found[((z * TILE_BLOCKS + y) * TILE_BLOCKS + x) as usize];
                    let centre = ((first + IVec3::new(x, y, z)).as_dvec3() + 0.5) * edge;
                    *slot = *slot || distance(centre, &corners) <= reach;
                }
            }
        }
    }
    found.iter().filter(|f| **f).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::Random;

    /// Distance from a triangle to the closest voxel centre of a tile.
    fn to_voxels(tile: IVec3, edge: i32, corners: &[DVec3; 3]) -> f64 {
        let centre = |voxel: i32| {
            let [x, y, z] = [voxel % edge, voxel / edge % edge, voxel / (edge * edge)];
            (tile * edge + IVec3::new(x, y, z)).as_dvec3() + 0.5
        };
        (0..edge.pow(3)).map(|voxel| distance(centre(voxel), corners)).fold(f64::INFINITY, f64::min)
    }

    /// Some equal right triangles, whose legs are that many voxels long.
    fn pile(count: usize, leg: f64) -> VoxelMesh<'static> {
        let vertices = vec![DVec3::ZERO, DVec3::X * leg, DVec3::Y * leg];
        VoxelMesh { vertices, triangles: vec![[0, 1, 2]; count].into() }
    }

    #[test]
    fn large_triangles_over_one_another_are_refused_and_small_ones_are_not() {
        let band = Band { width: 8.0, listed: 8.0 + CUBE_DIAGONAL, edge: 8 };
        let listed = |mesh| TileList::build(&mesh, &band, LEAST_BLOCKS).map(|list| list.faces.len());
        let each = listed(pile(1, 640.0)).unwrap();
        assert!(each > 400, "{each} tiles");
        let enough = LEAST_BLOCKS * ENTRIES_PER_BLOCK / each;
        assert_eq!(listed(pile(enough, 640.0)).unwrap(), enough * each);
        assert!(listed(pile(2 * enough, 640.0)).is_err());
        // All of whose tiles are counted by the number of triangles.
        let (many, each) = (300_000, listed(pile(1, 4.0)).unwrap());
        assert!(many * each > LEAST_BLOCKS * ENTRIES_PER_BLOCK);
        assert_eq!(listed(pile(many, 4.0)).unwrap(), many * each);
    }

    #[test]
    fn small_and_large_triangles_are_listed_in_every_tile_they_matter_in() {
        let band = Band { width: 3.0, listed: 3.0 + CUBE_DIAGONAL, edge: 4 };
        let edge = band.tile_edge();
        let mut random = Random::new(71);
        for size in [0.0, 2.0, 6.0, 30.0] {
            for _ in 0..4 {
                let place = random.point() * 20.0;
                let corners = [0; 3].map(|_| place + random.point() * size);
                let mut listing = Listing::default();
                listing.add(0, corners, &band);
                let listed: FxHashSet<MortonCode> =
                    listing.tiles.iter().map(|(tile, _)| code(*tile)).collect();
                assert!(listing.tiles.iter().all(|(_, faces)| *faces == [0]), "no tile is listed twice");
                assert!(!listing.certain.is_empty() && listing.certain.is_subset(&listed));
                for tile in (0..512).map(|i| IVec3::new(i % 8, i / 8 % 8, i / 64) - 4) {
                    let in_band = to_voxels(tile, edge, &corners) <= band.width;
                    assert!(!in_band || listed.contains(&code(tile)), "{tile} {corners:?}");
                    assert!(in_band || !listing.certain.contains(&code(tile)), "{tile} {corners:?}");
                }
            }
        }
    }
}
