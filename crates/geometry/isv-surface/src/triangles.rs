//! From crossed cells to triangles.

use crate::cases::{CASES, EDGES, MAX_TRIANGLES, edge_start};
use crate::edges::{EdgeRow, SetBits};
use crate::window::SignWindow;
use std::sync::LazyLock;

/// Entries of [`VertexIds`] from one voxel to the next along x, y and z, for the widest block and one voxel more.
const STRIDES: [usize; 3] = [3, 3 * 17, 3 * 17 * 17];
const ENTRIES: usize = 1 << ENTRY_BITS;
const ENTRY_BITS: u32 = 14;

/// A cell that the surface crosses: its lowest corner's entry in [`VertexIds`], and above that the pattern of its signs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossedCell(u32);

/// The triangles in a cell, their corners as entries of [`VertexIds`] counted from the cell's.
#[derive(Clone, Copy, Debug, Default)]
struct CellTriangles {
    count: usize,
    corners: [[usize; 3]; MAX_TRIANGLES],
}

/// Builds the tables of marching cubes, which are else built by whoever needs them first. A process that is forked meanwhile would wait
/// for them for ever.
pub fn build_tables() {
    LazyLock::force(&TRIANGLES);
}

/// By sign pattern.
static TRIANGLES: LazyLock<[CellTriangles; 256]> = LazyLock::new(|| {
    CASES.map(|case| {
        let mut cell = CellTriangles { count: case.triangles().len(), ..CellTriangles::default() };
        for (corners, triangle) in cell.corners.iter_mut().zip(case.triangles()) {
            *corners = triangle.map(|edge| edge_entry(usize::from(edge)));
        }
        cell
    })
});

/// The entry of a cell's edge, from that of its lowest corner on.
fn edge_entry(edge: usize) -> usize {
    debug_assert!(edge < EDGES);
    let (axis, start) = edge_start(edge);
    entry(start) + axis
}

/// The entry of the edge that starts in a voxel and runs along x.
#[inline(always)]
pub(crate) fn entry([x, y, z]: [usize; 3]) -> usize {
    x * STRIDES[0] + y * STRIDES[1] + z * STRIDES[2]
}

/// Appends the crossed cells of a block, in voxel order; returns how many triangles are in them.
#[inline(always)]
pub(crate) fn find_cells<const SIDE: usize>(
    window: &SignWindow<SIDE>,
    cells: &mut Vec<CrossedCell>,
) -> usize {
    let triangles = &*TRIANGLES;
    let mut count = 0;
    for z in 0..SIDE {
        let crossed = window.crossed_cells(z);
        for y in 0..SIDE {
            let corners = window.cell_rows(y, z);
            for x in SetBits(u64::from(crossed[y])) {
                let pattern = corners.pattern(x);
                count += triangles[pattern].count;
                cells.push(CrossedCell((pattern << ENTRY_BITS | entry([x, y, z])) as u32));
            }
        }
    }
    count
}

/// Numbers of the vertices on the edges that start in a block and at the near sides of its plus neighbours,
/// by voxel and axis. They reach as far as the cells of the block. Other entries are left over from other
/// blocks.
pub(crate) struct VertexIds(Box<[u32; ENTRIES]>);

impl Default for VertexIds {
    fn default() -> Self {
        Self(Box::new([0; ENTRIES]))
    }
}

impl VertexIds {
    /// Enters a vertex.
    #[inline(always)]
    pub(crate) fn set(&mut self, entry: usize, vertex: u32) {
        self.0[entry % ENTRIES] = vertex;
    }

    /// Enters the vertices of a row of edges that starts in a voxel, given the number of its block's first vertex.
    #[inline(always)]
    pub(crate) fn enter(&mut self, row: EdgeRow, start: [usize; 3], first: u32) {
        let start = entry(start);
        for (vertex, edge) in (first + row.first()..).zip(row.edges()) {
            self.set(start + edge, vertex);
        }
    }

    /// Writes the triangles of a block's cells; there are as many as places in `out`.
    #[inline(always)]
    pub(crate) fn fill_triangles(&self, out: &mut [[u32; 3]], cells: &[CrossedCell]) {
        let table = &*TRIANGLES;
        let mut rest = out;
        for CrossedCell(cell) in cells {
            let of_cell = &table[(cell >> ENTRY_BITS) as usize % 256];
            let (places, others) = rest.split_at_mut(of_cell.count);
            for (place, corners) in places.iter_mut().zip(&of_cell.corners) {
                for i in 0..3 {
                    place[i] = self.0[(*cell as usize + corners[i]) % ENTRIES];
                }
            }
            rest = others;
        }
    }
}
