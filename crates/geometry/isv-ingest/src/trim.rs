//! Exact end of a surface at the rim of a hole: teeth and specks are trimmed.
//!
//! No surface is made in a cell with an unobserved corner. Which voxels have their closest surface point on
//! the rim, though, is rough at the scale of a voxel. The surface would end in teeth and specks. So surface
//! cells near the rim that hang on by less than two of their neighbours are unobserved as well. In turn those
//! go that hung on by them.

use crate::caps::Blocks;
use isv_volume::{BlockEdge, BlockIndex, Neighbourhood, VoxelMask};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;

/// Neighbours on the surface that a cell needs to stay.
const HOLD: usize = 2;
/// Rounds of removal: teeth up to this many cells long vanish.
const ROUNDS: usize = 4;

/// Marks of corners: inside, or unobserved or without a voxel.
const INSIDE: u8 = 1;
const OUT_OF_SIGHT: u8 = 2;

/// The corners of a cell, from the lowest, x in the lowest bit of the corner's number.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// The slot in a block's neighbourhood of one so many ahead along each axis.
fn slot([x, y, z]: [usize; 3]) -> usize {
    (z + 1) * 9 + (y + 1) * 3 + x + 1
}

/// A voxel: its block, and its index there.
type VoxelAt = (u32, u16);

/// A cell that the surface passes through.
struct SurfaceCell {
    /// The corner with the lowest coordinates, in voxels of the whole grid.
    base: [i32; 3],
    /// Corners, x in the lowest bit of the corner's number.
    corners: [VoxelAt; 8],
    /// Bit `i`: corner `i` lies inside.
    inside: u8,
}

impl Blocks {
    /// Takes teeth and specks off the surface's ends.
    pub(crate) fn trim_rims(&mut self, edge: BlockEdge) {
        let blocks = BlockIndex::new(&self.coords);
        // A sheet ends where it does: strips of a cell's width are no teeth.
        let masked: BTreeSet<u32> =
            self.masks.keys().copied().filter(|block| !self.of_sheets.contains(block)).collect();
        let near = self.with_neighbours(&masked, &blocks);
        let around: BTreeSet<u32> = &self.with_neighbours(&near, &blocks) - &near;
        let mut cells = self.observed_cells(&near, &blocks, edge);
        let trimmed = cells.len();
        // The surface goes on beyond the blocks that are looked at, and what holds on to that is no end.
        cells.extend(self.observed_cells(&around, &blocks, edge));
        let index: FxHashMap<[i32; 3], u32> =
            cells.iter().enumerate().map(|(i, cell)| (cell.base, i as u32)).collect();
        let across: Vec<[Option<u32>; 6]> =
            cells[..trimmed].par_iter().map(|cell| neighbours(cell, &index)).collect();
        let mut stays = vec![true; cells.len()];
        for _ in 0..ROUNDS {
            let staying = |neighbours: &[Option<u32>; 6]| {
                neighbours.iter().flatten().filter(|neighbour| stays[**neighbour as usize]).count()
            };
            let holds: Vec<bool> =
                across.iter().zip(&stays).map(|(n, stays)| *stays && staying(n) >= HOLD).collect();
            stays[..trimmed].copy_from_slice(&holds);
        }
        self.remove(&cells, &stays, &index, edge);
    }

    /// A set of blocks and all blocks that touch one of them.
    fn with_neighbours(&self, blocks: &BTreeSet<u32>, index: &BlockIndex) -> BTreeSet<u32> {
        blocks.iter().flat_map(|b| index.neighbourhood(self.coords[*b as usize])).flatten().collect()
    }

    /// The surface cells that begin in a set of blocks and have no unobserved corner, in block order.
    fn observed_cells(
        &self,
        blocks: &BTreeSet<u32>,
        index: &BlockIndex,
        edge: BlockEdge,
    ) -> Vec<SurfaceCell> {
        let blocks: Vec<u32> = blocks.iter().copied().collect();
        let around = |block: u32| index.neighbourhood(self.coords[block as usize]);
        blocks
            .par_iter()
            .flat_map_iter(|block| self.observed_cells_of(*block, &around(*block), edge))
            .collect()
    }

    /// The surface cells that begin in a block and have all their corners, observed.
    fn observed_cells_of(&self, block: u32, around: &Neighbourhood, edge: BlockEdge) -> Vec<SurfaceCell> {
        let (bits, last, side) = (edge.log2(), edge.voxels() - 1, edge.voxels() + 1);
        let origin = self.coords[block as usize].to_array().map(|c| c << bits);
        let marks = self.corner_marks(around, edge);
        let voxel_at = |place: [usize; 3]| {
            let voxel = edge.voxel_index(place[0] & last, place[1] & last, place[2] & last);
            (around[slot(place.map(|p| p >> bits))].unwrap_or(block), voxel as u16)
        };
        let steps: [usize; 8] = CORNERS.map(|[x, y, z]| (z * side + y) * side + x);
        let cell = |voxel: usize| {
            let place = [voxel & last, voxel >> bits & last, voxel >> (2 * bits)];
            let first = (place[2] * side + place[1]) * side + place[0];
            let (mut any, mut all) = (0, u8::MAX);
            for step in steps {
                any |= marks[first + step];
                all &= marks[first + step];
            }
            if any != INSIDE || all == INSIDE {
                return None;
            }
            let corner_places = CORNERS.map(|corner| std::array::from_fn(|axis| place[axis] + corner[axis]));
            let inside = (0..8).fold(0, |inside, corner| inside | marks[first + steps[corner]] << corner);
            let base = std::array::from_fn(|axis| origin[axis] + place[axis] as i32);
            Some(SurfaceCell { base, corners: corner_places.map(voxel_at), inside })
        };
        (0..edge.block_voxels()).filter_map(cell).collect()
    }

    /// Marks of the corners of all cells that begin in a block, x fastest: whether they are inside,
    /// unobserved, or not there at all.
    fn corner_marks(&self, around: &Neighbourhood, edge: BlockEdge) -> Vec<u8> {
        let (n, size) = (edge.voxels(), edge.block_voxels());
        let side = n + 1;
        let mut marks = vec![OUT_OF_SIGHT; side.pow(3)];
        for ahead in CORNERS {
            let Some(block) = around[slot(ahead)] else { continue };
            let samples = &self.samples[block as usize * size..][..size];
            let mask = self.masks.get(&block);
            // Of a block ahead along an axis, only the first layer.
            let [nx, ny, nz] = ahead.map(|ahead| if ahead == 0 { n } else { 1 });
            for (z, y) in (0..nz).flat_map(|z| (0..ny).map(move |y| (z, y))) {
                for x in 0..nx {
                    let voxel = edge.voxel_index(x, y, z);
                    let unobserved = mask.is_some_and(|mask| mask.contains(voxel));
                    let place = ((z + ahead[2] * n) * side + y + ahead[1] * n) * side + x + ahead[0] * n;
                    marks[place] =
                        if unobserved { OUT_OF_SIGHT } else { u8::from(samples[voxel] < 0) * INSIDE };
                }
            }
        }
        marks
    }

    /// Makes the corners of cells that do not stay unobserved, but for those that they share with cells that do.
    fn remove(
        &mut self,
        cells: &[SurfaceCell],
        stays: &[bool],
        index: &FxHashMap<[i32; 3], u32>,
        edge: BlockEdge,
    ) {
        let moved = |place: [i32; 3], corner: [usize; 3], way: i32| -> [i32; 3] {
            std::array::from_fn(|axis| place[axis] + way * corner[axis] as i32)
        };
        let is_held = |place: [i32; 3]| {
            let around = CORNERS.iter().filter_map(|corner| index.get(&moved(place, *corner, -1)));
            around.into_iter().any(|cell| stays[*cell as usize])
        };
        for (cell, _) in cells.iter().zip(stays).filter(|(_, stays)| !**stays) {
            for (corner, (block, voxel)) in CORNERS.iter().zip(cell.corners) {
                if !is_held(moved(cell.base, *corner, 1)) {
                    let mask = self.masks.entry(block).or_insert_with(|| VoxelMask::empty(edge));
                    mask.insert(usize::from(voxel));
                }
            }
        }
    }
}

/// The cells that the surface goes on to from a cell: those across its faces whose corners lie on both sides.
fn neighbours(cell: &SurfaceCell, index: &FxHashMap<[i32; 3], u32>) -> [Option<u32>; 6] {
    /// Corners of the face at the low end of each axis.
    const LOW_FACE: [u8; 3] = [0b0101_0101, 0b0011_0011, 0b0000_1111];
    std::array::from_fn(|face| {
        let (axis, high) = (face / 2, face % 2);
        let corners = if high == 1 { !LOW_FACE[axis] } else { LOW_FACE[axis] };
        let mixed = cell.inside & corners != 0 && cell.inside & corners != corners;
        let mut base = cell.base;
        base[axis] += if high == 1 { 1 } else { -1 };
        if mixed { index.get(&base).copied() } else { None }
    })
}
