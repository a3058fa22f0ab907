//! Writing the parts of the mesh that blocks hold.

use crate::chunk::{CHUNK, Counts, EdgeRows};
use crate::extract::Surface;
use crate::normals::CodeWindow;
use crate::triangles::{VertexIds, entry};
use crate::vertices::EdgeZeros;
use glam::DVec3;
use isv_volume::{NeighbourFinder, Neighbourhood, OCTET_SLOTS};

/// Place of a part of the mesh.
pub(crate) struct Place<'a> {
    pub(crate) vertices: &'a mut [DVec3],
    /// Empty if they are not wanted.
    pub(crate) normals: &'a mut [DVec3],
    pub(crate) triangles: &'a mut [[u32; 3]],
}

/// What a thread keeps between chunks.
#[derive(Default)]
pub(crate) struct Scratch {
    codes: CodeWindow,
    ids: VertexIds,
}

/// The numbers of the blocks among those of the surface, and of their first vertices.
pub(crate) struct Numbering {
    /// Numbers of the blocks of the volume among those of the surface, plus one; 0 for the others.
    numbers: Vec<u32>,
    first: Vec<u32>,
}

impl Numbering {
    pub(crate) fn new<const SIDE: usize>(surface: &Surface<SIDE>) -> Self {
        let mut numbers = vec![0; surface.volume.block_count()];
        for (number, block) in (1..).zip(&surface.blocks) {
            numbers[*block as usize] = number;
        }
        let counts = surface.chunks.iter().flat_map(|chunk| &chunk.counts);
        let mut sum = 0u32;
        let first = counts.map(|count| {
            let first = sum;
            sum = sum.checked_add(count.vertices as u32).expect("at most u32::MAX vertices");
            first
        });
        Self { first: first.collect(), numbers }
    }

    /// The number of a block and that of its first vertex, if it holds any of the surface.
    #[inline(always)]
    fn get(&self, block: u32) -> Option<(usize, u32)> {
        let number = self.numbers[block as usize].checked_sub(1)? as usize;
        Some((number, self.first[number]))
    }
}

impl<const SIDE: usize> Surface<'_, SIDE> {
    /// Writes what the blocks of a chunk hold.
    #[inline(always)]
    pub(crate) fn fill_chunk(
        &self,
        number: usize,
        mut place: Place,
        numbering: &Numbering,
        scratch: &mut Scratch,
    ) {
        let chunk = &self.chunks[number];
        let mut finder = NeighbourFinder::new(&self.index);
        let mut cells = &chunk.cells[..];
        for (i, counts) in chunk.counts.iter().enumerate() {
            let block = number * CHUNK + i;
            finder.turn_to(self.volume.coords()[self.blocks[block] as usize]);
            let around = finder.neighbourhood();
            let mut part = place.split_off(counts);
            let (cells_here, others) = cells.split_at(counts.cells);
            cells = others;
            self.fill_vertices(block, &around, numbering.first[block], &mut part, scratch);
            self.enter_neighbours(&around, numbering, &mut scratch.ids);
            scratch.ids.fill_triangles(part.triangles, cells_here);
        }
    }

    /// Writes the vertices of a block, the first of which has the number `first`, and enters them.
    #[inline(always)]
    fn fill_vertices(
        &self,
        block: usize,
        around: &Neighbourhood,
        first: u32,
        place: &mut Place,
        scratch: &mut Scratch,
    ) {
        let zeros = EdgeZeros::<SIDE>::new(self.volume, self.blocks[block], around);
        if !place.normals.is_empty() {
            scratch.codes.gather(self.volume, &self.signs, around);
        }
        let mut number = 0;
        for (z, layer) in self.edges(block).iter().enumerate() {
            for (y, row) in layer.iter().enumerate() {
                let start = entry([0, y, z]);
                for edge in row.edges() {
                    let zero = zeros.on_edge([edge / 3, y, z], edge % 3);
                    zeros.place(&zero, &mut place.vertices[number]);
                    if let Some(normal) = place.normals.get_mut(number) {
                        *normal = scratch.codes.normal(&zero);
                    }
                    scratch.ids.set(start + edge, first + number as u32);
                    number += 1;
                }
            }
        }
    }

    /// Enters the vertices of the neighbours that the cells of a block reach.
    #[inline(always)]
    fn enter_neighbours(&self, around: &Neighbourhood, numbering: &Numbering, ids: &mut VertexIds) {
        for (step, slot) in OCTET_SLOTS.into_iter().enumerate().skip(1) {
            let Some((block, first)) = around[slot].and_then(|block| numbering.get(block)) else { continue };
            let edges = self.edges(block);
            let next = [step & 1 != 0, step & 2 != 0, step & 4 != 0];
            let start = next.map(|next| if next { SIDE } else { 0 });
            let reach = next.map(|next| if next { 1 } else { SIDE });
            for z in 0..reach[2] {
                for y in 0..reach[1] {
                    let row = if next[0] { edges[z][y].first_voxel() } else { edges[z][y] };
                    ids.enter(row, [start[0], start[1] + y, start[2] + z], first);
                }
            }
        }
    }

    #[inline(always)]
    fn edges(&self, block: usize) -> &EdgeRows<SIDE> {
        &self.chunks[block / CHUNK].edges[block % CHUNK]
    }
}

impl<'a> Place<'a> {
    /// Takes the places for so much from the front.
    #[inline(always)]
    fn split_off(&mut self, counts: &Counts) -> Self {
        let normals = if self.normals.is_empty() { 0 } else { counts.vertices };
        let enough = "a place for each vertex and triangle";
        Self {
            vertices: self.vertices.split_off_mut(..counts.vertices).expect(enough),
            normals: self.normals.split_off_mut(..normals).expect(enough),
            triangles: self.triangles.split_off_mut(..counts.triangles).expect(enough),
        }
    }
}
