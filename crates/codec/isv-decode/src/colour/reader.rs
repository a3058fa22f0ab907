//! Readings of colour at points, and in the parts of cells.

use super::frame::{ColourFrame, Sample, mean};
use super::morton::{interleave, position};
use super::region::{Region, RegionCell};
use super::surfel::Surfel;
use isv_volume::{BlockCoord, NeighbourFinder};

/// Fractional bits of weights between samples along an axis.
const WEIGHT_BITS: u32 = 5;
/// Deepest samples of which all parts of a cell are read from a region together.
const MAX_HELD_DEPTH: u8 = 1;

/// Reader of the cells and samples around a point.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    frame: &'a ColourFrame,
    finder: NeighbourFinder<'a>,
    /// The block that positions count from.
    origin: BlockCoord,
    /// The block that the finder is turned to, from the origin.
    middle: [i32; 3],
    /// The last block looked up, from the origin, and its number.
    last: ([i32; 3], Option<u32>),
    /// Cells that readings share.
    region: Region,
}

/// A cell of a frame and its block.
#[derive(Clone, Copy, Debug)]
pub struct FoundCell {
    /// Number of the block among those that have cells.
    pub block: usize,
    /// Index of the cell among all of the frame.
    pub cell: usize,
}

impl<'a> Reader<'a> {
    /// Creates a reader of a frame.
    #[must_use]
    pub fn new(frame: &'a ColourFrame) -> Self {
        let finder = NeighbourFinder::new(frame.shape.cells().index());
        let origin = BlockCoord { x: 0, y: 0, z: 0 };
        Self {
            frame,
            finder,
            origin,
            middle: [i32::MIN; 3],
            last: ([i32::MIN; 3], None),
            region: Region::default(),
        }
    }

    /// Turns to the block that positions count from, which need not be one of the frame's.
    pub fn turn_to(&mut self, origin: BlockCoord) {
        self.origin = origin;
        self.middle = [i32::MIN; 3];
        self.last = ([i32::MIN; 3], None);
        self.region.clear();
    }

    /// Takes the cells of a box of voxels together, which makes the readings of many cells and points in it faster. They are the
    /// same without it. `lowest`: the first voxel, counted from the origin's; `end`: the one after the last; `depth`: of the
    /// samples that will be read.
    #[inline(always)]
    pub fn hold(&mut self, lowest: [i32; 3], end: [i32; 3], depth: u8) {
        if !self.region.begin(lowest, end, depth) {
            return;
        }
        let (first, last) = (shifted(lowest, 3), shifted(sum(end, [-1; 3]), 3));
        let middle = sum(first, [1; 3]);
        let coord = self.origin.offset(middle);
        if (0..3).any(|axis| last[axis] > middle[axis] + 1) || !coord.in_range() {
            self.region.clear();
            return;
        }
        (self.middle, self.last) = (middle, ([i32::MIN; 3], None));
        self.finder.turn_to(coord);
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let Some(block) = self.block([x, y, z]) else { continue };
                    let (block, shape) = (block as usize, &self.frame.shape);
                    let block_depth = shape.depths()[block];
                    if block_depth < depth {
                        // Near it some cells are read less deep.
                        self.region.clear();
                        return;
                    }
                    let (cells, start) = (shape.cells(), shape.starts()[block][usize::from(depth)]);
                    let (own, surfels) = (&cells.blocks()[block], cells.block_surfels(block));
                    self.region.add([x, y, z], own, surfels, start, block_depth == depth);
                }
            }
        }
        if self.region.is_empty() {
            // There may be no samples at all.
            self.region.clear();
        }
    }

    /// The surface in the cell at a voxel, if it is crossed.
    #[inline(always)]
    pub fn plane(&mut self, voxel: [i32; 3]) -> Option<Surfel> {
        match self.region.find(voxel) {
            Some(at) => self.region.plane(at),
            None => self.cell(voxel).map(|found| *self.surfel(found)),
        }
    }

    /// The number of a block, by its place from the origin.
    #[inline(always)]
    fn block(&mut self, place: [i32; 3]) -> Option<u32> {
        if self.last.0 == place {
            return self.last.1;
        }
        let mut step = [0; 3];
        for axis in 0..3 {
            step[axis] = place[axis].wrapping_sub(self.middle[axis]);
        }
        let is_near = |s: i32| (-1..=1).contains(&s);
        let block = if is_near(step[0]) && is_near(step[1]) && is_near(step[2]) {
            self.finder.get((13 + step[0] + 3 * step[1] + 9 * step[2]) as usize)
        } else {
            let coord = self.origin.offset(place);
            if !coord.in_range() {
                return None;
            }
            self.middle = place;
            self.finder.turn_to(coord);
            self.finder.get(13)
        };
        self.last = (place, block);
        block
    }

    /// The crossed cell at a voxel, counted from the origin's first.
    #[inline(always)]
    pub fn cell(&mut self, voxel: [i32; 3]) -> Option<FoundCell> {
        let block = self.block(shifted(voxel, 3))? as usize;
        let [x, y, z] = voxel;
        let place = interleave([(x & 7) as usize, (y & 7) as usize, (z & 7) as usize]);
        let cell = self.frame.shape.cells().blocks()[block].cell(place)?;
        Some(FoundCell { block, cell })
    }

    /// The surface in a cell.
    #[inline(always)]
    pub fn surfel(&self, found: FoundCell) -> &'a Surfel {
        &self.frame.shape.cells().surfels()[found.cell]
    }

    /// The place in its layer of a cell's sample at a place at a depth, or of the deepest above it. `None` if the surface does not
    /// cross it.
    #[inline(always)]
    fn sample(&self, found: FoundCell, place: [i32; 3], depth: u8) -> Option<Tap> {
        let shape = &self.frame.shape;
        let deep = depth.min(shape.depths()[found.block]);
        let number = found.cell - shape.cells().blocks()[found.block].first();
        let (shift, mask) = (depth - deep, (1 << deep) - 1);
        let [x, y, z] = place;
        let part = interleave([
            (x >> shift & mask) as usize,
            (y >> shift & mask) as usize,
            (z >> shift & mask) as usize,
        ]);
        let parts = shape.parts(found.block, number, deep);
        if parts >> part & 1 == 0 {
            return None;
        }
        let start = shape.starts()[found.block][usize::from(deep)] as usize;
        let at = (start + (number << (3 * deep)) + part) as u32;
        let is_leaf = deep == shape.depths()[found.block];
        Some(Tap { layer: deep, at, is_leaf, cell: found.cell as u32, rank: rank(parts, part) })
    }

    /// The depth that is read where samples of a depth are wanted: that of the block at a position, if it is less.
    #[inline(always)]
    pub fn depth_at(&mut self, position: [i32; 3], wanted: u8) -> u8 {
        match self.block(shifted(position, 11)) {
            Some(block) => wanted.min(self.frame.shape.depths()[block as usize]),
            None => wanted,
        }
    }

    /// Reads the colour at a position, in 1/256 voxel from the middle of the origin's first voxel. It is the trilinear mean of the
    /// samples around it that are there. `depth`: of the samples wanted; where a block has none so deep, its deepest
    /// are read. `normal`: only samples of surfaces that face it count. `None` if there are no samples.
    #[inline(always)]
    pub fn read(&mut self, position: [i32; 3], normal: [i8; 3], depth: u8) -> Option<Sample> {
        let deep = self.depth_at(position, depth);
        self.read_at(position, normal, deep)
            .or_else(|| if deep > 0 { self.read_at(position, normal, 0) } else { None })
    }

    /// The colour between the samples of one depth.
    #[inline(always)]
    fn read_at(&mut self, position: [i32; 3], normal: [i8; 3], depth: u8) -> Option<Sample> {
        let lattice = Lattice::new(position, depth);
        let held = self.region.find(lattice.voxel).filter(|_| self.region.depth() == depth);
        let layers = &self.frame.layers;
        let mut sums = [0i32; 4];
        match held {
            Some(at) => {
                sums = lattice.held_sums(
                    self.region.cells_around(at),
                    &layers[usize::from(depth)],
                    normal,
                    depth,
                );
            }
            None => self.for_taps(&lattice, normal, depth, |tap, weight| {
                let sample = &layers[usize::from(tap.layer)][tap.at as usize];
                for lane in 0..4 {
                    sums[lane] += weight * i32::from(sample[lane]);
                }
            }),
        }
        Some(mean(sums)).filter(|sample| sample[3] != 0)
    }

    /// The leaves that [`Self::read`] takes the mean of: samples of their blocks' deepest layers. Samples above these are left out.
    #[inline(always)]
    pub fn leaf_taps(&mut self, position: [i32; 3], normal: [i8; 3], depth: u8) -> [LeafTap; 8] {
        let lattice = Lattice::new(position, depth);
        let is_held = self.region.depth() == depth && depth <= MAX_HELD_DEPTH;
        let (mut taps, any, deep) = match self.region.find(lattice.voxel).filter(|_| is_held) {
            Some(at) => {
                let (taps, any) = lattice.held_taps(self.region.cells_around(at), normal, depth);
                (taps, any, depth)
            }
            None => {
                let deep = self.depth_at(position, depth);
                let (taps, any) = self.found_taps(&Lattice::new(position, deep), normal, deep);
                (taps, any, deep)
            }
        };
        if !any && deep > 0 {
            taps = self.found_taps(&Lattice::new(position, 0), normal, 0).0;
        }
        taps
    }

    /// The leaves around a position, and whether there are any samples.
    #[inline(always)]
    fn found_taps(&mut self, lattice: &Lattice, normal: [i8; 3], depth: u8) -> ([LeafTap; 8], bool) {
        let (mut taps, mut count) = ([LeafTap::default(); 8], 0);
        self.for_taps(lattice, normal, depth, |tap, weight| {
            if tap.is_leaf {
                taps[count] = LeafTap { cell: tap.cell, rank: tap.rank, weight };
            }
            count += 1;
        });
        (taps, count > 0)
    }

    /// Visits the samples around a position: eight, less those that are not there and those whose weight is 0.
    #[inline(always)]
    fn for_taps(&mut self, lattice: &Lattice, normal: [i8; 3], depth: u8, mut visit: impl FnMut(Tap, i32)) {
        let around = self.facing_cells(lattice.voxel, lattice.spans, normal);
        for corner in 0..8 {
            let weight = lattice.weight(corner);
            if weight == 0 {
                continue;
            }
            let Some(found) = around[lattice.slot(corner)] else { continue };
            if let Some(tap) = self.sample(found, lattice.place(corner), depth) {
                visit(tap, weight);
            }
        }
    }

    /// The crossed cells of 2x2x2 from a voxel on whose surfaces face a normal. See [`Self::cells_around`].
    #[inline(always)]
    fn facing_cells(&mut self, voxel: [i32; 3], spans: [i32; 3], normal: [i8; 3]) -> [Option<FoundCell>; 8] {
        let mut around = self.cells_around(voxel, spans);
        for found in &mut around {
            *found = found.filter(
                #[inline(always)]
                |found| self.surfel(*found).faces(normal),
            );
        }
        around
    }

    /// Reads the colours at the middles of a cell's parts at a depth, in Morton order. The last value is 0 where there are no
    /// samples. `corner`: lowest corner of the cell, in the unit of positions. `wanted`: the parts that are read, a bit each;
    /// others have any value.
    ///
    /// As [`Self::read`] at each part, but that all are read as deep as the block at the middle of the cell is.
    #[inline(always)]
    pub fn read_cell(
        &mut self,
        corner: [i32; 3],
        normal: [i8; 3],
        depth: u8,
        wanted: u64,
        out: &mut [Sample; 64],
    ) {
        let is_held = self.region.depth() == depth && depth <= MAX_HELD_DEPTH;
        let held = self.region.find(shifted(corner, 8)).filter(|_| is_held);
        let deep = match held {
            Some(_) => depth,
            None => self.depth_at(sum(corner, [128; 3]), depth),
        };
        if let Some(at) = held {
            let (around, layer) = (self.region.cells_around(at), &self.frame.layers[usize::from(depth)][..]);
            match depth {
                0 => read_held::<1, 2, 4>(around, layer, corner, normal, wanted, out),
                _ => read_held::<2, 4, 8>(around, layer, corner, normal, wanted, out),
            }
        } else if deep == depth {
            match depth {
                0 => self.read_parts::<1, 2, 4, 8>(corner, normal, wanted, out),
                1 => self.read_parts::<2, 4, 8, 16>(corner, normal, wanted, out),
                _ => self.read_parts::<4, 8, 16, 32>(corner, normal, wanted, out),
            }
        } else {
            out[..1 << (3 * depth)].fill([0; 4]);
        }
        let mut missing = wanted;
        while missing != 0 {
            let part = missing.trailing_zeros() as usize;
            missing &= missing - 1;
            if out[part][3] == 0 {
                let middle = position(part).map(|c| (2 * c as i32 + 1) << (7 - depth));
                let at = [0, 1, 2].map(|axis| corner[axis] + middle[axis]);
                let found = if deep < depth { self.read_at(at, normal, deep) } else { None };
                let found = found.or_else(|| if deep > 0 { self.read_at(at, normal, 0) } else { None });
                out[part] = found.unwrap_or_default();
            }
        }
    }

    /// Reads the colours at the middles of the wanted of `N` parts of a cell along each axis. See [`interpolate`].
    #[inline(always)]
    fn read_parts<const N: usize, const G: usize, const W: usize, const D: usize>(
        &mut self,
        corner: [i32; 3],
        normal: [i8; 3],
        wanted: u64,
        out: &mut [Sample; 64],
    ) {
        let voxel = shifted(corner, 8);
        let mut spans = [0; 3];
        for axis in 0..3 {
            // Along an axis where the cell lies on another one, nothing beyond counts.
            spans[axis] = i32::from(corner[axis] & 255 >= 1 << (8 - WEIGHT_BITS - N.trailing_zeros()));
        }
        // The parts of 2x2x2 cells, four lanes each.
        let mut grid = [[[0; D]; G]; G];
        let mut within = true;
        for axis in 0..3 {
            within &= (voxel[axis] & 7) + spans[axis] < 8;
        }
        if within {
            let Some(block) = self.block(shifted(voxel, 3)) else {
                out[..N * N * N].fill([0; 4]);
                return;
            };
            self.take_cells::<N, G, D>(block as usize, voxel, spans, normal, &mut grid);
        } else {
            for (slot, found) in self.facing_cells(voxel, spans, normal).into_iter().enumerate() {
                if let Some(found) = found {
                    self.take_parts::<N, G, D>(found, [slot & 1, slot >> 1 & 1, slot >> 2], &mut grid);
                }
            }
        }
        let part = |[x, y, z]: [usize; 3]| {
            let lanes = &grid[z][y][4 * x..][..4];
            [lanes[0], lanes[1], lanes[2], lanes[3]]
        };
        interpolate::<N, G, W>(part, corner, wanted, out);
    }

    /// The crossed cells of 2x2x2 from a voxel on, x fastest. `spans`: 1 along axes along which the second ones count.
    #[inline(always)]
    fn cells_around(&mut self, voxel: [i32; 3], spans: [i32; 3]) -> [Option<FoundCell>; 8] {
        let mut around = [None; 8];
        let mut within = true;
        for axis in 0..3 {
            within &= (voxel[axis] & 7) + spans[axis] < 8;
        }
        if within {
            let Some(block) = self.block(shifted(voxel, 3)) else { return around };
            let block = block as usize;
            let cells = &self.frame.shape.cells().blocks()[block];
            let first = [0, 1, 2].map(|axis| (voxel[axis] & 7) as usize);
            for (slot, found) in around.iter_mut().enumerate() {
                let step = [slot & 1, slot >> 1 & 1, slot >> 2];
                if (0..3).all(|axis| step[axis] as i32 <= spans[axis]) {
                    let place = interleave([first[0] + step[0], first[1] + step[1], first[2] + step[2]]);
                    *found = cells.cell(place).map(|cell| FoundCell { block, cell });
                }
            }
            return around;
        }
        for (slot, found) in around.iter_mut().enumerate() {
            let step = [slot as i32 & 1, slot as i32 >> 1 & 1, slot as i32 >> 2];
            if (0..3).all(|axis| step[axis] <= spans[axis]) {
                *found = self.cell(sum(voxel, step));
            }
        }
        around
    }

    /// Enters the parts of those of 2x2x2 cells that face a normal and lie in one block. See [`Self::take_parts`].
    #[inline(always)]
    fn take_cells<const N: usize, const G: usize, const D: usize>(
        &self,
        block: usize,
        voxel: [i32; 3],
        spans: [i32; 3],
        normal: [i8; 3],
        grid: &mut [[[i16; D]; G]; G],
    ) {
        let (depth, shape) = (N.trailing_zeros() as u8, &self.frame.shape);
        let (cells, deep) = (&shape.cells().blocks()[block], depth.min(shape.depths()[block]));
        let surfels = shape.cells().block_surfels(block);
        let start = shape.starts()[block][usize::from(deep)] as usize;
        let samples = &self.frame.layers[usize::from(deep)][start..][..surfels.len() << (3 * deep)];
        let first = [0, 1, 2].map(|axis| (voxel[axis] & 7) as usize);
        for slot in 0..8 {
            let step = [slot & 1, slot >> 1 & 1, slot >> 2];
            if step[0] as i32 > spans[0] || step[1] as i32 > spans[1] || step[2] as i32 > spans[2] {
                continue;
            }
            let place = interleave([first[0] + step[0], first[1] + step[1], first[2] + step[2]]);
            let Some(cell) = cells.cell(place) else { continue };
            let number = cell - cells.first();
            if surfels[number].faces(normal) {
                let own = &samples[number << (3 * deep)..][..1 << (3 * deep)];
                put_parts::<N, G, D>(own, depth - deep, step, grid);
            }
        }
    }

    /// Enters the parts of a cell, `N` along each axis, into those of 2x2x2 cells; shallower ones stand for all parts in them.
    #[inline(always)]
    fn take_parts<const N: usize, const G: usize, const D: usize>(
        &self,
        found: FoundCell,
        steps: [usize; 3],
        grid: &mut [[[i16; D]; G]; G],
    ) {
        let depth = N.trailing_zeros() as u8;
        let shape = &self.frame.shape;
        let deep = depth.min(shape.depths()[found.block]);
        let number = found.cell - shape.cells().blocks()[found.block].first();
        let start = shape.starts()[found.block][usize::from(deep)] as usize + (number << (3 * deep));
        let samples = &self.frame.layers[usize::from(deep)][start..][..1 << (3 * deep)];
        put_parts::<N, G, D>(samples, depth - deep, steps, grid);
    }
}

/// The 2x2x2 places of samples of one depth around a position.
struct Lattice {
    /// The first place.
    first: [i32; 3],
    /// The voxel that it lies in.
    voxel: [i32; 3],
    /// 1 along axes along which the next places lie in the next voxel and count.
    spans: [i32; 3],
    /// Weights of the first and of the next places, by axis.
    along: [[i32; 2]; 3],
}

impl Lattice {
    #[inline(always)]
    fn new(position: [i32; 3], depth: u8) -> Self {
        let shift = 8 - u32::from(depth);
        let from_first = sum(position, [-(128 >> depth); 3]);
        let first = shifted(from_first, shift);
        let voxel = shifted(first, u32::from(depth));
        let (mut along, mut spans) = ([[0; 2]; 3], [0; 3]);
        for axis in 0..3 {
            let upper = fraction(from_first[axis], shift);
            along[axis] = [(1 << WEIGHT_BITS) - upper, upper];
            spans[axis] = if upper == 0 { 0 } else { ((first[axis] + 1) >> depth) - voxel[axis] };
        }
        Self { first, voxel, spans, along }
    }

    /// Steps from the first place to one of the eight, x fastest.
    #[inline(always)]
    fn steps(corner: usize) -> [usize; 3] {
        [corner & 1, corner >> 1 & 1, corner >> 2]
    }

    /// The weight of a place.
    #[inline(always)]
    fn weight(&self, corner: usize) -> i32 {
        let [x, y, z] = Self::steps(corner);
        self.along[0][x] * self.along[1][y] * self.along[2][z]
    }

    /// The one of 2x2x2 voxels that a place lies in, x fastest.
    #[inline(always)]
    fn slot(&self, corner: usize) -> usize {
        let [x, y, z] = Self::steps(corner).map(|step| step as i32);
        (x & self.spans[0] | (y & self.spans[1]) << 1 | (z & self.spans[2]) << 2) as usize & 7
    }

    /// A place.
    #[inline(always)]
    fn place(&self, corner: usize) -> [i32; 3] {
        let [x, y, z] = Self::steps(corner);
        sum(self.first, [x as i32, y as i32, z as i32])
    }

    /// By axis and step: the bits of a sample's number in its cell, and of that cell's slot.
    #[inline(always)]
    fn parts_and_slots(&self, depth: u8) -> ([[usize; 2]; 3], [[usize; 2]; 3]) {
        let (mut parts, mut slots) = ([[0; 2]; 3], [[0; 2]; 3]);
        for axis in 0..3 {
            for step in 0..2 {
                let inner = (self.first[axis] + step) & ((1 << depth) - 1);
                parts[axis][step as usize] = interleave([inner as usize & 3, 0, 0]) << axis;
                slots[axis][step as usize] = ((step & self.spans[axis]) as usize & 1) << axis;
            }
        }
        (parts, slots)
    }

    /// The leaves at the places in cells of a region of this depth, and whether there are any samples. Without branches: which of
    /// eight are there is as good as random.
    #[inline(always)]
    fn held_taps(&self, around: [&RegionCell; 8], normal: [i8; 3], depth: u8) -> ([LeafTap; 8], bool) {
        let (parts, slots) = self.parts_and_slots(depth);
        let crossed = around.map(|cell| cell.parts(depth) & u64::from(cell.faces(normal)).wrapping_neg());
        let (mut taps, mut any) = ([LeafTap::default(); 8], 0);
        for corner in 0..8 {
            let [x, y, z] = Self::steps(corner);
            let slot = (slots[0][x] | slots[1][y] | slots[2][z]) & 7;
            let part = parts[0][x] | parts[1][y] | parts[2][z];
            let cell = around[slot];
            let weight = self.weight(corner) * (crossed[slot] >> part & 1) as i32;
            any |= weight;
            let (rank, weight) = (rank(crossed[slot], part), weight * i32::from(cell.is_deepest));
            taps[corner] = LeafTap { cell: cell.cell, rank, weight };
        }
        (taps, any != 0)
    }

    /// Weighted sums of the samples at the places, from cells of a region of this depth. `layer`: their samples, which are zeros where
    /// there are none.
    #[inline(always)]
    fn held_sums(&self, around: [&RegionCell; 8], layer: &[Sample], normal: [i8; 3], depth: u8) -> [i32; 4] {
        let (parts, slots) = self.parts_and_slots(depth);
        let faces = around.map(|cell| -i32::from(cell.faces(normal)));
        let mut sums = [0; 4];
        for corner in 0..8 {
            let [x, y, z] = Self::steps(corner);
            let slot = (slots[0][x] | slots[1][y] | slots[2][z]) & 7;
            let part = parts[0][x] | parts[1][y] | parts[2][z];
            let weight = self.weight(corner) & faces[slot];
            let sample = &layer[around[slot].first as usize + part];
            for lane in 0..4 {
                sums[lane] += weight * i32::from(sample[lane]);
            }
        }
        sums
    }
}

/// Reads as [`Reader::read_cell`] does, from cells of a region, of which one at least is there. `layer`: their samples.
#[inline(always)]
fn read_held<const N: usize, const G: usize, const W: usize>(
    around: [&RegionCell; 8],
    layer: &[Sample],
    corner: [i32; 3],
    normal: [i8; 3],
    wanted: u64,
    out: &mut [Sample; 64],
) {
    // All of a cell that faces the normal, or none.
    let kept = around.map(|cell| -i16::from(cell.faces(normal)));
    let part = |[x, y, z]: [usize; 3]| {
        let slot = (z / N) << 2 | (y / N) << 1 | (x / N);
        let sample = layer[around[slot].first as usize + N * (z % N * N + y % N) + x % N];
        sample.map(|value| value & kept[slot])
    };
    interpolate::<N, G, W>(part, corner, wanted, out);
}

/// Reads the colours at the middles of the wanted of `N` parts of a cell along each axis. `part`: the sample of a part, by x, y
/// and z; zeros where there is none. Parts are those of 2x2x2 cells, of which `corner` lies in the first.
///
/// All parts have the same fractions along the axes, so that sums are shared: those along x first, then y, then z. `G` is twice `N`;
/// `W` is four lanes of `N`.
#[inline(always)]
fn interpolate<const N: usize, const G: usize, const W: usize>(
    part: impl Fn([usize; 3]) -> Sample,
    corner: [i32; 3],
    wanted: u64,
    out: &mut [Sample; 64],
) {
    const { assert!((N == 1 || N == 2 || N == 4) && G == 2 * N && W == 4 * N) };
    let shift = 8 - N.trailing_zeros();
    let (mut upper, mut inner) = ([0; 3], [0; 3]);
    for axis in 0..3 {
        upper[axis] = fraction(corner[axis], shift);
        inner[axis] = (corner[axis] >> shift) as usize & (N - 1);
    }
    if upper == [0; 3] && inner == [0; 3] {
        for (number, sample) in out[..N * N * N].iter_mut().enumerate() {
            *sample = part(position(number));
        }
        return;
    }
    let mut along_x = [[[0; W]; G]; G];
    for z in 0..=N {
        for y in 0..=N {
            // Each is read where it is: a row that is put together first would be waited for.
            let mut row = [[0; 4]; G];
            for x in 0..=N {
                row[x] = part([x + inner[0], y + inner[1], z + inner[2]]).map(i32::from);
            }
            for lane in 0..W {
                let [lower, upper_value] = [row[lane / 4][lane % 4], row[lane / 4 + 1][lane % 4]];
                along_x[z][y][lane] = (lower << WEIGHT_BITS) + (upper_value - lower) * upper[0];
            }
        }
    }
    let mut along_y = [[[0; W]; N]; G];
    for z in 0..=N {
        for y in 0..N {
            along_y[z][y] = between(&along_x[z][y], &along_x[z][y + 1], upper[1]);
        }
    }
    let mut sums = [[[0; W]; N]; N];
    for z in 0..N {
        for y in 0..N {
            sums[z][y] = between(&along_y[z][y], &along_y[z + 1][y], upper[2]);
        }
    }
    let mut rest = wanted;
    while rest != 0 {
        let part = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let [x, y, z] = position(part);
        let lanes = &sums[z][y][4 * x..][..4];
        out[part] = mean([lanes[0], lanes[1], lanes[2], lanes[3]]);
    }
}

/// Enters a cell's samples into the parts of 2x2x2 cells. `above`: how much less deep they are than the parts.
#[inline(always)]
fn put_parts<const N: usize, const G: usize, const D: usize>(
    samples: &[Sample],
    above: u8,
    steps: [usize; 3],
    grid: &mut [[[i16; D]; G]; G],
) {
    let mut put = |part: usize, sample: &Sample| {
        let [x, y, z] = position(part);
        grid[steps[2] * N + z][steps[1] * N + y][4 * (steps[0] * N + x)..][..4].copy_from_slice(sample);
    };
    if above == 0 {
        let samples = &samples[..N * N * N];
        for part in 0..N * N * N {
            put(part, &samples[part]);
        }
    } else {
        for part in 0..N * N * N {
            put(part, &samples[part >> (3 * above)]);
        }
    }
}

/// A sample that a reading takes.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// Layer of the sample.
    layer: u8,
    /// Place of the sample in its layer.
    at: u32,
    /// Whether it is one of its block's deepest layer, and no mean of these.
    is_leaf: bool,
    /// Index of its cell among all of the frame.
    cell: u32,
    /// Samples of its cell that precede it in its layer.
    rank: u32,
}

/// A leaf that a reading takes.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeafTap {
    /// Index of its cell among all of the frame.
    pub cell: u32,
    /// Leaves of its cell that precede it.
    pub rank: u32,
    /// The weight that it has: 0 if there is no leaf.
    pub weight: i32,
}

/// How many of a cell's crossed parts precede one.
#[inline(always)]
fn rank(parts: u64, part: usize) -> u32 {
    (parts & ((1 << part) - 1)).count_ones()
}

/// Coordinates shifted to the right.
#[inline(always)]
pub(crate) fn shifted(coordinates: [i32; 3], by: u32) -> [i32; 3] {
    let [x, y, z] = coordinates;
    [x >> by, y >> by, z >> by]
}

/// The sum of two vectors.
#[inline(always)]
pub(crate) fn sum([x, y, z]: [i32; 3], by: [i32; 3]) -> [i32; 3] {
    [x + by[0], y + by[1], z + by[2]]
}

/// The share of the upper of two samples at a coordinate, of [`WEIGHT_BITS`].
#[inline(always)]
fn fraction(coordinate: i32, shift: u32) -> i32 {
    (coordinate & ((1 << shift) - 1)) >> (shift - WEIGHT_BITS)
}

/// The sums of values by the share of the upper ones.
#[inline(always)]
fn between<const W: usize>(lower: &[i32; W], upper: &[i32; W], share: i32) -> [i32; W] {
    let mut sums = [0; W];
    for lane in 0..W {
        sums[lane] = (lower[lane] << WEIGHT_BITS) + (upper[lane] - lower[lane]) * share;
    }
    sums
}
