//! Prediction of a block's samples from the frame before, along vectors and through the surface.

use super::cells::{ColourCells, Surfel};
use super::frame::{Reader, Sample};
use super::morton::position;
use crate::main::{BlockMode, Vector};
use isv_volume::NeighbourFinder;

/// Positions to an eighth of a voxel, the unit of vectors.
const VECTOR_SCALE: i32 = 32;
/// Full scale of a component of a normal.
const NORMAL_SCALE: i32 = 127;

/// Vectors of the 3x3x3 blocks around a block, by slot; `None` where there is none.
pub type VectorsAround = [Option<Vector>; 27];

/// The vectors around a block, by the modes of a frame's blocks.
#[must_use]
pub fn vectors_around(finder: &NeighbourFinder, modes: &[BlockMode]) -> VectorsAround {
    finder.neighbourhood().map(|block| modes[block? as usize].vector())
}

/// The motion at each cell of a block: its vector and those around it, interpolated between the middles of blocks.
#[derive(Clone, Copy, Debug)]
pub struct MotionField<'a> {
    around: &'a VectorsAround,
    /// The vector, if all that are there are the same.
    uniform: Option<Vector>,
}

impl<'a> MotionField<'a> {
    /// Creates the field of a block that has a vector itself.
    #[must_use]
    pub fn new(around: &'a VectorsAround) -> Self {
        let uniform = around[13].filter(|own| around.iter().flatten().all(|v| v == own));
        Self { around, uniform }
    }

    /// The motion at the middle of a cell, in 1/256 voxel.
    #[must_use]
    #[inline(always)]
    pub fn at(&self, voxel: [usize; 3]) -> [i32; 3] {
        if let Some(vector) = self.uniform {
            return vector.0.map(|c| i32::from(c) * VECTOR_SCALE);
        }
        // Sixteenths of a block from the block's middle.
        let from_middle = voxel.map(|v| 2 * v as i32 - 7);
        let (mut sums, mut weights) = ([0; 3], 0);
        for corner in 0..8usize {
            let (mut slot, mut weight) = (13, 1);
            for (axis, stride) in [1, 3, 9].into_iter().enumerate() {
                let away = from_middle[axis].abs();
                if corner >> axis & 1 != 0 {
                    slot += stride * from_middle[axis].signum();
                    weight *= away;
                } else {
                    weight *= 16 - away;
                }
            }
            if let Some(vector) = self.around[slot as usize] {
                weights += weight;
                (0..3).for_each(|axis| sums[axis] += weight * i32::from(vector.0[axis]));
            }
        }
        // The block's own vector is one of them.
        sums.map(|sum| (sum * VECTOR_SCALE + weights / 2).div_euclid(weights))
    }
}

/// From the surface in a cell to where its colour is read, in 1/256 voxel: against the motion, then along the normal onto the
/// surface before. `middle`: of the cell, from the reader's origin.
///
/// Where nothing moves, the plane of the same cell is asked first: what stands still is read exactly where it is.
#[inline(always)]
fn displacement(reader: &mut Reader, surfel: &Surfel, middle: [i32; 3], motion: [i32; 3]) -> [i32; 3] {
    let from: [i32; 3] = std::array::from_fn(|axis| middle[axis] - motion[axis]);
    let sought: [i32; 3] = std::array::from_fn(|axis| from[axis] + i32::from(surfel.offset[axis]));
    let onto = onto_plane(reader, surfel.normal, sought, from.map(|p| p >> 8));
    let onto = onto.unwrap_or_else(|| onto_surface(reader, surfel.normal, sought));
    std::array::from_fn(|axis| onto[axis] - motion[axis])
}

/// From a position to the surface near it that faces a normal: to the plane of the cell that it lies in, or of those around it.
#[inline(always)]
fn onto_surface(reader: &mut Reader, normal: [i8; 3], position: [i32; 3]) -> [i32; 3] {
    let home = position.map(|p| p >> 8);
    if let Some(to) = onto_plane(reader, normal, position, home) {
        return to;
    }
    let from_first = position.map(|p| p - 128);
    let first = from_first.map(|p| p >> 8);
    let (mut sums, mut weights) = ([0i32; 3], 0);
    for corner in 0..8 {
        let (mut voxel, mut weight) = (first, 1);
        for axis in 0..3 {
            let upper = (from_first[axis] & 255) >> 3;
            let step = corner >> axis & 1;
            voxel[axis] += step;
            weight *= if step != 0 { upper } else { 32 - upper };
        }
        if let Some(to) = (weight > 0).then(|| onto_plane(reader, normal, position, voxel)).flatten() {
            weights += weight;
            (0..3).for_each(|axis| sums[axis] += weight * to[axis]);
        }
    }
    if weights == 0 { [0; 3] } else { sums.map(|sum| super::frame::rounded(sum, weights)) }
}

/// From a position to the plane in a cell, if the cell has one that faces a normal.
#[inline(always)]
fn onto_plane(reader: &mut Reader, normal: [i8; 3], position: [i32; 3], voxel: [i32; 3]) -> Option<[i32; 3]> {
    let found = reader.cell(voxel)?;
    let plane = reader.surfel(found);
    if !plane.faces(normal) {
        return None;
    }
    let height: i32 = (0..3)
        .map(|axis| {
            let on_plane = (voxel[axis] << 8) + 128 + i32::from(plane.offset[axis]);
            (position[axis] - on_plane) * i32::from(plane.normal[axis])
        })
        .sum();
    // Both factors of the normal are 127 too large.
    const SQUARE: i32 = NORMAL_SCALE * NORMAL_SCALE;
    Some(plane.normal.map(|n| -(height * i32::from(n)) / SQUARE))
}

/// Predicts one leaf of a cell from the frame before. `motion`: in 1/256 voxel; `leaf`: its place in the cell at the depth. The reader
/// is turned to the cell's block.
#[must_use]
pub fn predict_leaf(
    reader: &mut Reader,
    surfel: &Surfel,
    voxel: [usize; 3],
    motion: [i32; 3],
    leaf: usize,
    depth: u8,
) -> Option<Sample> {
    let corner = voxel.map(|v| (v as i32) << 8);
    let by = displacement(reader, surfel, corner.map(|c| c + 128), motion);
    let middle = position(leaf).map(|c| (2 * c as i32 + 1) << (7 - depth));
    reader.read([0, 1, 2].map(|axis| corner[axis] + by[axis] + middle[axis]), surfel.normal, depth)
}

/// Predicts the samples of a block at a depth, in Morton order, into `out`; `None` where the frame before has none near.
///
/// `quarters`: crossed quarter cells, if it is two deep. Slots of cells that the surface does not cross are left out: `out` gets one
/// sample for each leaf of the block's tree.
pub fn predict_block(
    reader: &mut Reader,
    cells: &ColourCells,
    block: usize,
    field: &MotionField,
    quarters: &[u64],
    depth: u8,
    out: &mut Vec<Option<Sample>>,
) {
    reader.turn_to(cells.coords()[block]);
    let surfels = cells.block_surfels(block);
    for (cell, (place, surfel)) in cells.blocks()[block].places().zip(surfels).enumerate() {
        let voxel = position(place);
        let corner = voxel.map(|v| (v as i32) << 8);
        let by = displacement(reader, surfel, corner.map(|c| c + 128), field.at(voxel));
        let from = [0, 1, 2].map(|axis| corner[axis] + by[axis]);
        let mut read = |place: usize, depth: u8| {
            let [x, y, z] = position(place).map(|c| (2 * c as i32 + 1) << (7 - depth));
            reader.read([from[0] + x, from[1] + y, from[2] + z], surfel.normal, depth)
        };
        match depth {
            0 => out.push(read(0, 0)),
            1 => out.extend((0..8).filter(|half| surfel.halves >> half & 1 != 0).map(|half| read(half, 1))),
            _ => out.extend((0..64).filter(|q| quarters[cell] >> q & 1 != 0).map(|quarter| read(quarter, 2))),
        }
    }
}
