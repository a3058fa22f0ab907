//! Prediction of a block's samples from the frame before, along vectors and through the surface.

use super::frame::{ColourShape, GREY, Sample, clamped, divided};
use super::morton::position;
use super::reader::{Reader, shifted, sum};
use super::surfel::Surfel;
use crate::main::{BlockMode, Vector};
use isv_volume::NeighbourFinder;

/// Positions to an eighth of a voxel, the unit of vectors.
const VECTOR_SCALE: i32 = 32;
/// Mark of a part that has to have a sample and got none.
const HOLE: Sample = [0, 0, 0, -1];
/// Cells of a block from which on it pays to take those around them together.
const SHARING: usize = 12;
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
    /// Components of the vectors, and 1 where there is one; not set if all are the same.
    vectors: [[i32; 4]; 27],
}

impl<'a> MotionField<'a> {
    /// Creates the field of a block that has a vector itself.
    #[must_use]
    pub fn new(around: &'a VectorsAround) -> Self {
        let uniform = around[13].filter(|own| around.iter().flatten().all(|v| v == own));
        let mut vectors = [[0; 4]; 27];
        if uniform.is_none() {
            for (to, vector) in vectors.iter_mut().zip(around) {
                if let Some(Vector([x, y, z])) = vector {
                    *to = [i32::from(*x), i32::from(*y), i32::from(*z), 1];
                }
            }
        }
        Self { around, uniform, vectors }
    }

    /// The voxels that a block is read from: the first, and the one after the last, counted from the block's first. The normals of a
    /// surface that changes may lead somewhat farther.
    #[must_use]
    #[inline(always)]
    fn reach(&self) -> ([i32; 3], [i32; 3]) {
        let (mut least, mut most) = ([i32::MAX; 3], [i32::MIN; 3]);
        for vector in self.around.iter().flatten() {
            for axis in 0..3 {
                least[axis] = least[axis].min(i32::from(vector.0[axis]));
                most[axis] = most[axis].max(i32::from(vector.0[axis]));
            }
        }
        reach(least, most)
    }

    /// The motion at the middle of a cell, in 1/256 voxel.
    #[must_use]
    #[inline(always)]
    pub fn at(&self, voxel: [usize; 3]) -> [i32; 3] {
        if let Some(vector) = self.uniform {
            let [x, y, z] = vector.0;
            return [i32::from(x) * VECTOR_SCALE, i32::from(y) * VECTOR_SCALE, i32::from(z) * VECTOR_SCALE];
        }
        // Sixteenths of a block from the block's middle, and the slots' step to the block on that side.
        const STRIDES: [i32; 3] = [1, 3, 9];
        let (mut away, mut side) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let from_middle = 2 * voxel[axis] as i32 - 7;
            away[axis] = from_middle.abs();
            side[axis] = STRIDES[axis] * from_middle.signum();
        }
        let at = |slot: i32| &self.vectors[slot as usize];
        let along_x = |slot: i32| mixed(at(slot), at(slot + side[0]), away[0]);
        let along_y = |slot: i32| mixed(&along_x(slot), &along_x(slot + side[1]), away[1]);
        let [x, y, z, weights] = mixed(&along_y(13), &along_y(13 + side[2]), away[2]);
        // The block's own vector is one of them.
        divided([x * VECTOR_SCALE, y * VECTOR_SCALE, z * VECTOR_SCALE], weights)
    }
}

/// Two vectors by the share of the second one, in sixteenths.
#[inline(always)]
fn mixed(first: &[i32; 4], second: &[i32; 4], share: i32) -> [i32; 4] {
    let mut sums = [0; 4];
    for lane in 0..4 {
        sums[lane] = first[lane] * (16 - share) + second[lane] * share;
    }
    sums
}

/// Voxels around those of a block that are read too.
const MARGIN: i32 = 1;

/// The voxels that a block is read from under vectors (1/8 voxel) between two bounds: the first voxel, and the one after the
/// last. Both count from the block's first voxel. `least` and `most`: the least and the greatest component of the vectors along
/// each axis.
#[must_use]
#[inline(always)]
pub fn reach(least: [i32; 3], most: [i32; 3]) -> ([i32; 3], [i32; 3]) {
    // A cell is read between those it lies in and the next ones.
    (most.map(|v| (-v >> 3) - MARGIN), least.map(|v| ((7 - v) >> 3) + 9 + MARGIN))
}

/// Offset from the surface in a cell to where its colour is read, in 1/256 voxel. It leads against the motion, then along the
/// normal onto the surface before. `middle`: of the cell, from the reader's origin.
///
/// Where nothing moves, the plane of the same cell is asked first: what stands still is read exactly where it is.
#[inline(always)]
fn displacement(reader: &mut Reader, surfel: &Surfel, middle: [i32; 3], motion: [i32; 3]) -> [i32; 3] {
    let [x, y, z] = motion;
    let back = [-x, -y, -z];
    let from = sum(middle, back);
    let [x, y, z] = surfel.offset;
    let sought = sum(from, [i32::from(x), i32::from(y), i32::from(z)]);
    let onto = match onto_plane(reader, surfel.normal, sought, shifted(from, 8)) {
        Some(onto) => onto,
        None => onto_surface(reader, surfel.normal, sought),
    };
    sum(onto, back)
}

/// Offset from a position to the surface near it that faces a normal. It leads to the plane of the cell that the position lies
/// in, or else to those of the cells around it.
#[inline]
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
    divided(sums, weights)
}

/// From a position to the plane in a cell, if the cell has one that faces a normal.
#[inline(always)]
fn onto_plane(reader: &mut Reader, normal: [i8; 3], position: [i32; 3], voxel: [i32; 3]) -> Option<[i32; 3]> {
    let plane = reader.plane(voxel)?;
    if !plane.faces(normal) {
        return None;
    }
    let mut height = 0;
    for axis in 0..3 {
        let on_plane = (voxel[axis] << 8) + 128 + i32::from(plane.offset[axis]);
        height += (position[axis] - on_plane) * i32::from(plane.normal[axis]);
    }
    // Both factors of the normal are 127 too large.
    const SQUARE: i32 = NORMAL_SCALE * NORMAL_SCALE;
    let mut onto = [0; 3];
    for axis in 0..3 {
        onto[axis] = -(height * i32::from(plane.normal[axis])) / SQUARE;
    }
    Some(onto)
}

/// Predicts the parts of a cell at a depth from the frame before, in Morton order. The last value is 0 where that frame has no
/// sample near. `motion`: in 1/256 voxel; `wanted`: the parts that are predicted, a bit each. The reader is turned to the cell's
/// block.
#[inline(always)]
pub fn predict_cell(
    reader: &mut Reader,
    surfel: &Surfel,
    voxel: [usize; 3],
    motion: [i32; 3],
    depth: u8,
    wanted: u64,
    out: &mut [Sample; 64],
) {
    let [x, y, z] = voxel;
    let corner = [(x as i32) << 8, (y as i32) << 8, (z as i32) << 8];
    let by = displacement(reader, surfel, sum(corner, [128; 3]), motion);
    reader.read_cell(sum(corner, by), surfel.normal, depth, wanted, out);
}

/// Predicts the samples of a block from the frame before.
///
/// `out` gets a sample for each part of each of the block's cells, in Morton order. The last value is 0 where the surface does not
/// cross a part. Parts near which the frame before has nothing get the mean of the others, or grey.
#[inline(always)]
pub fn predict_block(
    reader: &mut Reader,
    shape: &ColourShape,
    block: usize,
    field: &MotionField,
    out: &mut Vec<Sample>,
) {
    let (cells, depth) = (shape.cells(), shape.depths()[block]);
    reader.turn_to(cells.coords()[block]);
    let surfels = cells.block_surfels(block);
    if surfels.len() >= SHARING {
        let (lowest, end) = field.reach();
        reader.hold(lowest, end, depth);
    }
    let mut parts = [[0; 4]; 64];
    let mut holes = false;
    out.clear();
    for (number, (place, surfel)) in cells.blocks()[block].places().zip(surfels).enumerate() {
        let (voxel, leaves) = (position(place), shape.leaves(block, number));
        predict_cell(reader, surfel, voxel, field.at(voxel), depth, leaves, &mut parts);
        holes |= match depth {
            0 => put_parts::<1>(&mut parts, leaves, out),
            1 => put_parts::<8>(&mut parts, leaves, out),
            _ => put_parts::<64>(&mut parts, leaves, out),
        };
    }
    if holes {
        fill_holes(out);
    }
}

/// Adds the first `N` parts of a cell, of which others than its leaves have no samples. Tells whether there are holes.
#[inline(always)]
fn put_parts<const N: usize>(parts: &mut [Sample; 64], leaves: u64, out: &mut Vec<Sample>) -> bool {
    let mut holes = false;
    for (part, sample) in parts[..N].iter_mut().enumerate() {
        let is_leaf = leaves >> part & 1 != 0;
        let is_hole = is_leaf && sample[3] == 0;
        holes |= is_hole;
        *sample = if is_hole { HOLE } else { sample.map(|value| if is_leaf { value } else { 0 }) };
    }
    out.extend_from_slice(&parts[..N]);
    holes
}

/// Gives the holes of a block the mean of its samples, or grey.
#[inline(never)]
fn fill_holes(samples: &mut [Sample]) {
    let (mut sums, mut count) = ([0i32; 3], 0);
    for sample in samples.iter().filter(|sample| sample[3] > 0) {
        count += 1;
        (0..3).for_each(|c| sums[c] += i32::from(sample[c]));
    }
    let fill = if count == 0 { GREY } else { clamped(divided(sums, count)) };
    samples.iter_mut().filter(|sample| **sample == HOLE).for_each(|sample| *sample = fill);
}
