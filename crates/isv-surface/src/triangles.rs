//! From crossed cells to triangles.

use crate::bits::{PLUS_SLOTS, PaddedBits};
use crate::cases::{CASES, Case, EDGES, edge_start};
use crate::edges::{EdgeRow, SetBits};
use isv_volume::{BlockEdge, Neighbourhood};

/// Numbers of the vertices on all crossing edges of the volume.
pub(crate) struct VertexIds<'a> {
    pub(crate) edge: BlockEdge,
    /// `edge^2` rows a block.
    pub(crate) rows: &'a [EdgeRow],
    /// Number of the first vertex of each block.
    pub(crate) first: &'a [u32],
}

/// Calls `visit` with the lowest corner and the case of each crossed cell of a block, in voxel order.
pub(crate) fn for_each_crossed_cell(
    bits: &PaddedBits,
    edge: BlockEdge,
    mut visit: impl FnMut([usize; 3], &Case),
) {
    let cases = &*CASES;
    for z in 0..edge.voxels() {
        for y in 0..edge.voxels() {
            for x in SetBits(u64::from(bits.crossed_cells(y, z))) {
                visit([x, y, z], &cases[bits.pattern(x, y, z)]);
            }
        }
    }
}

/// Writes the triangles of a block's cells; there are as many as places in `out`.
pub(crate) fn fill_triangles(
    out: &mut [[u32; 3]],
    bits: &PaddedBits,
    around: &Neighbourhood,
    ids: &VertexIds,
) {
    let blocks = PLUS_SLOTS.map(|slot| around[slot]);
    let mut places = out.iter_mut();
    for_each_crossed_cell(bits, ids.edge, |cell, case| {
        let mut vertices = [0; EDGES];
        for edge in SetBits(u64::from(case.edges)) {
            vertices[edge] = ids.vertex(&blocks, cell, edge);
        }
        for (triangle, place) in case.triangles().iter().zip(&mut places) {
            *place = triangle.map(|edge| vertices[usize::from(edge)]);
        }
    });
}

impl VertexIds<'_> {
    /// The vertex on an edge of a cell; `blocks` are the block of the cell and its plus neighbours.
    fn vertex(&self, blocks: &[Option<u32>; 8], cell: [usize; 3], edge: usize) -> u32 {
        let side = self.edge.voxels();
        let (axis, start) = edge_start(edge);
        let at = [0, 1, 2].map(|i| cell[i] + start[i]);
        let [bx, by, bz] = at.map(|c| c >> self.edge.log2());
        let [x, y, z] = at.map(|c| c & (side - 1));
        let block = blocks[bx | by << 1 | bz << 2].expect("corners of observed cells exist") as usize;
        self.first[block] + self.rows[(block * side + z) * side + y].vertex(x, axis)
    }
}
