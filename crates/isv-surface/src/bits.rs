//! Signs of voxels as bits, a word for a row of voxels along x.

use isv_volume::{Neighbourhood, SparseVolume, VoxelMask};
use rayon::prelude::*;

/// Rows of the widest padded block: 16 voxels and one more on either side.
const MAX_PADDED: usize = 18;

/// For every block, which of its voxels are inside: `edge^2` words a block, z slowest, bit x for voxel x.
pub(crate) struct SignRows<'a> {
    edge: usize,
    inside: Vec<u16>,
    unobserved: Vec<Option<&'a VoxelMask>>,
}

/// The sign of a block whose voxels all have the same.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Uniform {
    Inside,
    Outside,
}

impl<'a> SignRows<'a> {
    pub(crate) fn new(volume: &'a SparseVolume) -> Self {
        let edge = volume.grid().edge.voxels();
        let inside = volume.samples().par_chunks_exact(edge).map(inside_bits).collect();
        let unobserved = (0..volume.block_count()).map(|block| volume.unobserved(block)).collect();
        Self { edge, inside, unobserved }
    }

    /// Whether a voxel of a block was observed.
    pub(crate) fn observed(&self, block: usize, voxel: usize) -> bool {
        self.unobserved[block].is_none_or(|mask| !mask.contains(voxel))
    }

    /// Whether the block and its neighbours on the plus sides have voxels of both signs: if not, no cell and no edge
    /// that starts in the block can cross the surface.
    pub(crate) fn may_cross(&self, around: &Neighbourhood) -> bool {
        let mut blocks = PLUS_SLOTS.iter().filter_map(|&slot| around[slot]);
        let first = blocks.next().and_then(|block| self.uniform(block));
        first.is_none() || blocks.any(|block| self.uniform(block) != first)
    }

    fn uniform(&self, block: u32) -> Option<Uniform> {
        let rows = self.rows(block);
        let full = (1u32 << self.edge) - 1;
        if rows.iter().all(|r| *r == 0) {
            Some(Uniform::Outside)
        } else if rows.iter().all(|r| u32::from(*r) == full) {
            Some(Uniform::Inside)
        } else {
            None
        }
    }

    fn rows(&self, block: u32) -> &[u16] {
        let n = self.edge * self.edge;
        &self.inside[block as usize * n..][..n]
    }

    fn inside_row(&self, block: u32, row: usize) -> u32 {
        u32::from(self.rows(block)[row])
    }

    fn observed_row(&self, block: u32, row: usize) -> u32 {
        let full = (1u32 << self.edge) - 1;
        let Some(mask) = self.unobserved[block as usize] else { return full };
        let voxel = row * self.edge;
        !((mask.words()[voxel / 64] >> (voxel % 64)) as u32) & full
    }
}

/// Slots, in a [`Neighbourhood`], of the block and its neighbours at `+x`, `+y`, `+x+y`, `+z` and so on: bit 0 of the
/// position is the step along x, bit 1 along y, bit 2 along z.
pub(crate) const PLUS_SLOTS: [usize; 8] = [13, 14, 16, 17, 22, 23, 25, 26];

/// Bit x is set if sample x of a row is negative.
fn inside_bits(row: &[i16]) -> u16 {
    row.iter().enumerate().fold(0, |bits, (x, code)| bits | u16::from(*code < 0) << x)
}

/// A block with one voxel of its neighbours on every side: voxel `(x, y, z)` is bit `x + 1` of row `[z + 1][y + 1]`.
pub(crate) struct PaddedBits {
    inside: [[u32; MAX_PADDED]; MAX_PADDED],
    /// Cells of which all eight corners were observed, by their lowest corner.
    cells: [[u32; MAX_PADDED]; MAX_PADDED],
    edge: usize,
}

impl PaddedBits {
    pub(crate) fn gather(signs: &SignRows, around: &Neighbourhood) -> Self {
        let edge = signs.edge;
        let mut inside = [[0; MAX_PADDED]; MAX_PADDED];
        let mut observed = [[0; MAX_PADDED]; MAX_PADDED];
        for z in 0..edge + 2 {
            for y in 0..edge + 2 {
                // Counted from the start of the lower neighbour.
                let [y_from, z_from] = [y, z].map(|c| c + edge - 1);
                let [(dy, y_in), (dz, z_in)] = [y_from, z_from].map(|c| (c / edge, c % edge));
                let blocks = &around[dz * 9 + dy * 3..][..3];
                let row = z_in * edge + y_in;
                inside[z][y] = pad_row(blocks, edge, |block| signs.inside_row(block, row));
                observed[z][y] = pad_row(blocks, edge, |block| signs.observed_row(block, row));
            }
        }
        Self { inside, cells: whole_cells(&observed, edge), edge }
    }

    /// The edges that start in voxels of row `(y, z)`, cross the surface and belong to an observed cell, by axis: bit x
    /// for voxel x.
    pub(crate) fn crossings(&self, y: usize, z: usize) -> [u32; 3] {
        let (py, pz) = (y + 1, z + 1);
        let here = self.inside[pz][py];
        let crossing = [here ^ here >> 1, here ^ self.inside[pz][py + 1], here ^ self.inside[pz + 1][py]];
        let [c00, c10] = [self.cells[pz][py], self.cells[pz][py - 1]];
        let [c01, c11] = [self.cells[pz - 1][py], self.cells[pz - 1][py - 1]];
        let with_left = |cells: u32| cells | cells << 1;
        let around = [c00 | c10 | c01 | c11, with_left(c00 | c01), with_left(c00 | c10)];
        [0, 1, 2].map(|axis| self.unpad(crossing[axis] & around[axis]))
    }

    /// The observed cells of row `(y, z)` that the surface crosses: bit x for the cell above voxel x.
    pub(crate) fn crossed_cells(&self, y: usize, z: usize) -> u32 {
        let rows = self.cell_rows(y, z);
        let some = rows.iter().fold(0, |acc, row| acc | row | row >> 1);
        let every = rows.iter().fold(!0, |acc, row| acc & row & row >> 1);
        self.unpad(some & !every & self.cells[z + 1][y + 1])
    }

    /// Sign pattern of the cell above voxel `(x, y, z)`, as `cases` numbers its corners.
    pub(crate) fn pattern(&self, x: usize, y: usize, z: usize) -> usize {
        let rows = self.cell_rows(y, z);
        (0..4).fold(0, |pattern, i| pattern | (rows[i] as usize >> (x + 1) & 3) << (2 * i))
    }

    fn cell_rows(&self, y: usize, z: usize) -> [u32; 4] {
        let (py, pz) = (y + 1, z + 1);
        [self.inside[pz][py], self.inside[pz][py + 1], self.inside[pz + 1][py], self.inside[pz + 1][py + 1]]
    }

    fn unpad(&self, row: u32) -> u32 {
        row >> 1 & ((1 << self.edge) - 1)
    }
}

/// Joins the last voxel of the block on the left, a row of the block in the middle and the first of the right one.
fn pad_row(blocks: &[Option<u32>], edge: usize, row: impl Fn(u32) -> u32) -> u32 {
    let [left, middle, right] = [0, 1, 2].map(|i| blocks[i].map_or(0, &row));
    left >> (edge - 1) | middle << 1 | (right & 1) << (edge + 1)
}

fn whole_cells(observed: &[[u32; MAX_PADDED]; MAX_PADDED], edge: usize) -> [[u32; MAX_PADDED]; MAX_PADDED] {
    let mut cells = [[0; MAX_PADDED]; MAX_PADDED];
    for z in 0..=edge {
        for y in 0..=edge {
            let column = observed[z][y] & observed[z][y + 1] & observed[z + 1][y] & observed[z + 1][y + 1];
            cells[z][y] = column & column >> 1;
        }
    }
    cells
}
