//! From crossed cells to triangles.

use crate::cases::{CASES, Case, EDGES, edge_start};
use crate::edges::{EdgeRow, SetBits};
use crate::window::SignWindow;

/// The vertices' numbers on the edges that start in a block and at the near sides of its plus neighbours: as far as the cells
/// of the block reach. Other entries are left over from other blocks.
pub(crate) struct VertexIds<const SIDE: usize>(Vec<u32>);

impl<const SIDE: usize> Default for VertexIds<SIDE> {
    fn default() -> Self {
        Self(vec![0; Self::LAYER * (SIDE + 1)])
    }
}

impl<const SIDE: usize> VertexIds<SIDE> {
    /// Entries of a voxel, one an axis; of a row, a layer.
    const VOXEL: usize = 3;
    const ROW: usize = Self::VOXEL * (SIDE + 1);
    const LAYER: usize = Self::ROW * (SIDE + 1);

    /// From the entries of a cell's lowest corner to that of each of its edges.
    const OF_EDGE: [usize; EDGES] = {
        let mut offsets = [0; EDGES];
        let mut edge = 0;
        while edge < EDGES {
            let (axis, [x, y, z]) = edge_start(edge);
            offsets[edge] = z * Self::LAYER + y * Self::ROW + x * Self::VOXEL + axis;
            edge += 1;
        }
        offsets
    };

    /// Enters the vertices of a row of edges that starts in voxel `[x, y, z]`, given the number of its block's first vertex.
    #[inline(always)]
    pub(crate) fn enter(&mut self, row: EdgeRow, [x, y, z]: [usize; 3], first: u32) {
        let start = z * Self::LAYER + y * Self::ROW + x * Self::VOXEL;
        let entries = &mut self.0[start..][..Self::ROW - x * Self::VOXEL];
        for (vertex, edge) in (first + row.first()..).zip(row.edges()) {
            entries[edge] = vertex;
        }
    }

    /// Writes the triangles of a block's cells; there are as many as places in `out`.
    #[inline(always)]
    pub(crate) fn fill_triangles(&self, out: &mut [[u32; 3]], window: &SignWindow<SIDE>) {
        let mut places = out.iter_mut();
        for_each_crossed_cell(window, |[x, y, z], case| {
            let cell = &self.0[z * Self::LAYER + y * Self::ROW + x * Self::VOXEL..];
            for (triangle, place) in case.triangles().iter().zip(&mut places) {
                *place = triangle.map(|edge| cell[Self::OF_EDGE[usize::from(edge)]]);
            }
        });
    }
}

/// Calls `visit` with the lowest corner and the case of each crossed cell of a block, in voxel order.
#[inline(always)]
pub(crate) fn for_each_crossed_cell<const SIDE: usize>(
    window: &SignWindow<SIDE>,
    mut visit: impl FnMut([usize; 3], &Case),
) {
    let cases = &*CASES;
    for z in 0..SIDE {
        for (y, crossed) in window.crossed_cells(z).into_iter().enumerate() {
            let corners = window.cell_rows(y, z);
            for x in SetBits(u64::from(crossed)) {
                visit([x, y, z], &cases[corners.pattern(x)]);
            }
        }
    }
}
