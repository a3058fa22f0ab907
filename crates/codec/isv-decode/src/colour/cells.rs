//! The cells of a frame that have colour: those that the decoded surface crosses.

use super::morton::{interleave, position};
use isv_kernels::signs::inside;
use isv_volume::{BlockCoord, BlockIndex, NeighbourFinder, SparseVolume};
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 64;
/// Voxels along the edge of a block and one beyond.
const SIDE: usize = 9;

/// The plane that stands for the surface in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Surfel {
    /// From the cell's middle to the plane's nearest point, in 1/256 voxel; at most one voxel along each axis.
    pub offset: [i16; 3],
    /// The unit normal, towards the outside, times 127.
    pub normal: [i8; 3],
    /// Half cells that the surface crosses, a bit each: x from the lowest bit, then y, z.
    pub halves: u8,
}

impl Surfel {
    /// The surfel of a cell from the codes at its corners, x fastest.
    fn new(corners: [i32; 8]) -> Self {
        let sum: i32 = corners.iter().sum();
        // Four times the gradient, in codes a voxel.
        let gradient: [i32; 3] = std::array::from_fn(|axis| {
            (0..8).map(|c| if c >> axis & 1 != 0 { corners[c] } else { -corners[c] }).sum()
        });
        let square: i64 = gradient.iter().map(|g| i64::from(*g) * i64::from(*g)).sum();
        let halves = crossed_halves(&corners);
        if square == 0 {
            return Self { halves, ..Self::default() };
        }
        let length = square.unsigned_abs().isqrt().max(1) as i64;
        Self {
            // One step of Newton's method from the middle.
            offset: gradient.map(|g| (-128 * i64::from(sum) * i64::from(g) / square).clamp(-256, 256) as i16),
            normal: gradient.map(|g| (127 * i64::from(g) / length).clamp(-127, 127) as i8),
            halves,
        }
    }

    /// Whether the surfaces of two cells face the same half of all directions.
    #[must_use]
    #[inline(always)]
    pub fn faces(&self, normal: [i8; 3]) -> bool {
        let mut product = 0;
        for axis in 0..3 {
            product += i32::from(self.normal[axis]) * i32::from(normal[axis]);
        }
        product >= 0
    }
}

/// Signs at the 27 points of a cell's half grid as bits, x fastest: which lie inside. Values between corners are means of these,
/// of which only the sign counts.
#[inline(always)]
fn half_grid_signs(corners: &[i32; 8]) -> u32 {
    let along_x = |pair: [i32; 2]| [pair[0], pair[0] + pair[1], pair[1]];
    let rows: [[i32; 3]; 4] = std::array::from_fn(|row| along_x([corners[2 * row], corners[2 * row + 1]]));
    let add = |a: [i32; 3], b: [i32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let layers = [[rows[0], add(rows[0], rows[1]), rows[1]], [rows[2], add(rows[2], rows[3]), rows[3]]];
    let middle: [[i32; 3]; 3] = std::array::from_fn(|y| add(layers[0][y], layers[1][y]));
    let mut signs = 0;
    for (z, layer) in [layers[0], middle, layers[1]].into_iter().enumerate() {
        for (y, row) in layer.into_iter().enumerate() {
            for (x, value) in row.into_iter().enumerate() {
                signs |= u32::from(value < 0) << (9 * z + 3 * y + x);
            }
        }
    }
    signs
}

/// The points of the half grid that are corners of each half cell.
const HALF_CORNERS: [u32; 8] = {
    let mut corners = [0; 8];
    let mut half = 0;
    while half < 8 {
        let first = 9 * (half >> 2) + 3 * (half >> 1 & 1) + (half & 1);
        corners[half] = 0b11_011 << first | 0b11_011 << (first + 9);
        half += 1;
    }
    corners
};

/// Half cells that have corners inside and outside.
#[inline(always)]
fn crossed_halves(corners: &[i32; 8]) -> u8 {
    let signs = half_grid_signs(corners);
    let mut crossed = 0;
    for (half, mask) in HALF_CORNERS.into_iter().enumerate() {
        let inside = signs & mask;
        crossed |= u8::from(inside != 0 && inside != mask) << half;
    }
    crossed
}

/// Quarter cells that have corners inside and outside, a bit each, in Morton order.
fn crossed_quarters(corners: &[i32; 8]) -> u64 {
    const POINTS: usize = 5;
    let between = |a: i32, b: i32, step: usize| (4 - step as i32) * a + step as i32 * b;
    let mut signs = [[0u8; POINTS]; POINTS];
    for (z, layer) in signs.iter_mut().enumerate() {
        let face: [i32; 4] = std::array::from_fn(|c| between(corners[c], corners[c + 4], z));
        for (y, row) in layer.iter_mut().enumerate() {
            let [a, b] = [0, 1].map(|c| between(face[c], face[c + 2], y));
            for x in 0..POINTS {
                *row |= u8::from(between(a, b, x) < 0) << x;
            }
        }
    }
    let mut crossed = 0;
    for (quarter, [x, y, z]) in (0..64).map(|q| (q, position(q))) {
        let rows = [signs[z][y], signs[z][y + 1], signs[z + 1][y], signs[z + 1][y + 1]];
        let inside = rows.map(|row| row >> x & 0b11);
        let (any, all) = inside.iter().fold((0, 0b11), |(any, all), row| (any | row, all & row));
        crossed |= u64::from(any != 0 && all != 0b11) << quarter;
    }
    crossed
}

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

/// The cells of a frame that its surface crosses, by block: cells of marching cubes, which lie between eight voxels that are all
/// there and observed, and of which some are inside and others outside. A cell belongs to the block of its lowest voxel.
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
        let crossed = |block: &u32, finder: &mut NeighbourFinder| {
            finder.turn_to(volume.coords()[*block as usize]);
            crossed_cells(volume, &finder.octet()).map(|crossed| (*block, crossed))
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
                for (place, surfel) in cells.places().zip(surfels.iter_mut()) {
                    *surfel = Surfel::new(window.corners(position(place)));
                }
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

/// The cells of a block, in Morton order, whose corners differ in sign; `None` if there are none. `octet`: the block, and those
/// after it.
fn crossed_cells(volume: &SparseVolume, octet: &[Option<u32>; 8]) -> Option<[u64; 8]> {
    // Rows along x: bit x of `inside[z][y]` and of `known`.
    let mut in_rows = [[0u16; SIDE]; SIDE];
    let mut known_rows = [[0u16; SIDE]; SIDE];
    for (slot, block) in octet.iter().enumerate() {
        let Some(block) = block.map(|block| block as usize) else { continue };
        let inside = inside(volume.block(block).try_into().expect("blocks of an edge of 8"));
        let mask = volume.unobserved(block);
        let [dx, dy, dz] = [slot & 1, slot >> 1 & 1, slot >> 2];
        let (ys, zs) = (if dy == 0 { 0..8 } else { 0..1 }, if dz == 0 { 0..8 } else { 0..1 });
        for z in zs {
            let known = mask.map_or(!0, |mask| !mask.words()[z]);
            for y in ys.clone() {
                let row = |word: u64| (word >> (8 * y) & if dx == 0 { 0xff } else { 1 }) as u16;
                in_rows[z + 8 * dz][y + 8 * dy] |= row(inside[z]) << (8 * dx);
                known_rows[z + 8 * dz][y + 8 * dy] |= row(known) << (8 * dx);
            }
        }
    }
    let mut crossed = [0u64; 8];
    let mut any_crossed = 0;
    for z in 0..8 {
        for y in 0..8 {
            let square = [(z, y), (z, y + 1), (z + 1, y), (z + 1, y + 1)];
            let rows = square.map(|(z, y)| in_rows[z][y]);
            let known = square.iter().fold(!0, |all, (z, y)| all & known_rows[*z][*y]);
            let any = rows[0] | rows[1] | rows[2] | rows[3];
            let all = rows[0] & rows[1] & rows[2] & rows[3];
            let cells = (any | any >> 1) & !(all & all >> 1) & known & known >> 1 & 0xff;
            any_crossed |= cells;
            let mut rest = cells;
            while rest != 0 {
                let place = interleave([rest.trailing_zeros() as usize, y, z]);
                crossed[place >> 6] |= 1 << (place & 63);
                rest &= rest - 1;
            }
        }
    }
    (any_crossed != 0).then_some(crossed)
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
            let [dx, dy, dz] = [slot & 1, slot >> 1 & 1, slot >> 2];
            let count = |d: usize| if d == 0 { 8 } else { 1 };
            for z in 0..count(dz) {
                for y in 0..count(dy) {
                    let to = ((z + 8 * dz) * SIDE + y + 8 * dy) * SIDE + 8 * dx;
                    self.codes[to..][..count(dx)].copy_from_slice(&samples[(z * 8 + y) * 8..][..count(dx)]);
                }
            }
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
