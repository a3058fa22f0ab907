//! The cells of a frame that have colour: those that the decoded surface crosses.

use super::crossing::{VoxelBits, crossed_cells};
use super::morton::position;
use super::surfel::{Corners, LANES, Surfel, crossed_quarters, surfels};
use isv_volume::{BlockCoord, BlockIndex, NeighbourFinder, SparseVolume};
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 64;
/// Voxels along the edge of a block and one beyond.
const SIDE: usize = 9;

/// The crossed cells of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockCells {
    /// A bit a cell, in Morton order of the voxel that is its lowest corner: a word an octant, a byte 2x2x2 cells.
    pub crossed: [u64; 8],
    /// Crossed cells before each octant, among all of the frame.
    first: [u32; 8],
}

impl BlockCells {
    /// The index among the frame's cells of the one at a place in Morton order, if it is crossed.
    #[must_use]
    #[inline(always)]
    pub fn cell(&self, place: usize) -> Option<usize> {
        let (word, bit) = (self.crossed[place >> 6], place & 63);
        if word >> bit & 1 == 0 {
            return None;
        }
        Some(self.first[place >> 6] as usize + (word & ((1 << bit) - 1)).count_ones() as usize)
    }

    /// How many cells there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.crossed.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The index of the first among the frame's cells.
    #[must_use]
    pub fn first(&self) -> usize {
        self.first[0] as usize
    }

    /// The places of the cells, in Morton order.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        self.crossed.iter().enumerate().flat_map(|(octant, word)| {
            let mut rest = *word;
            std::iter::from_fn(move || {
                let bit = rest.checked_ilog2().map(|_| rest.trailing_zeros() as usize)?;
                rest &= rest - 1;
                Some(octant << 6 | bit)
            })
        })
    }
}

/// The cells of a frame that its surface crosses, by block.
///
/// They are cells of marching cubes, which lie between eight voxels that are all there and observed. Some of these voxels are
/// inside and others outside. A cell belongs to the block of its lowest voxel.
#[derive(Clone, Debug, Default)]
pub struct ColourCells {
    coords: Vec<BlockCoord>,
    index: BlockIndex,
    blocks: Vec<BlockCells>,
    surfels: Vec<Surfel>,
}

impl ColourCells {
    /// Derives the cells of a decoded volume.
    ///
    /// # Panics
    /// If blocks have another edge than 8.
    #[must_use]
    pub fn new(volume: &SparseVolume) -> Self {
        let index = volume.index();
        let numbers: Vec<u32> = (0..volume.block_count() as u32).collect();
        let bits = VoxelBits::new(volume);
        let crossed = |block: &u32, finder: &mut NeighbourFinder| {
            finder.turn_to(volume.coords()[*block as usize]);
            crossed_cells(&bits, &finder.octet()).map(|crossed| (*block, crossed))
        };
        let found: Vec<(u32, [u64; 8])> = numbers
            .par_chunks(CHUNK)
            .flat_map_iter(|chunk| {
                let mut finder = NeighbourFinder::new(&index);
                chunk.iter().filter_map(move |block| crossed(block, &mut finder)).collect::<Vec<_>>()
            })
            .collect();
        let mut cells = 0;
        let blocks: Vec<BlockCells> = found
            .iter()
            .map(|(_, crossed)| {
                let first = crossed.map(|word| {
                    let first = cells;
                    cells += word.count_ones();
                    first
                });
                BlockCells { crossed: *crossed, first }
            })
            .collect();
        let coords: Vec<_> = found.iter().map(|(block, _)| volume.coords()[*block as usize]).collect();
        let mut surfels = vec![Surfel::default(); cells as usize];
        let mut rest = &mut surfels[..];
        let mut parts = Vec::with_capacity(blocks.len());
        for cells in &blocks {
            parts.push((cells, rest.split_off_mut(..cells.count()).expect("as many as were counted")));
        }
        parts.par_chunks_mut(CHUNK).zip(coords.par_chunks(CHUNK)).for_each(|(parts, coords)| {
            let mut finder = NeighbourFinder::new(&index);
            let mut window = Window::default();
            for ((cells, surfels), coord) in parts.iter_mut().zip(coords) {
                finder.turn_to(*coord);
                window.gather(volume, &finder.octet());
                window.derive_surfels(cells, surfels);
            }
        });
        Self { index: BlockIndex::new(&coords), coords, blocks, surfels }
    }

    /// Blocks that have cells, in Morton order.
    #[must_use]
    pub fn coords(&self) -> &[BlockCoord] {
        &self.coords
    }

    /// Look-up of these blocks.
    #[must_use]
    pub fn index(&self) -> &BlockIndex {
        &self.index
    }

    /// The cells of each block.
    #[must_use]
    pub fn blocks(&self) -> &[BlockCells] {
        &self.blocks
    }

    /// The surface in each cell: block after block, in Morton order.
    #[must_use]
    pub fn surfels(&self) -> &[Surfel] {
        &self.surfels
    }

    /// Crossed quarter cells of each cell of the blocks that are wanted, a bit each, in Morton order. `volume`: the one that the cells
    /// were derived from.
    #[must_use]
    pub fn crossed_quarters(&self, volume: &SparseVolume, wanted: impl Fn(usize) -> bool) -> Vec<u64> {
        let wanted: Vec<usize> = (0..self.blocks.len()).filter(|block| wanted(*block)).collect();
        if wanted.is_empty() {
            return Vec::new();
        }
        let index = volume.index();
        let of_chunk = |chunk: &[usize]| {
            let (mut finder, mut window) = (NeighbourFinder::new(&index), Window::default());
            let mut quarters = Vec::new();
            for block in chunk {
                finder.turn_to(self.coords[*block]);
                window.gather(volume, &finder.octet());
                let places = self.blocks[*block].places();
                quarters.extend(places.map(|place| crossed_quarters(&window.corners(position(place)))));
            }
            quarters
        };
        wanted.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
    }

    /// The surfels of a block.
    #[must_use]
    pub fn block_surfels(&self, block: usize) -> &[Surfel] {
        let cells = &self.blocks[block];
        &self.surfels[cells.first()..][..cells.count()]
    }
}

/// The codes of a block and of the next voxel along each axis.
#[derive(Clone, Debug)]
struct Window {
    codes: [i16; SIDE * SIDE * SIDE],
}

impl Default for Window {
    fn default() -> Self {
        Self { codes: [0; SIDE * SIDE * SIDE] }
    }
}

impl Window {
    /// Takes the codes of a block and of those after it. What lies in blocks that are not there stays as it was.
    fn gather(&mut self, volume: &SparseVolume, octet: &[Option<u32>; 8]) {
        for (slot, block) in octet.iter().enumerate() {
            let Some(block) = block else { continue };
            let samples = volume.block(*block as usize);
            match slot & 1 {
                0 => self.copy::<8>(samples, slot),
                _ => self.copy::<1>(samples, slot),
            }
        }
    }

    /// Copies the first `X` codes of those rows of a block that lie in the window. `slot`: of the block in its octet.
    fn copy<const X: usize>(&mut self, samples: &[i16], slot: usize) {
        let [dx, dy, dz] = [slot & 1, slot >> 1 & 1, slot >> 2];
        let count = |d: usize| if d == 0 { 8 } else { 1 };
        for z in 0..count(dz) {
            for y in 0..count(dy) {
                let to = ((z + 8 * dz) * SIDE + y + 8 * dy) * SIDE + 8 * dx;
                self.codes[to..][..X].copy_from_slice(&samples[(z * 8 + y) * 8..][..X]);
            }
        }
    }

    /// Derives the surfels of a block's cells.
    fn derive_surfels(&self, cells: &BlockCells, out: &mut [Surfel]) {
        let mut places = cells.places();
        let mut corners: Corners = [[0; LANES]; 8];
        for out in out.chunks_mut(LANES) {
            for (lane, place) in places.by_ref().take(out.len()).enumerate() {
                for (corner, code) in self.corners(position(place)).into_iter().enumerate() {
                    corners[corner][lane] = code;
                }
            }
            out.copy_from_slice(&surfels(&corners)[..out.len()]);
        }
    }

    /// The codes at the corners of a cell, x fastest.
    #[inline(always)]
    fn corners(&self, [x, y, z]: [usize; 3]) -> [i32; 8] {
        let at = (z * SIDE + y) * SIDE + x;
        std::array::from_fn(|c| {
            i32::from(self.codes[at + (c & 1) + SIDE * (c >> 1 & 1) + SIDE * SIDE * (c >> 2)])
        })
    }
}
