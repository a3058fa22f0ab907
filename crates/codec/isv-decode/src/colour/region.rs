//! The cells of a region of a frame, taken together: the readings of a block share most of them.

use super::cells::BlockCells;
use super::morton::position;
use super::surfel::Surfel;

/// Longest edge of a region, in cells.
const MAX_EDGE: i32 = 18;
/// The places in a block, in Morton order, whose coordinate along an axis is below a bound: a bit each.
const BELOW: [[[u64; 8]; 9]; 3] = {
    let mut below = [[[0; 8]; 9]; 3];
    let mut axis = 0;
    while axis < 3 {
        let mut bound = 0;
        while bound <= 8 {
            let mut place = 0;
            while place < 512 {
                let bits = place >> axis;
                if (bits & 1 | bits >> 2 & 2 | bits >> 4 & 4) < bound {
                    below[axis][bound][place >> 6] |= 1 << (place & 63);
                }
                place += 1;
            }
            bound += 1;
        }
        axis += 1;
    }
    below
};

/// A cell of a region, or what stands for one that is not crossed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RegionCell {
    /// The surface in the cell.
    surfel: Surfel,
    /// Whether there is such a cell.
    is_there: bool,
    /// Whether its samples are those of its block's deepest layer.
    pub(super) is_deepest: bool,
    /// The first of its samples in its layer.
    pub(super) first: u32,
    /// Index of the cell among all of the frame.
    pub(super) cell: u32,
}

impl RegionCell {
    /// Parts of the cell that the surface crosses at a depth of at most 1, a bit each; see [`ColourShape::parts`].
    ///
    /// [`ColourShape::parts`]: super::frame::ColourShape::parts
    #[inline(always)]
    pub(super) fn parts(&self, depth: u8) -> u64 {
        if depth == 0 { 1 } else { u64::from(self.surfel.halves) }
    }

    /// Whether there is a cell whose surface faces a normal.
    #[inline(always)]
    pub(super) fn faces(&self, normal: [i8; 3]) -> bool {
        self.is_there & self.surfel.faces(normal)
    }
}

/// The crossed cells of a box of voxels, and where their samples of one depth are.
#[derive(Clone, Debug, Default)]
pub(super) struct Region {
    lowest: [i32; 3],
    extent: [i32; 3],
    depth: u8,
    /// The number of each voxel's cell, x fastest; 0 where it is not crossed.
    numbers: Vec<u16>,
    /// The first stands for cells that are not there.
    cells: Vec<RegionCell>,
}

impl Region {
    /// Makes the region empty.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.extent = [0; 3];
    }

    /// Begins the region from a voxel on to before another one, both counted from the reader's origin. Tells whether it has any voxels:
    /// not if it is too large.
    #[inline(always)]
    pub(super) fn begin(&mut self, lowest: [i32; 3], end: [i32; 3], depth: u8) -> bool {
        self.extent = [0; 3];
        let mut extent = [0; 3];
        for axis in 0..3 {
            extent[axis] = end[axis].saturating_sub(lowest[axis]);
            if !(1..=MAX_EDGE).contains(&extent[axis]) {
                return false;
            }
        }
        (self.lowest, self.extent, self.depth) = (lowest, extent, depth);
        self.numbers.clear();
        self.numbers.resize((extent[0] * extent[1] * extent[2]) as usize, 0);
        self.cells.clear();
        self.cells.push(RegionCell::default());
        true
    }

    /// Adds the cells of a block that lie in the region. `place`: of the block from the reader's origin. `surfels`: of its cells.
    /// `start`: of its samples in the layer of the region's depth. `is_deepest`: whether it has none below that layer.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        place: [i32; 3],
        cells: &BlockCells,
        surfels: &[Surfel],
        start: u32,
        is_deepest: bool,
    ) {
        let mut from_lowest = [0; 3];
        let mut within = cells.crossed;
        for axis in 0..3 {
            from_lowest[axis] = 8 * place[axis] - self.lowest[axis];
            let from = (-from_lowest[axis]).clamp(0, 8) as usize;
            let to = (self.extent[axis] - from_lowest[axis]).clamp(0, 8) as usize;
            let (below, above) = (&BELOW[axis][to], &BELOW[axis][from]);
            for word in 0..8 {
                within[word] &= below[word] & !above[word];
            }
        }
        let strides = [1, self.extent[0], self.extent[0] * self.extent[1]];
        for octant in 0..8 {
            let mut rest = within[octant];
            while rest != 0 {
                let place = octant << 6 | rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let Some(cell) = cells.cell(place) else { continue };
                let number = cell - cells.first();
                let (voxel, mut at) = (position(place), 0);
                for axis in 0..3 {
                    at += (from_lowest[axis] + voxel[axis] as i32) * strides[axis];
                }
                self.numbers[at as usize] = self.cells.len() as u16;
                let first = start + ((number as u32) << (3 * self.depth));
                let (surfel, cell) = (surfels[number], cell as u32);
                self.cells.push(RegionCell { surfel, is_there: true, is_deepest, first, cell });
            }
        }
    }

    /// Whether no cell of the region is crossed.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.cells.len() <= 1
    }

    /// Depth of the samples.
    #[inline(always)]
    pub(super) fn depth(&self) -> u8 {
        self.depth
    }

    /// The place in the region of the 2x2x2 voxels from one on; `None` if not all lie in it.
    #[inline(always)]
    pub(super) fn find(&self, voxel: [i32; 3]) -> Option<usize> {
        let (mut at, mut stride, mut within) = (0, 1, true);
        for axis in 0..3 {
            let from_lowest = voxel[axis].wrapping_sub(self.lowest[axis]);
            within &= (from_lowest as u32) < (self.extent[axis] as u32).saturating_sub(1);
            at += from_lowest.wrapping_mul(stride);
            stride *= self.extent[axis];
        }
        within.then_some(at as usize)
    }

    /// The surface in the cell of the voxel at a place that [`Self::find`] gave.
    #[inline(always)]
    pub(super) fn plane(&self, at: usize) -> Option<Surfel> {
        let cell = &self.cells[usize::from(self.numbers[at])];
        cell.is_there.then_some(cell.surfel)
    }

    /// The cells of the 2x2x2 voxels at a place that [`Self::find`] gave, x fastest.
    #[inline(always)]
    pub(super) fn cells_around(&self, at: usize) -> [&RegionCell; 8] {
        let [along_y, along_z] = [self.extent[0] as usize, (self.extent[0] * self.extent[1]) as usize];
        let rows = [at, at + along_y, at + along_z, at + along_z + along_y];
        let mut around = [&self.cells[0]; 8];
        for (row, first) in rows.into_iter().enumerate() {
            let pair = &self.numbers[first..first + 2];
            around[2 * row] = &self.cells[usize::from(pair[0])];
            around[2 * row + 1] = &self.cells[usize::from(pair[1])];
        }
        around
    }
}

#[cfg(test)]
mod tests {
    use crate::colour::{ColourCells, ColourFrame, ColourShape, Reader, Sample, surface_colours};
    use isv_testkit::{Random, ball};
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    /// Samples of a lumpy ball that have nothing to do with one another. `depth`: of a block.
    fn frame(random: &mut Random, depth: impl Fn(usize) -> u8) -> ColourFrame {
        let truncation = Truncation::from_voxels(4).unwrap();
        let voxel_size = VoxelSize::from_metres(0.005).unwrap();
        let volume = ball(Grid { voxel_size, edge: BlockEdge::E8, truncation }, 1.5);
        let cells = ColourCells::new(&volume);
        let depths = (0..cells.coords().len()).map(depth).collect();
        let shape = ColourShape::new(cells, depths, &volume);
        let mut layers = shape.layers();
        for block in 0..shape.depths().len() {
            for layer in 0..=shape.depths()[block] {
                let start = shape.block_samples(block, layer).start;
                for number in 0..shape.cells().blocks()[block].count() {
                    for part in 0..1usize << (3 * layer) {
                        let value = |scale: f64, random: &mut Random| (scale * random.signed()) as i16;
                        if shape.parts(block, number, layer) >> part & 1 != 0 {
                            layers[usize::from(layer)][start + (number << (3 * layer)) + part] = [
                                8000 + value(8000.0, random),
                                value(8000.0, random),
                                value(8000.0, random),
                                1,
                            ];
                        }
                    }
                }
            }
        }
        ColourFrame { shape, layers }
    }

    #[test]
    fn a_frame_without_samples_gives_none() {
        let frame = ColourFrame::default();
        let mut reader = Reader::new(&frame);
        reader.turn_to(isv_volume::BlockCoord { x: 0, y: 0, z: 0 });
        reader.hold([-1; 3], [10; 3], 1);
        let mut parts = [[1; 4]; 64];
        reader.read_cell([300; 3], [127, 0, 0], 1, 0xff, &mut parts);
        assert_eq!(parts[..8], [[0; 4]; 8]);
        assert_eq!(reader.plane([1; 3]), None);
    }

    #[test]
    fn readings_are_those_without_a_region() {
        let mut random = Random::new(21);
        for (depth, mixed) in [(0, false), (1, false), (1, true), (2, false), (2, true)] {
            let frame =
                frame(&mut random, |block| if mixed { depth * u8::from(block % 3 != 0) } else { depth });
            let (mut held, mut plain) = (Reader::new(&frame), Reader::new(&frame));
            let (mut coloured, mut planes, mut leaves) = (0, 0, 0);
            for round in 0..4000 {
                let coords = frame.shape.cells().coords();
                let coord = coords[round * 7 % coords.len()];
                held.turn_to(coord);
                plain.turn_to(coord);
                let mut integer = |scale: f64| (scale * random.signed()).round() as i32;
                let lowest = [0; 3].map(|_| integer(5.0) - 3);
                let end = lowest.map(|first| first + 7 + integer(8.0));
                held.hold(lowest, end, depth);
                let corner = [0; 3].map(|_| 1024 + integer(1800.0));
                // On the lattice of samples now and then.
                let corner = if round % 5 == 0 { corner.map(|c| c & !127) } else { corner };
                let normal = [0; 3].map(|_| integer(127.0) as i8);
                let [mut with, mut without] = [[[0; 4]; 64]; 2];
                let wanted = u64::MAX >> (64 - (1 << (3 * depth)));
                held.read_cell(corner, normal, depth, wanted, &mut with);
                plain.read_cell(corner, normal, depth, wanted, &mut without);
                let parts = 1usize << (3 * depth);
                assert_eq!(with[..parts], without[..parts], "{depth} {mixed} {round}");
                coloured += without[..parts].iter().filter(|sample: &&Sample| sample[3] != 0).count();
                assert_eq!(held.read(corner, normal, depth), plain.read(corner, normal, depth), "{round}");
                let [with, without] = [&mut held, &mut plain].map(|reader| {
                    let taps = reader.leaf_taps(corner, normal, depth);
                    let there = taps.iter().filter(|tap| tap.weight > 0);
                    there.map(|tap| (tap.cell, tap.rank, tap.weight)).collect::<Vec<_>>()
                });
                assert_eq!(with, without, "{depth} {mixed} {round}");
                leaves += with.len();
                let voxel = corner.map(|c| c >> 8);
                let plane = plain.plane(voxel);
                assert_eq!(held.plane(voxel), plane);
                planes += usize::from(plane.is_some());
            }
            assert!(coloured > 300 && planes > 200 && leaves > 300, "{coloured} {planes} {leaves}");
        }
    }

    #[test]
    fn points_have_the_same_colour_alone() {
        let mut random = Random::new(22);
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::from_voxels(4).unwrap(),
        };
        for (depth, mixed) in [(0, false), (1, false), (1, true), (2, true)] {
            let frame =
                frame(&mut random, |block| if mixed { depth * u8::from(block % 3 != 0) } else { depth });
            let mut points: Vec<[f64; 3]> = Vec::new();
            for (run, coord) in frame.shape.cells().coords().iter().enumerate() {
                // Both sides of the number from which on points share their block's cells; on its borders now and then.
                for _ in 0..10 + run % 5 {
                    points.push(coord.to_array().map(|block| {
                        let within = match (8.0 * (random.signed() + 1.0) / 2.0 * 4.0).round() {
                            0.0 => 0.0,
                            32.0 => 8.0,
                            _ => 4.0 * (random.signed() + 1.0),
                        };
                        (8.0 * f64::from(block) + within + 0.5) * 0.005
                    }));
                }
            }
            let together = surface_colours(&frame, &grid, &points);
            let alone: Vec<_> =
                points.iter().map(|point| surface_colours(&frame, &grid, &[*point])[0]).collect();
            assert_eq!(together, alone, "{depth} {mixed}");
            let coloured = alone.iter().filter(|colour| **colour != [128; 3]).count();
            assert!(coloured > 100, "{coloured} of {}", alone.len());
        }
    }
}
