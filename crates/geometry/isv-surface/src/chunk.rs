//! The crossed cells and edges of some blocks.

use crate::edges::EdgeRow;
use crate::signs::Signs;
use crate::triangles::{CrossedCell, find_cells};
use crate::window::SignWindow;
use isv_volume::{BlockIndex, NeighbourFinder, SparseVolume};

/// Blocks that a thread works on at a time.
pub(crate) const CHUNK: usize = 64;

/// The crossing edges that start in a block, row by row: `[z][y]`.
pub(crate) type EdgeRows<const SIDE: usize> = [[EdgeRow; SIDE]; SIDE];

/// What is in some blocks.
pub(crate) struct Chunk<const SIDE: usize> {
    pub(crate) edges: Vec<EdgeRows<SIDE>>,
    pub(crate) counts: Vec<Counts>,
    /// Block after block.
    pub(crate) cells: Vec<CrossedCell>,
}

/// How much of the surface a block holds, or more of them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
    pub(crate) cells: usize,
}

impl<const SIDE: usize> Chunk<SIDE> {
    /// Looks at the blocks of these indices.
    #[inline(always)]
    pub(crate) fn find(
        volume: &SparseVolume,
        signs: &Signs<SIDE>,
        index: &BlockIndex,
        blocks: &[u32],
    ) -> Self {
        let mut chunk = Self {
            edges: Vec::with_capacity(blocks.len()),
            counts: Vec::with_capacity(blocks.len()),
            // As many as in a plane across each block.
            cells: Vec::with_capacity(blocks.len() * SIDE * SIDE),
        };
        let mut finder = NeighbourFinder::new(index);
        for &block in blocks {
            finder.turn_to(volume.coords()[block as usize]);
            let around = finder.neighbourhood();
            let window = SignWindow::gather(signs, &around);
            let (edges, vertices) = find_edges(&window);
            let cells_before = chunk.cells.len();
            let triangles = find_cells(&window, &mut chunk.cells);
            chunk.edges.push(edges);
            chunk.counts.push(Counts { vertices, triangles, cells: chunk.cells.len() - cells_before });
        }
        chunk
    }

    /// How much all blocks hold.
    pub(crate) fn total(&self) -> Counts {
        self.counts.iter().fold(Counts::default(), |sum, count| Counts {
            vertices: sum.vertices + count.vertices,
            triangles: sum.triangles + count.triangles,
            cells: sum.cells + count.cells,
        })
    }
}

/// The crossing edges that start in a block, and how many there are.
#[inline(always)]
fn find_edges<const SIDE: usize>(window: &SignWindow<SIDE>) -> (EdgeRows<SIDE>, usize) {
    let mut edges = [[EdgeRow::default(); SIDE]; SIDE];
    let mut count = 0;
    for (z, layer) in edges.iter_mut().enumerate() {
        let [x_edges, y_edges, z_edges] = window.crossings(z);
        for y in 0..SIDE {
            layer[y] = EdgeRow::new([x_edges[y], y_edges[y], z_edges[y]]);
        }
        for row in layer {
            *row = row.with_first(count);
            count += row.count();
        }
    }
    (edges, count as usize)
}
