//! The signs of a block and one voxel of its neighbours on every side, and the cells and edges that the surface crosses.

use crate::signs::{Rows, Signs};
use isv_volume::Neighbourhood;

/// Rows of the widest window: 16 voxels and one more on either side.
const MAX_PADDED: usize = 18;

/// Bits of a block and one voxel around it: voxel `(x, y, z)` is bit `x + 1` of row `[z + 1][y + 1]`.
type Padded = [[u32; MAX_PADDED]; MAX_PADDED];

/// One row a y.
pub(crate) type Layer<const SIDE: usize> = [u32; SIDE];

/// What cells and edges that start in a block need to know.
pub(crate) struct SignWindow<const SIDE: usize> {
    inside: Padded,
    /// Cells of which all eight corners were observed, by their lowest corner.
    cells: Padded,
}

impl<const SIDE: usize> SignWindow<SIDE> {
    #[inline(always)]
    pub(crate) fn gather(signs: &Signs<SIDE>, around: &Neighbourhood) -> Self {
        let inside = pad(
            #[inline(always)]
            |slot| signs.inside(around[slot]),
        );
        let all_observed = around.iter().all(|block| block.is_some_and(|block| !signs.has_unobserved(block)));
        let cells = if all_observed {
            [[u32::MAX; MAX_PADDED]; MAX_PADDED]
        } else {
            whole_cells::<SIDE>(&pad(
                #[inline(always)]
                |slot| signs.observed(around[slot]),
            ))
        };
        Self { inside, cells }
    }

    /// The edges that start in voxels of layer z, cross the surface and belong to an observed cell, by axis: bit x of row y.
    #[inline(always)]
    pub(crate) fn crossings(&self, z: usize) -> [Layer<SIDE>; 3] {
        let [before, here, after] = [&self.cells[z], &self.inside[z + 1], &self.inside[z + 2]];
        let cells = &self.cells[z + 1];
        let mut crossings = [[0; SIDE]; 3];
        for y in 0..SIDE {
            let row = here[y + 1];
            let [c00, c10] = [cells[y + 1], cells[y]];
            let [c01, c11] = [before[y + 1], before[y]];
            let [beside_y, beside_z] = [c00 | c01, c00 | c10];
            crossings[0][y] = unpad::<SIDE>((row ^ row >> 1) & (c00 | c10 | c01 | c11));
            crossings[1][y] = unpad::<SIDE>((row ^ here[y + 2]) & (beside_y | beside_y << 1));
            crossings[2][y] = unpad::<SIDE>((row ^ after[y + 1]) & (beside_z | beside_z << 1));
        }
        crossings
    }

    /// The observed cells of layer z that the surface crosses: bit x of row y for the cell above voxel `(x, y, z)`.
    #[inline(always)]
    pub(crate) fn crossed_cells(&self, z: usize) -> Layer<SIDE> {
        let [low, high] = [&self.inside[z + 1], &self.inside[z + 2]];
        let mut crossed = [0; SIDE];
        for y in 0..SIDE {
            let some = low[y + 1] | low[y + 2] | high[y + 1] | high[y + 2];
            let every = low[y + 1] & low[y + 2] & high[y + 1] & high[y + 2];
            crossed[y] = unpad::<SIDE>((some | some >> 1) & !(every & every >> 1) & self.cells[z + 1][y + 1]);
        }
        crossed
    }

    /// The signs of the voxels in row `(y, z)` and the next ones along y, z and both.
    #[inline(always)]
    pub(crate) fn cell_rows(&self, y: usize, z: usize) -> CellRows {
        let [low, high] = [&self.inside[z + 1], &self.inside[z + 2]];
        CellRows([low[y + 1], low[y + 2], high[y + 1], high[y + 2]])
    }
}

/// The signs of the corners of a row of cells.
#[derive(Clone, Copy)]
pub(crate) struct CellRows([u32; 4]);

impl CellRows {
    /// Sign pattern of the cell above voxel x, as `cases` numbers its corners.
    #[inline(always)]
    pub(crate) fn pattern(self, x: usize) -> usize {
        let Self([low, low_next, high, high_next]) = self;
        let pair = |row: u32| (row >> (x + 1) & 3) as usize;
        pair(low) | pair(low_next) << 2 | pair(high) << 4 | pair(high_next) << 6
    }
}

#[inline(always)]
fn unpad<const SIDE: usize>(row: u32) -> u32 {
    row >> 1 & ((1 << SIDE) - 1)
}

/// Joins the rows of a block with the nearest ones around it, given by slot of the neighbourhood.
#[inline(always)]
fn pad<'a, const SIDE: usize>(rows: impl Fn(usize) -> &'a Rows<SIDE>) -> Padded {
    let mut padded = [[0; MAX_PADDED]; MAX_PADDED];
    // Of the block before, this one and the next: the first row that is used, how many are, and where they go.
    let spans = [(SIDE - 1, 1, 0), (0, SIDE, 1), (0, 1, SIDE + 1)];
    for (dz, (z_first, z_count, z_out)) in spans.into_iter().enumerate() {
        for (dy, (y_first, y_count, y_out)) in spans.into_iter().enumerate() {
            let slot = dz * 9 + dy * 3;
            let [left, middle, right] = [rows(slot), rows(slot + 1), rows(slot + 2)];
            for z in 0..z_count {
                let from = z_first + z;
                let [left, middle, right] = [&left[from], &middle[from], &right[from]];
                let out = &mut padded[z_out + z];
                for y in 0..y_count {
                    let [left, middle, right] = [left, middle, right].map(|l| u32::from(l[y_first + y]));
                    out[y_out + y] = left >> (SIDE - 1) | middle << 1 | (right & 1) << (SIDE + 1);
                }
            }
        }
    }
    padded
}

#[inline(always)]
fn whole_cells<const SIDE: usize>(observed: &Padded) -> Padded {
    let mut cells = [[0; MAX_PADDED]; MAX_PADDED];
    for z in 0..=SIDE {
        for y in 0..=SIDE {
            let column = observed[z][y] & observed[z][y + 1] & observed[z + 1][y] & observed[z + 1][y + 1];
            cells[z][y] = column & column >> 1;
        }
    }
    cells
}
