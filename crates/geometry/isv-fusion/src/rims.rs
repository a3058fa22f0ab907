//! Ends of the surface.
//!
//! Which voxels were seen is rough at the scale of a voxel: the surface would end in teeth and leave specks
//! beside it. A surface cell that hangs on by less than two of its neighbours is taken away, and in turn
//! those that hung on by it. Then whole pieces go that are too small to be anything but noise.

use crate::blocks::Blocks;
use isv_volume::{BlockIndex, VoxelMask};
use rayon::prelude::*;

/// Neighbours on the surface that a cell needs to stay.
const HOLD: usize = 2;
/// Rounds of removal: teeth up to this many cells long vanish.
const ROUNDS: usize = 4;
/// Cells of the smallest piece of surface that stays.
const LEAST_PIECE: usize = 64;
/// No cell.
const NONE: u32 = u32::MAX;

/// A cell that the surface passes through, all its corners observed; in the block and with the index of its lowest corner.
struct Cell {
    block: u32,
    voxel: u16,
    /// Bit `i`: corner `i` (x in the lowest bit) lies inside.
    inside: u8,
}

impl Blocks {
    /// Takes teeth and specks off the surface, by making voxels unobserved. Returns the corners of the cells that stay,
    /// block by block.
    pub(crate) fn trim_rims(&mut self) -> Vec<VoxelMask> {
        let index = BlockIndex::new(&self.coords);
        let cells = Cells::find(self, &index);
        let neighbours = cells.neighbours(self, &index);
        let mut stays = vec![true; cells.list.len()];
        for _ in 0..ROUNDS {
            let held =
                |cell: usize| neighbours[cell].iter().filter(|n| **n != NONE && stays[**n as usize]).count();
            stays = (0..stays.len()).into_par_iter().map(|cell| stays[cell] && held(cell) >= HOLD).collect();
        }
        drop_small_pieces(&neighbours, &mut stays);
        self.remove(&cells, &stays, &index)
    }

    /// Makes the corners of cells that do not stay unobserved, but for those that they share with cells that do.
    fn remove(&mut self, cells: &Cells, stays: &[bool], index: &BlockIndex) -> Vec<VoxelMask> {
        let empty = || vec![VoxelMask::empty(self.grid.edge); self.coords.len()];
        let (mut needed, mut unwanted) = (empty(), empty());
        for (cell, stays) in cells.list.iter().zip(stays) {
            let masks = if *stays { &mut needed } else { &mut unwanted };
            for corner in 0..8 {
                if let Some((block, voxel)) = self.corner(cell.block, cell.voxel, corner, index) {
                    masks[block as usize].insert(voxel);
                }
            }
        }
        for ((mask, needed), unwanted) in self.unobserved.iter_mut().zip(&needed).zip(unwanted) {
            (0..self.grid.edge.block_voxels())
                .filter(|v| unwanted.contains(*v) && !needed.contains(*v))
                .for_each(|v| mask.insert(v));
        }
        needed
    }

    /// Block and voxel of a cell's corner, if that block is there.
    fn corner(&self, block: u32, voxel: u16, corner: usize, index: &BlockIndex) -> Option<(u32, usize)> {
        let edge = self.grid.edge;
        let (n, voxel) = (edge.voxels(), usize::from(voxel));
        let at = [voxel % n + (corner & 1), voxel / n % n + (corner >> 1 & 1), voxel / n / n + (corner >> 2)];
        let step = at.map(|c| (c / n) as i32);
        let block =
            if step == [0; 3] { block } else { index.get(self.coords[block as usize].offset(step))? };
        Some((block, edge.voxel_index(at[0] % n, at[1] % n, at[2] % n)))
    }
}

/// On which side of the surface a voxel is, one bit each.
const INSIDE: u8 = 1;
const OUTSIDE: u8 = 2;
const UNOBSERVED: u8 = 4;

/// The sides of a block's voxels and of those that follow it along each axis.
struct Sides {
    /// Voxels along an edge, with the one that follows.
    n: usize,
    sides: Vec<u8>,
}

impl Sides {
    fn gather(blocks: &Blocks, block: u32, index: &BlockIndex) -> Self {
        let (edge, size) = (blocks.grid.edge, blocks.grid.edge.block_voxels());
        let n = edge.voxels();
        let here = blocks.coords[block as usize];
        let around =
            [0, 1, 2, 3, 4, 5, 6, 7].map(|i: i32| index.get(here.offset([i & 1, i >> 1 & 1, i >> 2])));
        let mut sides = Vec::with_capacity((n + 1).pow(3));
        for place in 0..(n + 1).pow(3) {
            let at = [place % (n + 1), place / (n + 1) % (n + 1), place / (n + 1) / (n + 1)];
            let voxel = edge.voxel_index(at[0] % n, at[1] % n, at[2] % n);
            sides.push(match around[at[0] / n + 2 * (at[1] / n) + 4 * (at[2] / n)] {
                Some(block) if !blocks.unobserved[block as usize].contains(voxel) => {
                    if blocks.samples[block as usize * size + voxel] < 0 { INSIDE } else { OUTSIDE }
                }
                _ => UNOBSERVED,
            });
        }
        Self { n: n + 1, sides }
    }

    /// The corners of the cell above a voxel, x in the lowest bit of the corner's number.
    fn corners(&self, [x, y, z]: [usize; 3]) -> [u8; 8] {
        let low = (z * self.n + y) * self.n + x;
        let (right, down, deep) = (1, self.n, self.n * self.n);
        [0, right, down, down + right, deep, deep + right, deep + down, deep + down + right]
            .map(|step| self.sides[low + step])
    }
}

/// All surface cells, block after block, in voxel order.
struct Cells {
    list: Vec<Cell>,
    /// Beginning of each block's cells in the list, and the end of the last one's.
    first: Vec<u32>,
}

impl Cells {
    fn find(blocks: &Blocks, index: &BlockIndex) -> Self {
        let of_block = |block: usize| Self::of_block(blocks, block as u32, index);
        let found: Vec<_> = (0..blocks.coords.len()).into_par_iter().map(of_block).collect();
        let mut first = vec![0];
        for cells in &found {
            first.push(first[first.len() - 1] + cells.len() as u32);
        }
        Self { list: found.into_iter().flatten().collect(), first }
    }

    /// The surface cells of a block.
    fn of_block(blocks: &Blocks, block: u32, index: &BlockIndex) -> Vec<Cell> {
        let n = blocks.grid.edge.voxels();
        let sides = Sides::gather(blocks, block, index);
        let mut cells = Vec::new();
        for voxel in 0..blocks.grid.edge.block_voxels() {
            let corners = sides.corners([voxel % n, voxel / n % n, voxel / n / n]);
            let (mut inside, mut all) = (0, 0);
            for (corner, side) in corners.into_iter().enumerate() {
                inside |= (side & INSIDE) << corner;
                all |= side;
            }
            if all == INSIDE | OUTSIDE {
                cells.push(Cell { block, voxel: voxel as u16, inside });
            }
        }
        cells
    }

    /// For each cell the cells that the surface goes on to, across the faces whose corners lie on both sides.
    fn neighbours(&self, blocks: &Blocks, index: &BlockIndex) -> Vec<[u32; 6]> {
        /// Corners of the face at the low end of each axis.
        const LOW_FACE: [u8; 3] = [0b0101_0101, 0b0011_0011, 0b0000_1111];
        let n = blocks.grid.edge.voxels() as i32;
        let around = |cell: &Cell| {
            let mut found = [NONE; 6];
            for (face, neighbour) in found.iter_mut().enumerate() {
                let (axis, high) = (face / 2, face % 2 == 1);
                let corners = if high { !LOW_FACE[axis] } else { LOW_FACE[axis] };
                if cell.inside & corners == 0 || cell.inside & corners == corners {
                    continue;
                }
                let voxel = i32::from(cell.voxel);
                let mut at = [voxel % n, voxel / n % n, voxel / n / n];
                at[axis] += if high { 1 } else { -1 };
                let step = at.map(|c| c.div_euclid(n));
                let [x, y, z] = at.map(|c| c.rem_euclid(n) as usize);
                let block = if step == [0; 3] {
                    Some(cell.block)
                } else {
                    index.get(blocks.coords[cell.block as usize].offset(step))
                };
                *neighbour =
                    block.map_or(NONE, |block| self.at(block, blocks.grid.edge.voxel_index(x, y, z) as u16));
            }
            found
        };
        self.list.par_iter().map(around).collect()
    }

    /// The number of the cell above a voxel; `NONE` if the surface does not pass there.
    fn at(&self, block: u32, voxel: u16) -> u32 {
        let (from, to) = (self.first[block as usize], self.first[block as usize + 1]);
        let cells = &self.list[from as usize..to as usize];
        cells.binary_search_by_key(&voxel, |cell| cell.voxel).map_or(NONE, |at| from + at as u32)
    }
}

/// Lets go of connected pieces of fewer than `LEAST_PIECE` cells.
fn drop_small_pieces(neighbours: &[[u32; 6]], stays: &mut [bool]) {
    let mut visited: Vec<bool> = stays.iter().map(|stays| !stays).collect();
    for start in 0..stays.len() {
        if visited[start] {
            continue;
        }
        visited[start] = true;
        let mut piece = vec![start as u32];
        let mut next = 0;
        while let Some(cell) = piece.get(next).copied() {
            next += 1;
            for n in neighbours[cell as usize].into_iter().filter(|n| *n != NONE) {
                if !std::mem::replace(&mut visited[n as usize], true) {
                    piece.push(n);
                }
            }
        }
        if piece.len() < LEAST_PIECE {
            piece.into_iter().for_each(|cell| stays[cell as usize] = false);
        }
    }
}
